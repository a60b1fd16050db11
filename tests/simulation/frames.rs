//! Comparison of shipped scenes' frames with committed SHA-256 sums. A change that is not meant to alter images must
//! not alter a bit.
//!
//! There are sums for the host, and for the software device of the version that the file names. Another device, such as
//! a real GPU, rounds differently: its frames must only be the same from run to run.
//!
//! A sum does not say how much a frame differs. For some frames of the host, a picture is stored, too: every eighth
//! pixel of the B-mode image. A failure states the difference from it.
//!
//! `INSONIFY_WRITE_SUMS=1 cargo test --release --test simulation frames:: -- --include-ignored` rewrites sums and
//! pictures after a change that is meant to alter images.

#![allow(clippy::unwrap_used, clippy::panic, reason = "a test fails by panicking")]

use std::collections::BTreeMap;
use std::fmt::Write as _;
use std::path::{Path, PathBuf};
use std::sync::Mutex;

use insonify::anatomy::export::write_moving_glb;
use insonify::anatomy::{Bvh, Scene};
use insonify::phantom::{PhantomOptions, build, movement};
use insonify::pose::Pose;
use insonify::quality::{Pair, ssim};
use insonify::render::{
    Backend, BackendChoice, Choice, Effect, Frame, Instructions, RenderSettings, Renderer, TraceBy,
};
use insonify::sink::png::{Effort, write_grey};
use insonify::station::Station;
use sha2::{Digest, Sha256};

/// Names of scenes in `configs/`, and of the obstetric phantom with few triangles.
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

/// Time at which moving scenes are rendered, s.
const TIME_S: f64 = 3.2;

/// Name of a variant, with its rays, layers and effect choices.
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

/// Whether a frame has a stored picture: each scene at its lowest quality, and the obstetric scene in each variant.
fn has_picture(scene: &str, variant: &str) -> bool {
    variant == "lq" || scene == "obstetric"
}

/// Number of frames with a stored picture.
const PICTURES: usize = SCENES.len() + VARIANTS.len() - 1;

/// Distance between the pixels of a stored picture, in pixels of the frame.
const STEP: usize = 8;

/// Limits of a difference that is rounding alone: largest difference of the mean grey level, and smallest SSIM.
const LEVEL_MAX: f64 = 0.25;
const SSIM_MIN: f64 = 0.99;

fn root() -> &'static Path {
    Path::new(env!("CARGO_MANIFEST_DIR"))
}

fn sums_file() -> PathBuf {
    root().join("tests/data/frames.sha256")
}

