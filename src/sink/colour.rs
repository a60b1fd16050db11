//! Colours of maps: a perceptual scale for values, and one colour for each tissue.

use crate::anatomy::Mesh;

/// Viridis, black-blue to yellow, 256 steps. By Stéfan van der Walt and Nathaniel Smith for matplotlib, CC0;
/// values of `matplotlib.colormaps["viridis"]`, rounded to 8 bits, as 0xRRGGBB.
const VIRIDIS: [u32; 256] = [
    0x440154, 0x440256, 0x450457, 0x450559, 0x46075a, 0x46085c, 0x460a5d, 0x460b5e, 0x470d60, 0x470e61, 0x471063,
    0x471164, 0x471365, 0x481467, 0x481668, 0x481769, 0x48186a, 0x481a6c, 0x481b6d, 0x481c6e, 0x481d6f, 0x481f70,
    0x482071, 0x482173, 0x482374, 0x482475, 0x482576, 0x482677, 0x482878, 0x482979, 0x472a7a, 0x472c7a, 0x472d7b,
    0x472e7c, 0x472f7d, 0x46307e, 0x46327e, 0x46337f, 0x463480, 0x453581, 0x453781, 0x453882, 0x443983, 0x443a83,
    0x443b84, 0x433d84, 0x433e85, 0x423f85, 0x424086, 0x424186, 0x414287, 0x414487, 0x404588, 0x404688, 0x3f4788,
    0x3f4889, 0x3e4989, 0x3e4a89, 0x3e4c8a, 0x3d4d8a, 0x3d4e8a, 0x3c4f8a, 0x3c508b, 0x3b518b, 0x3b528b, 0x3a538b,
    0x3a548c, 0x39558c, 0x39568c, 0x38588c, 0x38598c, 0x375a8c, 0x375b8d, 0x365c8d, 0x365d8d, 0x355e8d, 0x355f8d,
    0x34608d, 0x34618d, 0x33628d, 0x33638d, 0x32648e, 0x32658e, 0x31668e, 0x31678e, 0x31688e, 0x30698e, 0x306a8e,
    0x2f6b8e, 0x2f6c8e, 0x2e6d8e, 0x2e6e8e, 0x2e6f8e, 0x2d708e, 0x2d718e, 0x2c718e, 0x2c728e, 0x2c738e, 0x2b748e,
    0x2b758e, 0x2a768e, 0x2a778e, 0x2a788e, 0x29798e, 0x297a8e, 0x297b8e, 0x287c8e, 0x287d8e, 0x277e8e, 0x277f8e,
    0x27808e, 0x26818e, 0x26828e, 0x26828e, 0x25838e, 0x25848e, 0x25858e, 0x24868e, 0x24878e, 0x23888e, 0x23898e,
    0x238a8d, 0x228b8d, 0x228c8d, 0x228d8d, 0x218e8d, 0x218f8d, 0x21908d, 0x21918c, 0x20928c, 0x20928c, 0x20938c,
    0x1f948c, 0x1f958b, 0x1f968b, 0x1f978b, 0x1f988b, 0x1f998a, 0x1f9a8a, 0x1e9b8a, 0x1e9c89, 0x1e9d89, 0x1f9e89,
    0x1f9f88, 0x1fa088, 0x1fa188, 0x1fa187, 0x1fa287, 0x20a386, 0x20a486, 0x21a585, 0x21a685, 0x22a785, 0x22a884,
    0x23a983, 0x24aa83, 0x25ab82, 0x25ac82, 0x26ad81, 0x27ad81, 0x28ae80, 0x29af7f, 0x2ab07f, 0x2cb17e, 0x2db27d,
    0x2eb37c, 0x2fb47c, 0x31b57b, 0x32b67a, 0x34b679, 0x35b779, 0x37b878, 0x38b977, 0x3aba76, 0x3bbb75, 0x3dbc74,
    0x3fbc73, 0x40bd72, 0x42be71, 0x44bf70, 0x46c06f, 0x48c16e, 0x4ac16d, 0x4cc26c, 0x4ec36b, 0x50c46a, 0x52c569,
    0x54c568, 0x56c667, 0x58c765, 0x5ac864, 0x5cc863, 0x5ec962, 0x60ca60, 0x63cb5f, 0x65cb5e, 0x67cc5c, 0x69cd5b,
    0x6ccd5a, 0x6ece58, 0x70cf57, 0x73d056, 0x75d054, 0x77d153, 0x7ad151, 0x7cd250, 0x7fd34e, 0x81d34d, 0x84d44b,
    0x86d549, 0x89d548, 0x8bd646, 0x8ed645, 0x90d743, 0x93d741, 0x95d840, 0x98d83e, 0x9bd93c, 0x9dd93b, 0xa0da39,
    0xa2da37, 0xa5db36, 0xa8db34, 0xaadc32, 0xaddc30, 0xb0dd2f, 0xb2dd2d, 0xb5de2b, 0xb8de29, 0xbade28, 0xbddf26,
    0xc0df25, 0xc2df23, 0xc5e021, 0xc8e020, 0xcae11f, 0xcde11d, 0xd0e11c, 0xd2e21b, 0xd5e21a, 0xd8e219, 0xdae319,
    0xdde318, 0xdfe318, 0xe2e418, 0xe5e419, 0xe7e419, 0xeae51a, 0xece51b, 0xefe51c, 0xf1e51d, 0xf4e61e, 0xf6e620,
    0xf8e621, 0xfbe723, 0xfde725,
];

