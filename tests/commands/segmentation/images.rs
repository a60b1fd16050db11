//! Images that are given with labels, and files with contradictory placements, as a user meets them.

use std::path::Path;

use glam::{DAffine3, DVec3};

use super::files::{Volume, written};
use crate::program::{insonify, refused, succeeded};

const SIZE: [usize; 3] = [56, 70, 30];

/// Transform from voxel index to LPS, mm; voxels are 6 mm apart.
fn lps_from_voxel() -> DAffine3 {
    DAffine3::from_scale_rotation_translation(
        DVec3::splat(6.0),
        glam::DQuat::IDENTITY,
        DVec3::new(-165.0, -110.0, -90.0),
    )
}

/// Label and HU at a position, for a trunk near the front of its grid.
fn trunk(p: DVec3) -> (u8, i16) {
    let within =
        |centre: [f64; 3], radii: [f64; 3]| ((p - DVec3::from(centre)) / DVec3::from(radii)).length_squared() <= 1.0;
    let ring = |x: f64, y: f64| (p.x / x).powi(2) + (p.y / y).powi(2) <= 1.0;
    match () {
        () if within([-60.0, -20.0, 10.0], [55.0, 50.0, 55.0]) => (5, 60),
        () if within([80.0, 20.0, 10.0], [28.0, 30.0, 30.0]) => (1, 48),
        () if within([0.0, 55.0, 0.0], [24.0, 24.0, 900.0]) => (29, 350),
        () if ring(125.0, 82.0) => (0, 40),
        () if ring(145.0, 102.0) => (0, -100),
        () => (0, -1000),
    }
}

fn labels() -> Volume {
    Volume::of(SIZE, lps_from_voxel(), |p| trunk(p).0)
}

/// NIfTI file of 16-bit values at the positions of `grid`; `hu` changes the values.
fn image(grid: &Volume, hu: impl Fn(i16) -> i16) -> Vec<u8> {
    let mut bytes = grid.nifti();
    bytes.truncate(352);
    bytes[70..74].copy_from_slice(&[4, 0, 16, 0]);
    let of = labels();
    bytes.extend((0..of.labels.len()).flat_map(|i| hu(trunk(of.place(i)).1).to_le_bytes()));
    bytes
}

fn scene(folder: &Path, labels: &str, more: &[&str]) -> std::process::Output {
    let out = folder.join("p.glb").display().to_string();
    let usual = ["scene", "from-labels", labels, "--out", &out, "--force", "--triangles", "20000", "--json"];
    insonify(&[&usual, more].concat())
}

/// Volume of the skin, ml, and the remarks, from a printed summary.
fn skin_and_remarks(printed: &str) -> (f64, String) {
    let summary: serde_json::Value = serde_json::from_str(printed).unwrap();
    let surfaces = summary["surfaces"].as_array().unwrap();
    let skin = surfaces.iter().find(|surface| surface["name"] == "skin").unwrap();
    (skin["mesh_ml"].as_f64().unwrap(), summary["remarks"].to_string())
}

