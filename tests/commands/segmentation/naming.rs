//! Origin of the labels' names, and whether the labels can be a human's, as a user meets them.

use std::path::Path;
use std::process::Output;

use glam::{DAffine3, DVec3};

use super::commands::abdomen;
use super::files::{Volume, written};
use crate::program::{insonify, refused, stderr, succeeded};

fn from_labels(labels: &str, out: &Path, more: &[&str]) -> Output {
    let out = out.display().to_string();
    insonify(&[&["scene", "from-labels", labels, "--out", &out, "--triangles", "20000", "--force"], more].concat())
}

/// The abdomen with other label numbers, which `number_of` gives for the usual ones.
fn renumbered(number_of: impl Fn(u8) -> u8) -> Volume {
    let mut volume = abdomen();
    volume.labels.iter_mut().for_each(|label| *label = number_of(*label));
    volume
}

/// The abdomen with its voxels mirrored left to right.
fn mirrored() -> Volume {
    let volume = abdomen();
    let lps_from_voxel = DAffine3::from_scale(DVec3::new(-1.0, 1.0, 1.0)) * volume.lps_from_voxel;
    Volume { lps_from_voxel, ..volume }
}

#[test]
fn a_mask_without_names_is_the_organ_of_its_files_name_or_refused() {
    let folder = tempfile::tempdir().unwrap();
    let out = folder.path().join("p.glb");
    let liver = renumbered(|label| u8::from(label == 5)).nifti();
    for name in ["liver.nii", "case01_liver.nii"] {
        let path = written(folder.path(), name, &liver);
        let printed = succeeded(&from_labels(&path, &out, &[]));
        assert!(printed.contains("`liver` by the name of the file: its one label, 1, has no name"), "{printed}");
        assert!(printed.contains("\nliver ") && !printed.contains("spleen"), "{printed}");
    }
    std::fs::remove_file(&out).unwrap();
    let path = written(folder.path(), "mask.nii", &liver);
    refused(&from_labels(&path, &out, &[]), &["mask.nii", "one label, 1", "--map 1=liver", "--names"]);
    let named = written(folder.path(), "liver.nii", &liver);
    refused(&from_labels(&named, &out, &["--names", "total-v2"]), &["called `liver`", "`spleen`", "--map 1=liver"]);
    assert!(!out.exists());
    let printed = succeeded(&from_labels(&path, &out, &["--map", "1=liver"]));
    assert!(printed.contains("meanings from --map"), "{printed}");
}

#[test]
fn a_folder_of_masks_becomes_the_scene_of_the_whole_map() {
    let folder = tempfile::tempdir().unwrap();
    let masks = folder.path().join("segmentations");
    std::fs::create_dir(&masks).unwrap();
    let numbers = [("kidney_right", 2), ("kidney_left", 3), ("liver", 5), ("aorta", 52), ("urinary_bladder", 21)];
    for (name, number) in numbers {
        written(&masks, &format!("{name}.nii"), &renumbered(|label| u8::from(label == number)).nifti());
    }
    written(&masks, "spleen.nii", &renumbered(|_| 0).nifti());
    let summary = |labels: &str, out: &str| -> serde_json::Value {
        let out = folder.path().join(out);
        serde_json::from_str(&succeeded(&from_labels(labels, &out, &["--json"]))).unwrap()
    };
    let whole = written(folder.path(), "labels.nii", &abdomen().nifti());
    let (whole, parts) = (summary(&whole, "a.glb"), summary(&masks.display().to_string(), "b.glb"));
    let volumes = |summary: &serde_json::Value| -> std::collections::BTreeMap<String, Option<f64>> {
        let rows = summary["surfaces"].as_array().unwrap();
        rows.iter().map(|row| (row["name"].as_str().unwrap().to_owned(), row["voxels_ml"].as_f64())).collect()
    };
    assert_eq!(volumes(&whole), volumes(&parts));
    assert!(whole["remarks"][0].as_str().unwrap().starts_with("numbers by total-v2"), "{}", whole["remarks"]);
    assert!(
        parts["remarks"][0].as_str().unwrap().starts_with("names from the names of 6 files"),
        "{}",
        parts["remarks"]
    );
    assert!(parts["remarks"].to_string().contains("1 mask without a voxel"), "{}", parts["remarks"]);

    let small = Volume::of([3, 3, 3], DAffine3::IDENTITY, |_| 1).nifti();
    written(&masks, "stomach.nii", &small);
    let output = from_labels(&masks.display().to_string(), &folder.path().join("c.glb"), &[]);
    refused(&output, &["stomach.nii has 3 × 3 × 3 voxels", "one grid"]);
}