/// Fixed colours of built-in tissues: fluids are blue and black, soft tissues red and brown, bone is ivory.
const TISSUES: [(&str, u32); 60] = [
    ("water", 0x1a5fb4),
    ("gel", 0x3584e4),
    ("amniotic_fluid", 0x14386b),
    ("urine", 0xb59b1e),
    ("blood", 0xa51d2d),
    ("csf", 0x33a6b8),
    ("fat", 0xf6d775),
    ("skin", 0xe8b796),
    ("muscle", 0x9c3b3b),
    ("uterus_wall", 0xc2626e),
    ("cervix", 0x8f4a68),
    ("placenta", 0x7d1f4f),
    ("cord_jelly", 0xa7d3dd),
    ("vessel_wall", 0xd0454c),
    ("brain", 0xc9a0b8),
    ("choroid_plexus", 0xe05fa0),
    ("falx", 0xf5f0ff),
    ("liver", 0x7a4a26),
    ("kidney", 0x8a5a44),
    ("renal_cortex", 0x96614a),
    ("renal_sinus", 0xe8d08a),
    ("pancreas", 0xc99a5b),
    ("thyroid", 0xa34f4a),
    ("prostate", 0xb07a6a),
    ("capsule", 0xd9d2c0),
    ("pericardium", 0xe6dcc8),
    ("submucosa", 0xd8b890),
    ("mucosa", 0xb5555a),
    ("valve", 0xf3e6d0),
    ("portal_tract", 0xd7a5c0),
    ("heart", 0xd8343f),
    ("spleen", 0x6b3a5e),
    ("bowel", 0xa98a4f),
    ("soft_tissue", 0xd99078),
    ("lung_fetal", 0xe6a5a5),
    ("lung_aerated", 0xbfd6e6),
    ("air", 0x404040),
    ("cartilage", 0xb4d8a8),
    ("bone_adult", 0xe3d9b8),
    ("bone_fetal", 0xfffbe6),
    ("calvaria_fetal", 0xf2e6c2),
    ("fascia", 0xc8c0c8),
    ("soft_tissue_maternal", 0x5e3a32),
    ("bile", 0x8fae2e),
    ("gallbladder_wall", 0xb5c27a),
    ("gallstone", 0xd8c9a0),
    ("pleura", 0xf0d0dc),
    ("lung_air", 0x5d7f96),
    ("steel", 0x9fb4c8),
    ("needle", 0x4fd0ff),
    ("nylon", 0xffffff),
    ("probe_face", 0x55606a),
    ("tmm", 0x6f7f8f),
    ("tmm_anechoic", 0x1b2733),
    ("tmm_minus_9_db", 0x30414f),
    ("tmm_minus_6_db", 0x41535f),
    ("tmm_minus_3_db", 0x566a78),
    ("tmm_plus_3_db", 0x8a9bab),
    ("tmm_plus_6_db", 0xa5b5c2),
    ("tmm_plus_15_db", 0xdbe6ee),
];