#[test]
fn a_clipped_ct_gives_the_body_of_the_whole_one_and_says_so() {
    let folder = tempfile::tempdir().unwrap();
    let grid = labels();
    let map = written(folder.path(), "labels.nii", &grid.nifti());
    let whole = written(folder.path(), "ct.nii", &image(&grid, |hu| hu));
    let clipped = written(folder.path(), "clipped.nii", &image(&grid, |hu| hu.clamp(-160, 240)));
    let (skin_ml, remarks) = skin_and_remarks(&succeeded(&scene(folder.path(), &map, &["--image", &whole])));
    assert!(remarks.contains("the image was taken as a CT in HU: air -1000, soft tissue 60, bone 350"), "{remarks}");
    // An ellipse of 145 × 102 mm, 180 mm high.
    let right_ml = std::f64::consts::PI * 145.0 * 102.0 * 180.0 * 1e-3;
    assert!((skin_ml / right_ml - 1.0).abs() < 0.02, "{skin_ml} ml, not {right_ml} ml");
    let (clipped_ml, remarks) = skin_and_remarks(&succeeded(&scene(folder.path(), &map, &["--image", &clipped])));
    assert!(remarks.contains("a CT clipped to -160 to 240 HU"), "{remarks}");
    assert!((clipped_ml / skin_ml - 1.0).abs() < 0.005, "{clipped_ml} ml, not {skin_ml} ml");
    let shifted = written(folder.path(), "shifted.nii", &image(&grid, |hu| hu + 1024));
    let found = scene(folder.path(), &map, &["--image", &shifted]);
    refused(&found, &["shifted.nii", "isn't in HU", "shifted by about 1020 HU", "--image-type mr"]);
    let narrow = written(folder.path(), "narrow.nii", &image(&grid, |hu| hu.clamp(-50, 350)));
    refused(&scene(folder.path(), &map, &["--image", &narrow]), &["clipped to -50 to 350 HU", "fat can't be told"]);
    succeeded(&scene(folder.path(), &map, &["--image", &shifted, "--image-type", "mr"]));
    refused(&scene(folder.path(), &map, &["--image-type", "mr"]), &["--image"]);
}

#[test]
fn a_ct_whose_front_and_back_are_swapped_is_refused() {
    let folder = tempfile::tempdir().unwrap();
    let grid = labels();
    let map = written(folder.path(), "labels.nii", &grid.nifti());
    let mut affine = grid.lps_from_voxel;
    affine.translation += affine.matrix3.y_axis * (SIZE[1] - 1) as f64;
    affine.matrix3.y_axis = -affine.matrix3.y_axis;
    let swapped = Volume { size: SIZE, lps_from_voxel: affine, labels: Vec::new() };
    let ct = written(folder.path(), "swapped.nii", &image(&swapped, |hu| hu));
    let found = scene(folder.path(), &map, &["--image", &ct]);
    refused(&found, &["swapped.nii", "% of the soft tissue lies in air", "Mirrored front to back, only 0 % would"]);
    // Signs of LPS and RAS exchanged: the box is elsewhere.
    let turned = DAffine3::from_scale(DVec3::new(-1.0, -1.0, 1.0)) * grid.lps_from_voxel;
    let turned = Volume { size: SIZE, lps_from_voxel: turned, labels: grid.labels.clone() };
    let body = written(folder.path(), "body.nii", &turned.nifti());
    let found = scene(folder.path(), &map, &["--body", &body]);
    refused(&found, &["body.nii", "of the same scan?", "With x and y of its affine negated", "LPS and RAS"]);
}

#[test]
fn placements_that_contradict_each_other_are_refused_or_chosen() {
    let folder = tempfile::tempdir().unwrap();
    let grid = labels();
    let with_qform = |b: f32, c: f32, qfac: f32, x: f32| {
        let mut bytes = grid.nifti();
        bytes[252..254].copy_from_slice(&1i16.to_le_bytes());
        bytes[76..80].copy_from_slice(&qfac.to_le_bytes());
        for (n, value) in [b, c, 0.0, x, 110.0, -90.0].into_iter().enumerate() {
            bytes[256 + 4 * n..260 + 4 * n].copy_from_slice(&value.to_le_bytes());
        }
        bytes
    };
    // Half a turn about y and a reversed third axis: y runs to the front, by the sform to the back.
    let mirrored = written(folder.path(), "mirrored.nii", &with_qform(0.0, 1.0, -1.0, 165.0));
    let found = scene(folder.path(), &mirrored, &[]);
    refused(&found, &["mirrored.nii", "sform and qform contradict each other", "--prefer sform", "--prefer qform"]);
    for form in ["sform", "qform"] {
        let (_, remarks) =
            skin_and_remarks(&succeeded(&scene(folder.path(), &mirrored, &["--prefer", form, "--allow-implausible"])));
        assert!(remarks.contains(&format!("the {form} was taken")), "{remarks}");
    }
    refused(&scene(folder.path(), &mirrored, &["--prefer", "both"]), &["expected one of sform, qform"]);
}
