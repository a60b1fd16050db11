//! Tests of `insonify scene`, as a user types it.

use std::path::Path;

use glam::{DAffine3, DQuat, DVec3};

use super::files::{Volume, written};
use super::shapes::{MAPS, volume};
use crate::program::{insonify, refused, succeeded};

fn from_labels(labels: &str, out: &Path, more: &[&str]) -> std::process::Output {
    let out = out.display().to_string();
    insonify(&[&["scene", "from-labels", labels, "--out", &out], more].concat())
}

fn maps() -> Vec<&'static str> {
    MAPS.iter().flat_map(|map| ["--map", map]).collect()
}

#[test]
fn a_label_map_becomes_a_scene_with_a_station_a_recording_and_a_page() {
    let folder = tempfile::tempdir().unwrap();
    let at = |name: &str| folder.path().join(name).display().to_string();
    let labels = written(folder.path(), "labels.nii", &volume(DQuat::IDENTITY).nifti());
    let (page, recording) = (at("p.html"), at("p.mcap"));
    let more = [
        &maps()[..],
        &["--look-at", "spleen", "--triangles", "40000", "--json"],
        &["--report", &page, "--probe-path", &recording, "--backend", "host"],
    ]
    .concat();
    let printed = succeeded(&from_labels(&labels, &folder.path().join("p.glb"), &more));
    let summary: serde_json::Value = serde_json::from_str(&printed).unwrap();
    let names: Vec<&str> = summary["surfaces"].as_array().unwrap().iter().filter_map(|s| s["name"].as_str()).collect();
    assert!(names.starts_with(&["skin", "fat", "fascia", "soft_tissue"]) && names.contains(&"gallstone"), "{names:?}");
    let remarks = summary["remarks"].to_string();
    assert!(
        remarks.contains("a guess, a hull") && remarks.contains("feet") && !remarks.contains("doctor"),
        "{remarks}"
    );
    let page = std::fs::read_to_string(&page).unwrap();
    assert!(page.contains("spleen: the station") && page.matches("data:image/png").count() >= 5);

    succeeded(&insonify(&["doctor", &at("p.toml")]));
    succeeded(&insonify(&["render", &at("p.toml"), "--out", &at("frame"), "--backend", "host"]));
    let inspected = succeeded(&insonify(&["inspect", &recording]));
    assert!(inspected.contains("1200") || inspected.contains("1 200") || inspected.contains("1,200"), "{inspected}");
    // A second run replaces nothing unasked.
    refused(&from_labels(&labels, &folder.path().join("p.glb"), &maps()), &["p.glb is there already", "--force"]);
}

#[test]
fn wrong_files_are_refused_with_a_remedy_and_leave_no_scene() {
    let folder = tempfile::tempdir().unwrap();
    let out = folder.path().join("p.glb");
    let good = volume(DQuat::IDENTITY);
    let nifti = good.nifti();
    let changed = |change: &dyn Fn(&mut Vec<u8>)| {
        let mut bytes = nifti.clone();
        change(&mut bytes);
        bytes
    };
    let floats = changed(&|b| {
        b[70..74].copy_from_slice(&[16, 0, 32, 0]);
        let values: Vec<u8> = b[352..].iter().flat_map(|&v| (f32::from(v) + 0.25).to_le_bytes()).collect();
        b.truncate(352);
        b.extend(values);
    });
    let four = changed(&|b| {
        b[40..42].copy_from_slice(&4i16.to_le_bytes());
        b[48..50].copy_from_slice(&2i16.to_le_bytes());
        let again = b[352..].to_vec();
        b.extend(again);
    });
    let empty = changed(&|b| b[352..].fill(0));
    for (name, bytes, words) in [
        ("cut.nii", nifti[..5000].to_vec(), &["cut.nii", "bytes"][..]),
        ("header.nii", nifti[..100].to_vec(), &["header.nii"]),
        ("four.nii", four, &["four.nii", "4"]),
        ("floats.nii", floats, &["floats.nii", "--image"]),
        ("nowhere.nii", changed(&|b| b[252..256].fill(0)), &["nowhere.nii", "--assume-axes"]),
        ("picture.png", b"\x89PNG\r\n\x1a\nrest".to_vec(), &["picture.png"]),
        ("empty.nii", empty, &["empty.nii"]),
    ] {
        let path = written(folder.path(), name, &bytes);
        refused(&from_labels(&path, &out, &maps()), words);
        assert!(!out.exists() && !out.with_extension("toml").exists(), "{name}");
    }
    let path = written(folder.path(), "good.nii", &nifti);
    let unknown = [&maps()[2..], &["--map", "1=livr"]].concat();
    refused(&from_labels(&path, &out, &unknown), &["--map", "livr", "liver"]);
    refused(&from_labels(&path, &out, &["--names", "body"]), &["label 3", "--map", "--leave-out-unknown"]);
    refused(&from_labels(&path, &out, &["--names", "totl-v2"]), &["totl-v2", "total-v2"]);
    let unknown = [&maps()[..], &["--look-at", "splen"]].concat();
    refused(&from_labels(&path, &out, &unknown), &["splen", "did you mean `spleen`"]);
    refused(&from_labels("no.nii", &out, &[]), &["no.nii"]);
    refused(&from_labels(&path, &folder.path().join("p.obj"), &[]), &["p.obj", ".glb"]);
    assert!(!out.exists());
}