fn picture_file(name: &str) -> PathBuf {
    root().join(format!("tests/data/frames/{}.png", name.replace('/', "_")))
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

/// SHA-256 sum of everything in a frame except its times.
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

/// Every eighth pixel of a B-mode image, in both directions.
#[derive(Debug, Clone, PartialEq)]
struct Picture {
    size: [usize; 2],
    levels: Vec<u8>,
}

impl Picture {
    fn of(frame: &Frame) -> Self {
        let width = frame.width as usize;
        let rows = frame.bmode.chunks_exact(width).step_by(STEP);
        let levels = rows.flat_map(|row| row.iter().copied().step_by(STEP)).collect();
        Self { size: [width.div_ceil(STEP), (frame.height as usize).div_ceil(STEP)], levels }
    }

    /// The stored picture for a frame.
    fn stored(name: &str) -> Self {
        let path = picture_file(name);
        let image = image::open(&path).unwrap_or_else(|error| panic!("{}: {error}", path.display())).into_luma8();
        Self { size: [image.width() as usize, image.height() as usize], levels: image.into_raw() }
    }

    fn write(&self, name: &str) {
        let path = picture_file(name);
        std::fs::create_dir_all(path.parent().unwrap()).unwrap();
        let [width, height] = self.size.map(|side| side as u32);
        write_grey(&path, width, height, &self.levels, Effort::Small).unwrap();
    }

    /// Differences of this picture from `other`.
    fn moved(&self, other: &Self) -> Moved {
        assert_eq!(self.size, other.size, "the picture has another size");
        let mean = |levels: &[u8]| levels.iter().map(|&level| f64::from(level)).sum::<f64>() / levels.len() as f64;
        let pairs = self.levels.iter().zip(&other.levels);
        Moved {
            level: mean(&self.levels) - mean(&other.levels),
            most: pairs.map(|(one, other)| one.abs_diff(*other)).max().unwrap(),
            ssim: ssim(&Pair::new(self.size, &self.levels, &other.levels, None).unwrap()),
        }
    }
}

/// Differences of a picture from another one.
#[derive(Debug, Clone, Copy)]
struct Moved {
    /// Difference of the mean grey level.
    level: f64,
    /// Largest difference of a grey level.
    most: u8,
    ssim: f64,
}

impl Moved {
    fn is_rounding(&self) -> bool {
        self.level.abs() <= LEVEL_MAX && self.ssim >= SSIM_MIN
    }

    fn said(&self, name: &str) -> String {
        let Self { level, most, ssim } = self;
        format!("{name}: mean level {level:+.3}, largest difference {most} grey levels, SSIM {ssim:.5}")
    }
}

/// Sums and pictures of rendered frames, for comparison.
#[derive(Debug, Default)]
struct Rendered {
    /// Sums of all scenes and variants, by `PLACE/SCENE/VARIANT`; the place is `host` or `device`.
    sums: BTreeMap<String, String>,
    /// Pictures of some frames, by `SCENE/VARIANT`.
    pictures: BTreeMap<String, Picture>,
}

/// Renders all scenes and variants by `backend`.
fn render(place: &str, backend: &Backend) -> Rendered {
    let mut rendered = Rendered::default();
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
            rendered.sums.insert(format!("{place}/{name}/{variant}"), sum(&frame));
            if has_picture(name, variant) {
                rendered.pictures.insert(format!("{name}/{variant}"), Picture::of(&frame));
            }
        }
    }
    rendered
}

/// Start of the line that names the driver of the device's sums.
const DRIVER: &str = "# device: ";

/// The committed sums by name, and the driver of the device's sums.
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

/// If `INSONIFY_WRITE_SUMS` is set, replaces the committed sums of `place`, and the pictures if that is the host.
/// Returns whether it is set.
fn rewrite(place: &str, found: &Rendered, driver: Option<String>) -> bool {
    // Both tests may run at once.
    static FILE: Mutex<()> = Mutex::new(());
    if std::env::var_os("INSONIFY_WRITE_SUMS").is_none() {
        return false;
    }
    let _file = FILE.lock().unwrap();
    let (mut sums, committed_driver) = committed();
    sums.retain(|name, _| !name.starts_with(place));
    sums.extend(found.sums.clone());
    let mut text = format!("{DRIVER}{}\n", driver.unwrap_or(committed_driver));
    for place in ["host/", "device/"] {
        for (name, sum) in sums.iter().filter(|(name, _)| name.starts_with(place)) {
            writeln!(text, "{sum}  {name}").unwrap();
        }
    }
    std::fs::write(sums_file(), text).unwrap();
    if place == "host" {
        found.pictures.iter().for_each(|(name, picture)| picture.write(name));
    }
    true
}

/// Checks that the sums of `found` are those of `expected`. A failure states the differences from the host's pictures.
fn check(found: &Rendered, expected: &BTreeMap<String, String>, device: &str) {
    assert_eq!(found.sums.len(), SCENES.len() * VARIANTS.len());
    let other = found.sums.iter().filter(|&(name, sum)| expected.get(name) != Some(sum)).map(|(name, _)| name);
    let other: Vec<_> = other.collect();
    if other.is_empty() {
        return;
    }
    let of_other = |name: &String| other.iter().any(|other| other.split_once('/').unwrap().1 == *name);
    let pictures = found.pictures.iter().filter(|(name, _)| of_other(name));
    let moved: Vec<String> = pictures.map(|(name, picture)| picture.moved(&Picture::stored(name)).said(name)).collect();
    panic!(
        "{} of {} frames changed on {device}: {other:#?}\nfrom the pictures of the host: {moved:#?}",
        other.len(),
        found.sums.len()
    );
}

