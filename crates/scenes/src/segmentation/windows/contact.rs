//! Contact of a probe's face with the skin: how far the probe is pressed until the whole face touches.

use glam::DVec3;

use super::Sight;
use crate::segmentation::probe_choice::Face;

/// Least depth to which a probe is pressed into the skin, mm.
pub(crate) const PRESS_MM: f64 = 4.0;
/// Greatest depth, mm: soft skin over the abdomen yields by some 15 mm.
const PRESS_MAX_MM: f64 = 15.0;
/// Least distance of the face from bone or gas, mm.
const SPARED_MM: f64 = 2.0;
/// Depth below the skin from which lines to the face start, mm.
const INSIDE_MM: f64 = 40.0;
/// Number of points on the face.
const POINTS: usize = 13;

/// How a face lies on the skin.
#[derive(Debug, Clone, Copy, PartialEq)]
pub struct Touch {
    /// Depth of the face's middle below the skin, mm.
    pub press_mm: f64,
    /// Share of the face that touches skin, 0..=1.
    pub share: f64,
}

/// Contact of the face with its middle over `contact_mm`, looking against `to_probe`, with its width along `lateral`.
/// The press is the least that brings most of the face into contact, as far as skin yields and bone and gas allow.
pub(super) fn touch(face: &Face, sight: &Sight, contact_mm: DVec3, to_probe: DVec3, lateral: DVec3) -> Touch {
    let aside = |n: usize| face.half_width_mm * (2.0 * n as f64 / (POINTS - 1) as f64 - 1.0);
    // For each point, the press from which it touches; `None` outside the body.
    let needed: Vec<Option<f64>> = (0..POINTS)
        .map(|n| {
            let from = contact_mm + lateral * aside(n) - to_probe * INSIDE_MM;
            let skin_mm = sight.skin().exit(from, to_probe)?.distance(from) - INSIDE_MM;
            Some(face.height_mm(aside(n)) - skin_mm)
        })
        .collect();
    let spared = (0..POINTS).filter_map(|n| {
        let from = contact_mm + lateral * aside(n) - to_probe * INSIDE_MM;
        let hard_mm = sight.hard_exit(from, to_probe)?.distance(from) - INSIDE_MM;
        Some(face.height_mm(aside(n)) - hard_mm - SPARED_MM)
    });
    let most_mm = spared.fold(PRESS_MAX_MM, f64::min).max(0.0);
    // A point under more than the greatest press would lie deep within the body.
    let touching = |press_mm: f64| {
        let touches = |needed_mm: f64| (press_mm - PRESS_MAX_MM..=press_mm).contains(&needed_mm);
        needed.iter().filter(|needed| needed.is_some_and(touches)).count()
    };
    let mut best = (touching(PRESS_MM.min(most_mm)), PRESS_MM.min(most_mm));
    for press_mm in needed.iter().flatten().map(|mm| mm + 0.5).filter(|mm| (PRESS_MM..=most_mm).contains(mm)) {
        let count = touching(press_mm);
        if count > best.0 || (count == best.0 && press_mm < best.1) {
            best = (count, press_mm);
        }
    }
    Touch { press_mm: best.1, share: best.0 as f64 / POINTS as f64 }
}

#[cfg(test)]
mod tests {
    use insonify_core::anatomy::Mesh;
    use insonify_core::anatomy::analytic::{cuboid, sphere};

    use super::*;
    use crate::segmentation::from_labels::Made;

    const CONVEX: Face = Face { half_width_mm: 30.0, radius_mm: 60.0 };

    fn sight(parts: Vec<(&str, Mesh)>) -> Sight {
        let made = |(tissue, mesh): (&str, Mesh)| Made {
            name: tissue.to_owned(),
            tissue: tissue.to_owned(),
            priority: 0,
            mesh,
            segment: None,
            voxels_mm3: None,
        };
        let made: Vec<Made> = parts.into_iter().map(made).collect();
        Sight::new(&made, Vec::new(), |made| made.tissue == "bone").unwrap()
    }

    /// A block whose top lies at z = 0.
    fn block() -> (&'static str, Mesh) {
        ("skin", moved(cuboid(glam::Vec3::new(-150.0, -150.0, -200.0), glam::Vec3::new(150.0, 150.0, 0.0)), 0.0))
    }

    fn moved(mut mesh: Mesh, z_mm: f32) -> Mesh {
        mesh.vertices_mm.iter_mut().for_each(|v| v.z += z_mm);
        mesh
    }

    #[test]
    fn a_convex_face_is_pressed_until_its_ends_touch() {
        // Its ends stand 60 − √(60² − 30²) = 8.04 mm above the middle.
        let found = touch(&CONVEX, &sight(vec![block()]), DVec3::ZERO, DVec3::Z, DVec3::X);
        assert!((found.press_mm - 8.54).abs() < 0.05 && found.share == 1.0, "{found:?}");
        let linear = Face { half_width_mm: 20.0, radius_mm: f64::INFINITY };
        let found = touch(&linear, &sight(vec![block()]), DVec3::ZERO, DVec3::Z, DVec3::X);
        assert_eq!(found, Touch { press_mm: PRESS_MM, share: 1.0 });
    }

    #[test]
    fn bone_below_the_skin_and_a_narrow_limb_end_the_contact() {
        let bone = ("bone", cuboid(glam::Vec3::new(-10.0, -10.0, -18.0), glam::Vec3::new(10.0, 10.0, -8.0)));
        let found = touch(&CONVEX, &sight(vec![block(), bone]), DVec3::ZERO, DVec3::Z, DVec3::X);
        assert!((found.press_mm - 6.0).abs() < 0.05 && (0.7..1.0).contains(&found.share), "{found:?}");
        let limb = ("skin", moved(sphere(glam::Vec3::ZERO, 25.0, 5), -25.0));
        let found = touch(&CONVEX, &sight(vec![limb]), DVec3::ZERO, DVec3::Z, DVec3::X);
        assert!((0.4..0.9).contains(&found.share), "{found:?}");
    }
}