#[test]
fn mappings_that_match_nothing_are_refused() {
    let folder = tempfile::tempdir().unwrap();
    let out = folder.path().join("p.glb");
    let path = written(folder.path(), "labels.nii", &abdomen().nifti());
    for name in ["999", "hepar"] {
        let map = format!("{name}=liver");
        refused(&from_labels(&path, &out, &["--map", &map]), &["--map", &format!("labels.nii has no `{name}`")]);
    }
    assert!(!out.exists());
}

#[test]
fn a_body_that_leaves_an_organ_outside_is_told_or_refused() {
    let folder = tempfile::tempdir().unwrap();
    let out = folder.path().join("p.glb");
    let labels = abdomen();
    let path = written(folder.path(), "labels.nii", &labels.nifti());
    let trunk = |by: f64| {
        Volume::of(labels.size, labels.lps_from_voxel, |p| {
            u8::from(((p.x - by) / 129.0).powi(2) + (p.y / 89.0).powi(2) < 1.0)
        })
    };
    let whole = written(folder.path(), "whole.nii", &trunk(0.0).nifti());
    let printed = succeeded(&from_labels(&path, &out, &["--body", &whole]));
    assert!(!printed.contains("outside the body"), "{printed}");
    let beside = written(folder.path(), "beside.nii", &trunk(24.0).nifti());
    let printed = succeeded(&from_labels(&path, &out, &["--body", &beside]));
    assert!(printed.contains("% of the labelled voxels lie outside the body"), "{printed}");
    std::fs::remove_file(&out).unwrap();
    refused(&from_labels(&path, &out, &["--body", &path]), &["--body, holds only the organs"]);
    assert!(!out.exists());
}

#[test]
fn numbers_of_another_data_set_are_refused_with_its_name() {
    let folder = tempfile::tempdir().unwrap();
    let out = folder.path().join("p.glb");
    // FLARE22: liver 1, right kidney 2, aorta 5, left kidney 13; the bladder is not in it.
    let flare = renumbered(|label| match label {
        5 => 1,
        2 => 2,
        52 => 5,
        3 => 13,
        _ => 0,
    });
    let path = written(folder.path(), "labels.nii", &flare.nifti());
    refused(
        &from_labels(&path, &out, &[]),
        &["labels.nii", "numbers of total-v2", "--names flare22", "--allow-implausible"],
    );
    let printed = succeeded(&from_labels(&path, &out, &["--names", "flare22"]));
    assert!(printed.contains("numbers by flare22, as --names says") && !printed.contains("look again"), "{printed}");
}

#[test]
fn a_mirrored_patient_is_refused_and_the_doctor_sees_one_that_was_allowed() {
    let folder = tempfile::tempdir().unwrap();
    let (out, station) = (folder.path().join("p.glb"), folder.path().join("p.toml").display().to_string());
    let path = written(folder.path(), "labels.nii", &mirrored().nifti());
    let words =
        ["left and right are exchanged", "Mirrored?", "right (i), back (j) and head (k)", "--allow-implausible"];
    refused(&from_labels(&path, &out, &[]), &words);
    assert!(!out.exists());
    let printed = succeeded(&from_labels(&path, &out, &["--allow-implausible"]));
    assert!(printed.contains("--allow-implausible: ") && printed.contains("look again: "), "{printed}");
    let found = succeeded(&insonify(&["doctor", &station, "--json"]));
    let found: serde_json::Value = serde_json::from_str(&found).unwrap();
    let defects: Vec<&str> =
        found["findings"].as_array().unwrap().iter().filter_map(|f| f["defect"].as_str()).collect();
    assert!(defects.contains(&"unusual_position"), "{found:#}");

    let path = written(folder.path(), "labels.nii", &abdomen().nifti());
    succeeded(&from_labels(&path, &out, &[]));
    let found = succeeded(&insonify(&["doctor", &station, "--json"]));
    assert!(!found.contains("unusual_"), "{found}");
}