/// A text STL of a box, possibly without its top.
fn stl(low: DVec3, high: DVec3, open: bool) -> String {
    let corner = |n: usize| {
        DVec3::new(
            if n & 1 == 0 { low.x } else { high.x },
            if n & 2 == 0 { low.y } else { high.y },
            if n & 4 == 0 { low.z } else { high.z },
        )
    };
    let faces = [[0, 2, 3, 1], [0, 1, 5, 4], [2, 6, 7, 3], [0, 4, 6, 2], [1, 3, 7, 5], [4, 5, 7, 6]];
    let mut text = "solid a\n".to_owned();
    for face in &faces[..if open { 5 } else { 6 }] {
        for [a, b, c] in [[0, 1, 2], [0, 2, 3]] {
            text += "facet normal 0 0 0\nouter loop\n";
            for v in [a, b, c].map(|n| corner(face[n])) {
                text += &format!("vertex {} {} {}\n", v.x, v.y, v.z);
            }
            text += "endloop\nendfacet\n";
        }
    }
    text + "endsolid a\n"
}

#[test]
fn meshes_become_a_scene_and_toss_ups_are_asked_about() {
    let folder = tempfile::tempdir().unwrap();
    let (out, at) = (folder.path().join("m.glb"), |name: &str| folder.path().join(name).display().to_string());
    let liver = stl(DVec3::new(-110.0, -60.0, 0.0), DVec3::new(60.0, 50.0, 130.0), true);
    let kidney = stl(DVec3::new(-90.0, 60.0, -90.0), DVec3::new(-40.0, 110.0, 15.0), false);
    let liver = written(folder.path(), "liver.stl", liver.as_bytes());
    let kidney = written(folder.path(), "kidney.stl", kidney.as_bytes());
    let out_text = out.display().to_string();
    let run = |arguments: &[&str]| insonify(&[&["scene", "from-meshes"], arguments, &["--out", &out_text]].concat());
    let (a, b) = (format!("{liver}=liver"), format!("{kidney}=kidney_right"));
    let printed = succeeded(&run(&[&a, &b, "--units", "mm", "--axes", "lps", "--json"]));
    let summary: serde_json::Value = serde_json::from_str(&printed).unwrap();
    assert!(summary["repairs"].to_string().contains("flat cap"), "{}", summary["repairs"]);
    let rows = summary["surfaces"].as_array().unwrap();
    let of = |name: &str| rows.iter().find(|row| row["name"] == name).unwrap();
    let ml = of("liver")["mesh_ml"].as_f64().unwrap();
    assert!((ml / (170.0 * 110.0 * 130.0 * 1e-3) - 1.0).abs() < 1e-3, "{ml}");
    assert!(of("skin")["mesh_ml"].as_f64().unwrap() > ml);
    assert!(!summary["remarks"].to_string().contains("doctor"), "{}", summary["remarks"]);
    succeeded(&insonify(&["render", &at("m.toml"), "--out", &at("frame"), "--backend", "host"]));
    std::fs::remove_file(&out).unwrap();

    // One box of twelve units could be anything.
    let small = stl(DVec3::ZERO, DVec3::splat(12.0), false);
    let small = written(folder.path(), "thing.stl", small.as_bytes());
    let thing = format!("{small}=muscle");
    refused(&run(&[&thing, "--force"]), &["cannot be told", "--units"]);
    refused(&run(&[&thing, "--units", "cm", "--force"]), &["axes", "--axes"]);
    refused(&run(&[&thing, "--units", "m", "--axes", "lps", "--force"]), &["12000 mm long", "--units"]);
    refused(&run(&[&small, "--force"]), &["thing.stl", "FILE=MEANING"]);
    let cut = written(folder.path(), "cut.stl", &[&[7u8; 80][..], &9u32.to_le_bytes(), &[0; 120]].concat());
    refused(&run(&[&format!("{cut}=liver"), "--force"]), &["cut.stl"]);
    let labels = Volume::of([4, 4, 4], DAffine3::IDENTITY, |_| 1).nifti();
    let labels = written(folder.path(), "labels.nii", &labels);
    refused(&run(&[&format!("{labels}=liver"), "--force"]), &["labels.nii", "from-labels"]);
    assert!(!out.exists());
}

