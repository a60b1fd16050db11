//! Frames of shipped scenes against committed SHA-256 sums: a change that is not meant to alter images alters no bit.
//!
//! `INSONIFY_WRITE_SUMS=1 cargo test --release --test frames` rewrites the sums after a change that is meant to.

#![allow(clippy::unwrap_used, clippy::panic, reason = "a test fails by panicking")]

use std::collections::BTreeMap;
use std::fmt::Write as _;
use std::path::{Path, PathBuf};

use insonify::anatomy::export::write_moving_glb;
use insonify::anatomy::phantom::{PhantomOptions, build, movement};
use insonify::anatomy::{Bvh, Scene};
use insonify::pose::Pose;
use insonify::render::{Backend, BackendChoice, Choice, Effect, Frame, RenderSettings, Renderer};
use insonify::station::Station;
use sha2::{Digest, Sha256};

/// Scenes of `configs/`, and the obstetric phantom with few triangles.
const SCENES: [&str; 9] = [
    "sphere",
    "slabs",
    "speckle_block",
    "bone_plate",
    "qa_phantom",
    "vessel_needle",
    "gallbladder_stones",
    "lung_air",
    "obstetric",
];

/// Time of scenes that move, s.
const TIME_S: f64 = 3.2;

/// Name, rays, layers, and effect choices.
type Variant = (&'static str, u32, u32, &'static [(Effect, Choice)]);

const VARIANTS: [Variant; 4] = [
    ("lq", 1, 1, &[]),
    ("hq", 32, 3, &[]),
    (
        "all_effects",
        2,
        3,
        &[
            (Effect::Refraction, Choice::On),
            (Effect::InterfaceEchoes, Choice::On),
            (Effect::Roughness, Choice::On),
            (Effect::Reflections, Choice::On),
            (Effect::Attenuation, Choice::On),
            (Effect::Scatterers, Choice::On),
        ],
    ),
    (
        "few_effects",
        4,
        1,
        &[
            (Effect::Refraction, Choice::Off),
            (Effect::Roughness, Choice::Off),
            (Effect::Reflections, Choice::Off),
            (Effect::SpeedDisplacement, Choice::Off),
        ],
    ),
];

fn root() -> &'static Path {
    Path::new(env!("CARGO_MANIFEST_DIR"))
}

fn sums_file() -> PathBuf {
    root().join("tests/data/frames.sha256")
}

fn station_and_scene(name: &str) -> (Station, Scene) {
    let station = Station::load(&root().join(format!("configs/{name}.toml"))).unwrap();
    let scene = if name == "obstetric" {
        let options = PhantomOptions { scale: 0.3, ..PhantomOptions::default() };
        let folder = tempfile::tempdir().unwrap();
        let file = folder.path().join("phantom.glb");
        let surfaces = build(&options, &|_| {}).unwrap();
        write_moving_glb(&surfaces, &movement(&options.parameters), &file).unwrap();
        station.load_scene_from(&file).unwrap()
    } else {
        station.load_scene_from(station.scene_file().unwrap()).unwrap()
    };
    (station, scene)
}

/// Sum of everything in a frame except its times.
fn sum(frame: &Frame) -> String {
    let mut sha = Sha256::new();
    sha.update(frame.width.to_le_bytes());
    sha.update(frame.height.to_le_bytes());
    sha.update(&frame.bmode);
    sha.update(&frame.segmentation);
    sha.update(&frame.mask);
    for value in frame.attenuation.iter().chain([&frame.attenuation_p98]).chain(frame.lines.as_flattened()) {
        sha.update(value.to_le_bytes());
    }
    sha.update(frame.overflows.to_le_bytes());
    sha.finalize().iter().fold(String::new(), |mut text, byte| {
        write!(text, "{byte:02x}").unwrap();
        text
    })
}

/// Sums of all scenes and variants rendered by `backend`, by name.
fn sums(place: &str, backend: &Backend) -> BTreeMap<String, String> {
    let mut sums = BTreeMap::new();
    let mut frame = Frame::default();
    for name in SCENES {
        let (station, scene) = station_and_scene(name);
        let bvh = std::sync::Arc::new(Bvh::build(&scene).unwrap());
        let pose = station.default_pose.unwrap_or(Pose::IDENTITY);
        let mut renderer: Option<Renderer> = None;
        for (variant, rays, layers, choices) in VARIANTS {
            let mut settings = RenderSettings { lines: true, maps: true, ..station.settings };
            (settings.quality.rays, settings.quality.layers) = (rays, layers);
            for &(effect, choice) in choices {
                settings.effects = settings.effects.with(effect, choice);
            }
            let renderer = match &mut renderer {
                Some(renderer) => {
                    renderer.reconfigure(&station.probe, &settings).unwrap();
                    renderer
                }
                none => {
                    none.insert(Renderer::with_bvh(backend, &scene, bvh.clone(), &station.probe, &settings).unwrap())
                }
            };
            renderer.set_time_s(TIME_S);
            renderer.render(&pose, &mut frame).unwrap();
            assert!(frame.bmode.iter().any(|&level| level > 0), "{name} {variant} is black");
            sums.insert(format!("{place}/{name}/{variant}"), sum(&frame));
        }
    }
    sums
}

fn committed() -> BTreeMap<String, String> {
    let text = std::fs::read_to_string(sums_file()).unwrap_or_default();
    text.lines()
        .map(|line| line.split_once("  ").unwrap())
        .map(|(sum, name)| (name.to_owned(), sum.to_owned()))
        .collect()
}

fn check(place: &str, found: &BTreeMap<String, String>, device: &str) {
    let mut committed = committed();
    committed.retain(|name, _| name.starts_with(&format!("{place}/")));
    assert_eq!(committed.len(), SCENES.len() * VARIANTS.len(), "sums of {place} in {}", sums_file().display());
    let other: Vec<&String> = found.iter().filter(|&(name, sum)| committed[name] != *sum).map(|(n, _)| n).collect();
    assert!(other.is_empty(), "{} of {} frames changed on {device}: {other:#?}", other.len(), found.len());
}

#[test]
fn frames_equal_the_committed_ones_bit_for_bit() {
    let host = Backend::open(BackendChoice::Host).unwrap();
    let device = Backend::open(BackendChoice::Device).unwrap();
    let name = device.to_string();
    let (on_host, on_device) = (sums("host", &host), sums("device", &device));
    if std::env::var_os("INSONIFY_WRITE_SUMS").is_some() {
        let lines = on_host.iter().chain(&on_device).map(|(name, sum)| format!("{sum}  {name}\n"));
        std::fs::write(sums_file(), lines.collect::<String>()).unwrap();
        return;
    }
    check("host", &on_host, "the host");
    check("device", &on_device, &name);
}