#[test]
fn an_impossible_volume_is_refused_with_the_size_of_the_voxels() {
    let folder = tempfile::tempdir().unwrap();
    let out = folder.path().join("p.glb");
    let volume = abdomen();
    let large = Volume { lps_from_voxel: DAffine3::from_scale(DVec3::splat(10.0)) * volume.lps_from_voxel, ..volume };
    let path = written(folder.path(), "labels.nii", &large.nifti());
    refused(
        &from_labels(&path, &out, &[]),
        &["`liver` has 8", "no human's has more than 16,000 ml", "30 × 30 × 30 mm"],
    );
    let volume = abdomen();
    let small = Volume { lps_from_voxel: DAffine3::from_scale(DVec3::splat(0.1)) * volume.lps_from_voxel, ..volume };
    let path = written(folder.path(), "labels.nii", &small.nifti());
    refused(&from_labels(&path, &out, &[]), &["far too small for a human", "0.3 × 0.3 × 0.3 mm"]);
}

#[test]
fn names_with_line_breaks_and_control_characters_make_no_invalid_station() {
    let folder = tempfile::tempdir().unwrap();
    let out = folder.path().join("p.glb");
    let path = written(folder.path(), "labels.nii", &abdomen().nifti());
    for name in [r#"li\u001b[31m\"}\n[x]"#, r"a\u0000b", r"a\u202eb"] {
        let table = format!("class = [{{ name = \"{name}\", value = 5, tissue = \"liver\", priority = 60 }}]");
        let table = written(folder.path(), "evil.toml", table.as_bytes());
        let output = from_labels(&path, &out, &["--names", &table, "--leave-out-unknown"]);
        refused(&output, &["evil.toml", "line break or control character"]);
        assert!(!stderr(&output).contains('\u{1b}'), "{}", stderr(&output));
    }
    refused(&from_labels(&path, &out, &["--map", "a\nb=liver"]), &["--map", "line break"]);
    assert!(!out.exists());
    // A file may be called so.
    let odd = written(folder.path(), "li\nver = 1\n[x]\u{1b}.nii", &abdomen().nifti());
    succeeded(&from_labels(&odd, &out, &[]));
    let station = std::fs::read_to_string(out.with_extension("toml")).unwrap();
    assert!(station.parse::<toml::Table>().is_ok() && !station.contains('\u{1b}'), "{station}");
    succeeded(&insonify(&["doctor", &out.with_extension("toml").display().to_string()]));
}

#[test]
fn control_characters_in_the_names_of_segments_reach_no_terminal() {
    let folder = tempfile::tempdir().unwrap();
    let text = String::from_utf8_lossy(&Volume::of([4, 4, 4], DAffine3::IDENTITY, |_| 1).nrrd()).into_owned();
    let (header, voxels) = text.split_once("\n\n").unwrap();
    let named =
        format!("{header}\nSegment0_Name:=gr\u{1b}[31m\\nid\nSegment0_LabelValue:=1\nSegment0_Layer:=0\n\n{voxels}");
    let path = written(folder.path(), "a.nrrd", named.as_bytes());
    let output = from_labels(&path, &folder.path().join("p.glb"), &[]);
    refused(&output, &["`gr [31m", "is no known class"]);
    assert!(!stderr(&output).contains("\u{1b}[31m"), "{}", stderr(&output));
}
