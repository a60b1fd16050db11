//! Tests of the examples for newcomers, on a small station.
// clippy counts helpers as outside of tests; a failing helper fails its test.
#![allow(clippy::unwrap_used, clippy::expect_used)]

#[allow(dead_code, reason = "its main is not called")]
#[path = "../../examples/data_set.rs"]
mod data_set;
#[allow(dead_code, reason = "its main is not called")]
#[path = "../../examples/first_frame.rs"]
mod first_frame;
#[allow(dead_code, reason = "its main is not called")]
#[path = "../../examples/generator_on_a_frame.rs"]
mod generator_on_a_frame;
#[allow(dead_code, reason = "its main is not called")]
#[path = "../../examples/live_tracker.rs"]
mod live_tracker;
#[allow(dead_code, reason = "its main is not called")]
#[path = "../../examples/own_scene.rs"]
mod own_scene;

use std::path::{Path, PathBuf};

use insonify::dataset::{Dataset, Split};
use insonify::{Frame, Scene};
use tempfile::TempDir;

/// The examples, each with the path of its source.
const EXAMPLES: [(&str, &str); 5] = [
    ("data_set", include_str!("../../examples/data_set.rs")),
    ("first_frame", include_str!("../../examples/first_frame.rs")),
    ("generator_on_a_frame", include_str!("../../examples/generator_on_a_frame.rs")),
    ("live_tracker", include_str!("../../examples/live_tracker.rs")),
    ("own_scene", include_str!("../../examples/own_scene.rs")),
];

/// A small station that sees the sphere of `configs/sphere.toml`.
fn small_station() -> (TempDir, PathBuf) {
    let folder = tempfile::tempdir().unwrap();
    let path = folder.path().join("station.toml");
    let scene = Path::new(env!("CARGO_MANIFEST_DIR")).join("assets/scenes/sphere.glb");
    let text = format!(
        "[scene]\npath = {scene:?}\nbackground = \"liver\"\n[probe]\nscanlines = 64\nsamples = 512\n[image]\nwidth = 160\nheight = 120\n\
         [pose]\nposition_mm = [0, 0, 0]\nquaternion = [1, 0, 0, 0]\n"
    );
    std::fs::write(&path, text).unwrap();
    (folder, path)
}

/// Mean grey level of a tissue.
fn level(frame: &Frame, number: u8) -> f64 {
    let pixels = frame.bmode.iter().zip(&frame.segmentation).filter(|(_, n)| **n == number);
    let levels: Vec<f64> = pixels.map(|(grey, _)| f64::from(*grey)).collect();
    assert!(levels.len() > 100, "{} pixels of tissue {number}", levels.len());
    levels.iter().sum::<f64>() / levels.len() as f64
}

/// Number of a tissue in segmentations.
fn number(scene: &Scene, name: &str) -> u8 {
    scene.tissues.index_of(name).unwrap() as u8 + 1
}

#[test]
fn each_is_short_and_says_first_how_to_run_it() {
    for (name, source) in EXAMPLES {
        assert!(source.lines().count() < 60, "{name} has {} lines", source.lines().count());
        let run = format!("//! `cargo run --release --example {name} -- ");
        assert!(source.lines().nth(1).unwrap().starts_with(&run), "{name}");
    }
}

#[test]
fn the_first_frame_shows_the_sphere_dark() {
    let (_folder, station) = small_station();
    let frame = first_frame::render(&station).unwrap();
    assert_eq!((frame.width, frame.height), (160, 120));
    let tissues = insonify::anatomy::TissueTable::builtin().unwrap();
    let of = |name: &str| tissues.index_of(name).unwrap() as u8 + 1;
    let (fluid, liver) = (level(&frame, of("amniotic_fluid")), level(&frame, of("liver")));
    assert!(fluid + 10.0 < liver, "{fluid} {liver}");
    let generated = Path::new(env!("CARGO_MANIFEST_DIR")).join("configs/obstetric.toml");
    assert!(first_frame::render(&generated).unwrap_err().to_string().contains("generated scene"));
}

#[test]
fn the_own_scene_shows_its_lesion_dark() {
    let scene = own_scene::scene().unwrap();
    let frame = own_scene::render(&scene).unwrap();
    let (lesion, soft) = (level(&frame, number(&scene, "lesion")), level(&frame, number(&scene, "soft")));
    assert!(lesion + 10.0 < soft, "{lesion} {soft}");
}

#[test]
fn the_live_session_shows_what_its_tracker_says() {
    let (_folder, station) = small_station();
    let summary = live_tracker::run(&station, 2.0).unwrap();
    assert!(summary.presented > 2, "{}", summary.presented);
    let [good, ..] = summary.by_tracking;
    assert!(2 * good > summary.presented, "{:?}", summary.by_tracking);
    assert_eq!((summary.sinks[0].name.as_str(), summary.sinks[0].failed), ("printer", 0));
}

#[test]
fn the_data_set_is_planned_rendered_and_read() {
    let (folder, station) = small_station();
    let out = folder.path().join("data");
    data_set::render(&station, 4, [2, 1], &out).unwrap();
    let read = data_set::read(&out).unwrap();
    let training = Dataset::open(&out).unwrap().of(Split::Train).count();
    assert!(training > 0 && read.len() == training, "{read:?}");
    assert!(read.iter().all(|levels| (0.0..100.0).contains(levels)), "{read:?}");
    // Where only liver is seen, one ray is as good as two.
    assert!(read.iter().any(|levels| *levels > 0.1), "{read:?}");
}

#[test]
fn the_generator_changes_the_frame() {
    let (_folder, station) = small_station();
    let model = Path::new(env!("CARGO_MANIFEST_DIR")).join("assets/generators/demo_smooth/demo_smooth.onnx");
    let (frame, translated) = generator_on_a_frame::translate(&station, &model).unwrap();
    assert_eq!(translated.len(), frame.bmode.len());
    assert!(translated != frame.bmode && translated.iter().any(|&grey| grey > 0));
}
