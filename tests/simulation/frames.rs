//! Frames of shipped scenes against committed SHA-256 sums: a change that is not meant to alter images alters no bit.
//!
//! The host has sums, and the software device of the version that the file names. Another device, a real GPU for
//! example, rounds differently: its frames must be the same from run to run.
//!
//! `INSONIFY_WRITE_SUMS=1 cargo test --release --test simulation frames:: -- --include-ignored` rewrites the sums after a change
//! that is meant to.

#![allow(clippy::unwrap_used, clippy::panic, reason = "a test fails by panicking")]

use std::collections::BTreeMap;
use std::fmt::Write as _;
use std::path::{Path, PathBuf};
use std::sync::Mutex;

use insonify::anatomy::export::write_moving_glb;
use insonify::anatomy::{Bvh, Scene};
use insonify::phantom::{PhantomOptions, build, movement};
use insonify::pose::Pose;
use insonify::render::{Backend, BackendChoice, Choice, Effect, Frame, RenderSettings, Renderer, TraceBy};
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

/// Before the name of the driver that made the device's sums.
const DRIVER: &str = "# device: ";

/// The committed sums, and the driver of those of the device.
fn committed() -> (BTreeMap<String, String>, String) {
    let text = std::fs::read_to_string(sums_file()).unwrap_or_default();
    let driver = text.lines().find_map(|line| line.strip_prefix(DRIVER)).unwrap_or_default().to_owned();
    let sums = text
        .lines()
        .filter(|line| !line.starts_with('#'))
        .map(|line| line.split_once("  ").unwrap())
        .map(|(sum, name)| (name.to_owned(), sum.to_owned()));
    (sums.collect(), driver)
}

/// Replaces the committed sums of `place` if `INSONIFY_WRITE_SUMS` is set; returns whether it is.
fn rewrite(place: &str, found: &BTreeMap<String, String>, driver: Option<String>) -> bool {
    // Both tests may run at once.
    static FILE: Mutex<()> = Mutex::new(());
    if std::env::var_os("INSONIFY_WRITE_SUMS").is_none() {
        return false;
    }
    let _file = FILE.lock().unwrap();
    let (mut sums, committed_driver) = committed();
    sums.retain(|name, _| !name.starts_with(place));
    sums.extend(found.clone());
    let mut text = format!("{DRIVER}{}\n", driver.unwrap_or(committed_driver));
    for place in ["host/", "device/"] {
        for (name, sum) in sums.iter().filter(|(name, _)| name.starts_with(place)) {
            writeln!(text, "{sum}  {name}").unwrap();
        }
    }
    std::fs::write(sums_file(), text).unwrap();
    true
}

/// Checks that `found` are those of `expected` in the same place.
fn check(found: &BTreeMap<String, String>, expected: &BTreeMap<String, String>, device: &str) {
    assert_eq!(found.len(), SCENES.len() * VARIANTS.len());
    let other: Vec<_> = found.iter().filter(|&(name, sum)| expected.get(name) != Some(sum)).map(|(n, _)| n).collect();
    assert!(other.is_empty(), "{} of {} frames changed on {device}: {other:#?}", other.len(), found.len());
}

#[test]
fn frames_of_the_host_equal_the_committed_ones_bit_for_bit() {
    let found = sums("host", &Backend::open(BackendChoice::Host).unwrap());
    if !rewrite("host", &found, None) {
        check(&found, &committed().0, "the host");
    }
}

#[test]
#[ignore = "needs a graphics device or software Vulkan; `make test` runs it where there is one"]
fn frames_of_the_device_equal_the_committed_ones_bit_for_bit() {
    let device = Backend::open(BackendChoice::Device).unwrap();
    let found = sums("device", &device);
    if rewrite("device", &found, Some(device.driver())) {
        return;
    }
    let (committed, driver) = committed();
    if device.driver() == driver {
        check(&found, &committed, &device.to_string());
    } else {
        eprintln!("{device}: the sums are those of {driver}; compared are two runs");
        check(&found, &sums("device", &device), &device.to_string());
    }
}

#[test]
#[ignore = "needs a graphics device or software Vulkan; `make test` runs it where there is one"]
fn frames_traced_by_lanes_equal_the_committed_ones_bit_for_bit() {
    let device = Backend::open(BackendChoice::Device).unwrap();
    let (committed, driver) = committed();
    if !device.has_trace_by_lanes() || device.driver() != driver {
        eprintln!("{device}: the sums are those of {driver}; nothing is compared");
        return;
    }
    let lanes = device.tracing_by(TraceBy::Lanes).unwrap();
    check(&sums("device", &lanes), &committed, &lanes.to_string());
}
