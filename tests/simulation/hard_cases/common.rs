//! Helpers that all hard cases share: a backend, checks of frames, tolerances, the printed table.

use std::sync::{Mutex, OnceLock, PoisonError};

use insonify::anatomy::{Bvh, Scene};
use insonify::pose::Pose;
use insonify::random::SplitMix64;
use insonify::render::{
    Backend, BackendChoice, Choice, Effect, Frame, RenderSettings, Renderer, ShaderSet, Snapshot, TestHooks, twin,
};
use insonify::selftest::bench::small;
use insonify::transducer::Probe;

/// The backend that all cases share, chosen by `INSONIFY_BACKEND`.
fn backend() -> &'static Backend {
    static BACKEND: OnceLock<Backend> = OnceLock::new();
    BACKEND.get_or_init(|| Backend::open(BackendChoice::from_environment().unwrap().unwrap_or_default()).unwrap())
}

/// The device for cases with changed shaders.
fn device() -> &'static Backend {
    static DEVICE: OnceLock<Backend> = OnceLock::new();
    DEVICE.get_or_init(|| Backend::open(BackendChoice::Device).unwrap())
}

/// A renderer of any scene, however unsound. Changed shaders need a device.
pub(crate) fn renderer(scene: &Scene, probe: &Probe, settings: &RenderSettings, shaders: &ShaderSet) -> Renderer {
    // Software devices compile one renderer at a time as fast as several.
    static COMPILE: Mutex<()> = Mutex::new(());
    let _one = COMPILE.lock().unwrap_or_else(PoisonError::into_inner);
    let backend = if *shaders == ShaderSet::default() { backend() } else { device() };
    let hooks = TestHooks { shaders: shaders.clone(), ..TestHooks::default() };
    Renderer::with_hooks(backend, scene, Bvh::build(scene).unwrap(), probe, settings, &hooks).unwrap()
}

/// Small settings with this choice for the aperture effect.
pub(crate) fn settings(rays: u32, layers: u32, aperture: Choice) -> RenderSettings {
    let plain = small(rays, layers);
    RenderSettings { effects: plain.effects.with(Effect::Aperture, aperture), ..plain }
}

/// The shipped shaders with one change: in the source of `pass`, `to` replaces `from`.
pub(crate) fn patched(pass: &str, from: &str, to: &str) -> ShaderSet {
    let mut shaders = ShaderSet::default();
    assert!(shaders.replace(pass, from, to), "{pass} has no `{from}`");
    shaders
}

/// Asserts that a pass contains these lines of code, which a case repeats in Rust.
#[track_caller]
pub(crate) fn assert_pass_contains(pass: &str, lines: &[&str]) {
    for line in lines {
        assert!(ShaderSet::default().replace(pass, line, line), "{pass} has no `{line}`");
    }
}

/// Accepted differences between a frame and that of its f64 twin.
#[derive(Debug, Clone, Copy)]
pub(crate) struct Tolerance {
    /// Mean difference of grey levels (0 to 255).
    pub(crate) grey: f64,
    /// Fraction of the sector's pixels with another tissue.
    pub(crate) other: f64,
}

/// Differences that rounding alone explains.
pub(crate) const ROUNDING: Tolerance = Tolerance { grey: 1.0, other: 0.005 };

/// Renders a frame twice and asserts that it is valid: finite, in range, nothing outside the mask, bit-identical on
/// repetition, and within `tolerance` of the twin's image.
#[track_caller]
pub(crate) fn holds(what: &str, renderer: &mut Renderer, pose: &Pose, tolerance: Tolerance) -> Snapshot {
    let (mut frame, mut again) = (Frame::default(), Frame::default());
    renderer.render(pose, &mut frame).unwrap();
    renderer.render(pose, &mut again).unwrap();
    assert_eq!(words(&frame), words(&again), "{what}: another frame on repeat");
    assert_eq!(frame.overflows, 0, "{what}");
    for i in 0..frame.mask.len() {
        let (level, label) = (frame.attenuation[i], frame.segmentation[i]);
        assert!((0.0..=1.0).contains(&level), "{what}: attenuation {level}");
        let outside = frame.mask[i] == 0;
        assert_eq!(outside, label == 0, "{what}: tissue {label} at pixel {i}");
        assert!(!outside || (frame.bmode[i], level) == (0, 0.0), "{what}: pixel {i} outside the mask");
    }
    let snapshot = renderer.snapshot(pose).unwrap();
    finite(what, &snapshot);
    let twin = twin::frame(&snapshot.inputs);
    let inside: Vec<usize> = (0..frame.mask.len()).filter(|&i| frame.mask[i] == 255).collect();
    let share = 1.0 / inside.len().max(1) as f64;
    let grey = inside.iter().map(|&i| (f64::from(frame.bmode[i]) - twin.grey[i]).abs()).sum::<f64>() * share;
    let other = inside.iter().filter(|&&i| frame.segmentation[i] != twin.segmentation[i]).count() as f64 * share;
    println!("{what}: grey levels {grey:.3} off the twin's, {:.2} % of another tissue", 100.0 * other);
    assert!(grey <= tolerance.grey && other <= tolerance.other, "{what}: {grey} {other}, {tolerance:?}");
    snapshot
}

/// Asserts that all numbers in the output of all passes are finite and in range.
#[track_caller]
pub(crate) fn finite(what: &str, s: &Snapshot) {
    for segment in s.paths.iter().flat_map(|p| &p.segments) {
        let (origin, step) = (segment.origin_mm, segment.step);
        let level = [segment.start_mm, segment.ln_amplitude_at_zero, segment.fall_np_mm, segment.echo];
        let all = origin.is_finite() && step.is_finite() && level.iter().all(|v| v.is_finite());
        assert!(all && segment.echo_range_mm.is_finite(), "{what}: {segment:?}");
        assert!(segment.fall_np_mm >= 0.0 && segment.echo.abs() <= 1.0001, "{what}: {segment:?}");
    }
    for rows in [&s.scattered, &s.baseband, &s.focused, &s.lines] {
        assert!(rows.iter().all(|v| v.is_finite()), "{what}: baseband");
    }
    assert!(s.grey.iter().all(|g| (0.0..=255.0).contains(g)), "{what}: grey");
    assert!(s.percentile_np.is_finite() && s.percentile_np >= 0.0, "{what}: {}", s.percentile_np);
}

/// All numbers of a frame as bits, for comparison.
pub(crate) fn words(frame: &Frame) -> Vec<u32> {
    let reals = frame.lines.iter().flatten().chain(&frame.attenuation).chain([&frame.attenuation_p98]);
    let bytes = frame.bmode.iter().chain(&frame.segmentation).map(|&b| u32::from(b));
    reals.map(|v| v.to_bits()).chain(bytes).collect()
}

/// Renders a frame.
pub(crate) fn frame(renderer: &mut Renderer, pose: &Pose) -> Frame {
    let mut frame = Frame::default();
    renderer.render(pose, &mut frame).unwrap();
    frame
}

/// A random vector, each component in -1..1.
pub(crate) fn vector(random: &mut SplitMix64) -> glam::DVec3 {
    glam::DVec3::new(random.between(-1.0, 1.0), random.between(-1.0, 1.0), random.between(-1.0, 1.0))
}

/// Prints a row of the documentation's table of hard cases.
pub(crate) fn row(case: &str, naive: String, remedy: &str, left: String) {
    println!("\n| {case} | {naive} | {remedy} | {left} |");
}