#[test]
fn frames_of_the_host_equal_the_committed_ones_bit_for_bit() {
    let found = render("host", &Backend::open(BackendChoice::Host).unwrap());
    if rewrite("host", &found, None) {
        return;
    }
    assert_eq!(found.pictures.len(), PICTURES);
    let moved = |(name, picture): (&String, &Picture)| {
        let moved = picture.moved(&Picture::stored(name));
        (!moved.is_rounding()).then(|| moved.said(name))
    };
    let moved: Vec<String> = found.pictures.iter().filter_map(moved).collect();
    assert!(moved.is_empty(), "frames of the host moved by more than rounding: {moved:#?}");
    check(&found, &committed().0, "the host");
}

#[test]
fn frames_of_the_host_are_the_same_with_narrower_instructions() {
    let of_processor = Instructions::of_processor();
    for narrower in Instructions::ALL.into_iter().filter(|&narrower| narrower < of_processor) {
        narrower.limit().unwrap();
        let host = Backend::open(BackendChoice::Host).unwrap();
        let found = render("host", &host);
        of_processor.limit().unwrap();
        check(&found, &committed().0, &format!("the host with {}", narrower.name()));
    }
}

#[test]
fn a_frame_that_moved_is_told_from_one_that_rounds_otherwise() {
    let levels: Vec<u8> = (0..64 * 48).map(|i: u32| (i.wrapping_mul(2_654_435_761) >> 25) as u8 + 40).collect();
    let picture = Picture { size: [64, 48], levels };
    assert!(picture.moved(&picture).is_rounding() && picture.moved(&picture).most == 0);
    let change = |of: &dyn Fn(usize, u8) -> u8| Picture {
        levels: picture.levels.iter().enumerate().map(|(i, &level)| of(i, level)).collect(),
        ..picture.clone()
    };
    let rounded = change(&|i, level| level + u8::from(i % 7 == 0)).moved(&picture);
    assert!(rounded.is_rounding() && rounded.most == 1, "{rounded:?}");
    let brighter = change(&|_, level| level + 2).moved(&picture);
    assert!(!brighter.is_rounding() && (brighter.level - 2.0).abs() < 1e-9, "{brighter:?}");
    let shifted = change(&|i, _| picture.levels[(i + 1) % picture.levels.len()]).moved(&picture);
    assert!(!shifted.is_rounding() && shifted.level == 0.0 && shifted.ssim < 0.5, "{shifted:?}");
}

#[test]
#[ignore = "needs a graphics device or software Vulkan; `make test` runs it where there is one"]
fn frames_of_the_device_equal_the_committed_ones_bit_for_bit() {
    let device = Backend::open(BackendChoice::Device).unwrap();
    let found = render("device", &device);
    if !rewrite("device", &found, Some(device.driver())) {
        check(&found, &sums_of(&device), &device.to_string());
    }
}

#[test]
#[ignore = "needs a device whose subgroups fit; `make test` runs it where there is one"]
fn frames_traced_by_lanes_equal_the_committed_ones_bit_for_bit() {
    let device = Backend::open(BackendChoice::Device).unwrap();
    // scripts/test lists a test that says so as ignored.
    assert!(device.has_trace_by_lanes(), "cannot run here: {device} has no trace by lanes");
    let lanes = device.tracing_by(TraceBy::Lanes).unwrap();
    check(&render("device", &lanes), &sums_of(&lanes), &lanes.to_string());
}

/// Expected sums for a device: the committed ones, or those of a second run if the device has another driver.
fn sums_of(device: &Backend) -> BTreeMap<String, String> {
    let (committed, driver) = committed();
    if device.driver() == driver {
        return committed;
    }
    eprintln!("{device}: the sums are those of {driver}; compared are two runs");
    render("device", device).sums
}