/// Label map of a body with liver, kidneys, aorta and bladder.
pub(crate) fn abdomen() -> Volume {
    let affine =
        DAffine3::from_translation(DVec3::new(-130.0, -90.0, -150.0)) * DAffine3::from_scale(DVec3::splat(3.0));
    Volume::of([87, 64, 100], affine, |p| {
        let within = |x: f64, y: f64, z: f64, a: f64, b: f64, c: f64| {
            ((p - DVec3::new(x, y, z)) / DVec3::new(a, b, c)).length() < 1.0
        };
        match () {
            () if within(-60.0, 40.0, 10.0, 26.0, 24.0, 54.0) => 2,
            () if within(60.0, 40.0, 20.0, 26.0, 24.0, 54.0) => 3,
            () if within(-55.0, -15.0, 70.0, 62.0, 55.0, 60.0) => 5,
            () if (p - DVec3::new(6.0, 34.0, p.z)).length() < 11.0 && p.z > -90.0 => 52,
            () if within(0.0, -30.0, -105.0, 36.0, 28.0, 30.0) => 21,
            () => 0,
        }
    })
}

#[test]
fn exams_find_the_windows_of_a_patient() {
    let folder = tempfile::tempdir().unwrap();
    let at = |name: &str| folder.path().join(name).display().to_string();
    let labels = written(folder.path(), "labels.nii", &abdomen().nifti());
    succeeded(&from_labels(&labels, &folder.path().join("p.glb"), &["--triangles", "60000"]));
    let listed = succeeded(&insonify(&["planes", &at("p.toml")]));
    for plane in ["liver", "morison", "right_kidney_across", "left_kidney", "aorta_across", "bladder", "RKL", "LKL"] {
        assert!(listed.contains(plane), "{plane}: {listed}");
    }
    succeeded(&insonify(&["exam", &at("p.toml"), "--seed", "3", "--out", &at("exam.mcap")]));
    let score = succeeded(&insonify(&["score", &at("exam.mcap"), &at("p.toml"), "--json"]));
    let score: serde_json::Value = serde_json::from_str(&score).unwrap();
    let found = score["planes"].as_array().unwrap().iter().filter(|p| p["found"] == true).count();
    assert_eq!(found, 8, "{score:#}");
}

#[test]
fn small_organs_and_names_left_out_make_scenes() {
    let folder = tempfile::tempdir().unwrap();
    let out = folder.path().join("p.glb");
    // A stump of the aorta alone, on a map that it touches on all sides; one number says nothing without a table.
    let stump = Volume::of([9, 9, 9], DAffine3::from_scale(DVec3::splat(2.0)), |_| 52);
    let stump = written(folder.path(), "stump.nii", &stump.nifti());
    succeeded(&from_labels(&stump, &out, &["--names", "total-v2", "--force"]));
    let labels = written(folder.path(), "labels.nii", &abdomen().nifti());
    let printed = succeeded(&from_labels(&labels, &out, &["--map", "liver=ignore", "--force", "--json"]));
    assert!(!printed.contains("\"liver\"") && printed.contains("\"aorta\""), "{printed}");
    // Another scan's body.
    let affine = DAffine3::from_translation(DVec3::splat(3000.0)) * DAffine3::from_scale(DVec3::splat(3.0));
    let body = written(folder.path(), "body.nii", &Volume::of([20, 20, 20], affine, |_| 1).nifti());
    std::fs::remove_file(&out).unwrap();
    refused(&from_labels(&labels, &out, &["--body", &body, "--force"]), &["--body", "0 %", "same scan"]);
    // A page that cannot be written leaves no scene.
    let blocked = folder.path().join("stump.nii/page.html").display().to_string();
    let failed = from_labels(&labels, &out, &["--report", &blocked, "--force"]);
    assert!(!failed.status.success() && !out.exists());
}

#[test]
fn parts_that_no_label_shows_are_said_and_left_out_on_request() {
    let folder = tempfile::tempdir().unwrap();
    let labels = written(folder.path(), "labels.nii", &abdomen().nifti());
    let made = |without: &[&str]| {
        let more = [&["--triangles", "40000", "--force"], without].concat();
        succeeded(&from_labels(&labels, &folder.path().join("p.glb"), &more))
    };
    let with = made(&[]);
    assert!(with.contains("kidney_right_sinus") && with.contains("liver_parenchyma"), "{with}");
    assert!(with.contains("assumed, as no label shows it: capsule, fascia, kidney"), "{with}");
    let some = made(&["--without", "kidney"]);
    assert!(!some.contains("kidney_right_sinus") && some.contains("liver_parenchyma"), "{some}");
    let none = made(&["--without", "all"]);
    assert!(
        !none.contains("assumed, as")
            && !none.contains("parenchyma")
            && !none.contains("sinus")
            && !none.contains("fascia"),
        "{none}"
    );
    let wrong = from_labels(&labels, &folder.path().join("p.glb"), &["--without", "kidny", "--force"]);
    refused(&wrong, &["kidny", "kidney"]);
}