/// Red, green, blue.
pub type Rgb = [u8; 3];

/// The viridis colour of `value`, clamped to 0..=1; NaN is black.
pub(crate) fn viridis(value: f32) -> Rgb {
    if value.is_nan() {
        return [0; 3];
    }
    let index = (value.clamp(0.0, 1.0) * 255.0).round() as usize;
    rgb(VIRIDIS[index.min(255)])
}

/// The colour of a tissue: fixed for the main built-in tissues, else derived from a hash of its name.
pub fn tissue(name: &str) -> Rgb {
    if let Some(&(_, colour)) = TISSUES.iter().find(|(known, _)| *known == name) {
        return rgb(colour);
    }
    // FNV-1a hash: a name has the same colour in every scene.
    let hash = name.bytes().fold(0x811c_9dc5_u32, |h, b| (h ^ u32::from(b)).wrapping_mul(0x0100_0193));
    hsv(f64::from(hash >> 16) / 65_536.0, 0.45 + 0.4 * f64::from(hash & 0xff) / 255.0, 0.85)
}

/// Colours of the segmentation numbers 0..=255: black for 0 (outside the sector), then the colour of each tissue in
/// `names`.
pub(crate) fn segmentation_palette(names: &[String]) -> Vec<Rgb> {
    let mut palette = vec![[0; 3]; 256];
    for (slot, name) in palette.iter_mut().skip(1).zip(names) {
        *slot = tissue(name);
    }
    palette
}

fn rgb(colour: u32) -> Rgb {
    let [_, r, g, b] = colour.to_be_bytes();
    [r, g, b]
}

/// RGB colour from hue, saturation and value, each 0..=1.
fn hsv(hue: f64, saturation: f64, value: f64) -> Rgb {
    [5.0, 3.0, 1.0].map(|n| {
        let k: f64 = (n + hue * 6.0) % 6.0;
        (255.0 * value * (1.0 - saturation * k.min(4.0 - k).clamp(0.0, 1.0))).round() as u8
    })
}

/// Opacity of each mesh when all are seen together, 0..=1. Large meshes are more transparent, because they enclose
/// small ones.
pub(crate) fn opacities(meshes: &[&Mesh]) -> Vec<f32> {
    let areas: Vec<f64> = meshes.iter().map(|mesh| area_mm2(mesh)).collect();
    let largest = areas.iter().copied().fold(1e-9, f64::max);
    areas.iter().map(|area| 0.10 + 0.85 * (1.0 - (area / largest).sqrt() as f32).powf(1.4)).collect()
}

fn area_mm2(mesh: &Mesh) -> f64 {
    mesh.corners_mm().map(|[a, b, c]| 0.5 * f64::from((b - a).cross(c - a).length())).sum()
}

#[cfg(test)]
mod tests {
    use super::*;

    #[test]
    fn viridis_has_its_published_ends_and_grows_lighter() {
        assert_eq!((viridis(0.0), viridis(1.0)), ([0x44, 0x01, 0x54], [0xfd, 0xe7, 0x25]));
        assert_eq!((viridis(-3.0), viridis(f32::INFINITY)), (viridis(0.0), viridis(1.0)));
        assert_eq!(viridis(f32::NAN), [0; 3]);
        let luma = |c: Rgb| 0.2126 * f64::from(c[0]) + 0.7152 * f64::from(c[1]) + 0.0722 * f64::from(c[2]);
        for i in 0..32u8 {
            let at = |n: u8| luma(viridis(f32::from(n) / 32.0));
            assert!(at(i + 1) > at(i), "step {i}");
        }
    }

    #[test]
    fn known_tissues_have_colours_of_their_own() {
        for (i, (name, colour)) in TISSUES.iter().enumerate() {
            assert!(TISSUES[..i].iter().all(|(n, c)| n != name && c != colour), "{name}");
        }
        assert_ne!(tissue("jam"), tissue("phantom_gel"));
    }

    #[test]
    fn the_palette_follows_the_numbers_of_a_frame() {
        let palette = segmentation_palette(&["blood".into(), "liver".into()]);
        assert_eq!((palette[0], palette[1], palette[2]), ([0; 3], tissue("blood"), tissue("liver")));
        assert_eq!(palette.len(), 256);
    }
}
