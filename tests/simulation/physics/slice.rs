//! The slice thickness: a few paths across it give the same image as very many.

use std::path::Path;

use insonify::render::{Frame, Quality};
use insonify::station::Station;

use super::bench::{Rig, at};

/// Side of a patch, pixels.
const PATCH: usize = 32;

/// Mean absolute difference of the mean grey levels of corresponding patches.
fn patch_difference(a: &Frame, b: &Frame) -> f64 {
    let (width, height) = (a.width as usize, a.height as usize);
    let mean = |frame: &Frame, x: usize, y: usize| {
        let pixels = (0..PATCH * PATCH).map(|i| (y + i / PATCH) * width + x + i % PATCH);
        let inside: Vec<f64> = pixels.filter(|&i| frame.mask[i] > 0).map(|i| f64::from(frame.bmode[i])).collect();
        (inside.len() >= PATCH * PATCH / 2).then(|| inside.iter().sum::<f64>() / inside.len() as f64)
    };
    let places = (0..(height / PATCH) * (width / PATCH))
        .map(|i| (i % (width / PATCH) * PATCH, i / (width / PATCH) * PATCH))
        .filter_map(|(x, y)| Some((mean(a, x, y)? - mean(b, x, y)?).abs()));
    let differences: Vec<f64> = places.collect();
    differences.iter().sum::<f64>() / differences.len() as f64
}

#[test]
fn high_quality_is_within_two_grey_levels_of_its_limit() {
    for name in ["sphere", "slabs", "vessel_needle", "gallbladder_stones", "lung_air"] {
        let mut station = Station::load(Path::new(&format!("configs/{name}.toml"))).unwrap();
        station.probe.samples = 1536.into();
        let scene = station.load_scene_from(station.scene_file().unwrap()).unwrap();
        let pose = station.default_pose.unwrap_or(at(0.0, 0.0, 0.0));
        let frame = |rays, layers| {
            let mut settings = station.settings;
            settings.quality = Quality { rays, layers, seed: 0 };
            Rig::new(&scene, &station.probe, &settings).frame(&pose)
        };
        let limit = frame(128, 33);
        let difference = patch_difference(&frame(32, 3), &limit);
        println!("{name}: 32×3 differs from 128×33 by {difference:.2} grey levels");
        assert!(difference < 2.0, "{name}: {difference} grey levels");
    }
}
