//! Comparison of each pass on the device with its f64 twin, given the device's output of the previous pass.
//!
//! Tolerances are those of f32 (2⁻²⁴ = 6·10⁻⁸ of a number) carried through each pass. Discrete choices may differ where
//! f32 and f64 resolve a tie differently: the lattice cell of a sample, a triangle at an edge, Russian roulette. Such
//! outliers are counted, and their fraction is bounded.

use glam::DVec2;
use insonify::render::Snapshot;
use insonify::render::twin::{self, Path, Segment};

use crate::twins::compare_motion as motion;

pub(crate) const PASSES: [&str; 18] = [
    "displace",
    "assemble",
    "refit",
    "locate",
    "trace",
    "transmission",
    "propagate",
    "beams",
    "profiles",
    "visibility",
    "march",
    "echo",
    "lateral",
    "receive",
    "detect",
    "section",
    "percentile",
    "scan_convert",
];

/// Pass of frames with multiples, in addition to [`PASSES`].
pub(crate) const MULTIPLES: &str = "multiples";

/// Passes of frames with a needle, in addition to [`PASSES`].
pub(crate) const NEEDLE_PASSES: [&str; 3] = ["needle_shadow", "needle_echo", "needle_map"];

/// Relative error of one rounding in f32.
const ROUNDING: f64 = 1.0 / 16_777_216.0;

/// Report on a pass that differs from its twin.
#[derive(Debug)]
#[allow(dead_code, reason = "read by `Debug` in a failing test")]
pub(crate) struct Mismatch {
    pub(crate) pass: &'static str,
    pub(crate) what: &'static str,
    pub(crate) outliers: usize,
    pub(crate) of: usize,
    pub(crate) allowed: f64,
    pub(crate) first: usize,
}

/// Statistics of one output's errors, relative to its tolerance.
pub(crate) struct Tally {
    pass: &'static str,
    what: &'static str,
    allowed: f64,
    count: usize,
    outliers: usize,
    first: usize,
    worst: f64,
}

impl Tally {
    /// Statistics that accept up to the fraction `allowed` of outliers.
    pub(crate) fn new(pass: &'static str, what: &'static str, allowed: f64) -> Self {
        Self { pass, what, allowed, count: 0, outliers: 0, first: 0, worst: 0.0 }
    }

    /// Adds an error relative to its tolerance. An error above 1, or NaN, is an outlier.
    pub(crate) fn add(&mut self, error: f64) {
        if error <= 1.0 {
            self.worst = self.worst.max(error);
        } else {
            self.first = if self.outliers == 0 { self.count } else { self.first };
            self.outliers += 1;
        }
        self.count += 1;
    }

    pub(crate) fn finish(self) -> Result<(), Mismatch> {
        let Self { pass, what, allowed, count, outliers, first, worst } = self;
        println!("{pass:12} {what:24} {outliers:4} outliers of {count:6}, others within {worst:.3} of the tolerance");
        // A single tie is allowed, however few values there are.
        if count > 0 && outliers as f64 <= (allowed * count as f64).max(if allowed > 0.0 { 1.0 } else { 0.0 }) {
            Ok(())
        } else {
            Err(Mismatch { pass, what, outliers, of: count, allowed, first })
        }
    }
}

/// Compares one pass with its twin.
pub(crate) fn compare(pass: &str, s: &Snapshot) -> Result<(), Mismatch> {
    match pass {
        "displace" => motion::displace(s),
        "assemble" => motion::assemble(s),
        "refit" => motion::refit(s),
        "locate" => locate(s),
        "trace" => trace(s).and_then(|()| hints(s)),
        "transmission" => transmission(s),
        "propagate" => propagate(s),
        "beams" => beams(s),
        "profiles" => profiles(s),
        "visibility" => visibility(s),
        "march" => march(s),
        "echo" => echo(s),
        "lateral" => lateral(s),
        "receive" => receive(s),
        "detect" => detect(s),
        "section" => section(s),
        "percentile" => percentile(s),
        "scan_convert" => scan_convert(s),
        "needle_shadow" => needle_shadow(s),
        "needle_echo" => needle_echo(s),
        "needle_map" => needle_map(s),
        MULTIPLES => multiples(s),
        _ => panic!("no pass is called {pass}"),
    }
}

fn locate(s: &Snapshot) -> Result<(), Mismatch> {
    let mut tally = Tally::new("locate", "surfaces", 0.005);
    for (device, twin) in s.launches.iter().zip(twin::locate(&s.inputs)) {
        let coupling = (device.coupling - twin.coupling).abs() / 1.0e-3;
        tally.add(if device.inside == twin.inside { coupling } else { f64::NAN });
    }
    tally.finish()
}

fn trace(s: &Snapshot) -> Result<(), Mismatch> {
    let twins = twin::trace(&s.inputs, &s.launches);
    // A different decision at an edge, a facet or a roulette gives a different path from there on.
    let mut tally = Tally::new("trace", "paths", 0.015);
    for (device, twin) in s.paths.iter().zip(&twins) {
        let pairs = device.segments.iter().zip(&twin.segments);
        let worst =
            pairs.map(|(a, b)| segment_error(s, a, b)).fold(0.0, |worst: f64, e| if e > worst { e } else { worst });
        tally.add(if device.segments.len() == twin.segments.len() { worst } else { f64::NAN });
    }
    tally.finish()
}

fn segment_error(s: &Snapshot, device: &Segment, twin: &Segment) -> f64 {
    // Coordinates and ranges reach 300 mm: a rounding is 2·10⁻⁵ mm, a few add up, and an oblique surface stretches them.
    let depth = s.inputs.depth_mm;
    let ends = [device.start_mm, depth];
    let place = ends.map(|r| (device.scatterer_mm(r) - twin.scatterer_mm(r)).length()).into_iter().fold(0.0, f64::max);
    let level = ends.map(|r| (device.ln_amplitude(r) - twin.ln_amplitude(r)).abs()).into_iter().fold(0.0, f64::max);
    // Errors of echoes below 10⁻⁶ (−120 dB) are relative to 10⁻⁶.
    let echo = (device.echo - twin.echo).abs() / twin.echo.abs().max(1.0e-6);
    let passed = if twin.has_reflected {
        (device.ln_passed_at_zero - twin.ln_passed_at_zero).abs()
    } else {
        ends.map(|r| (device.ln_passed(r) - twin.ln_passed(r)).abs()).into_iter().fold(0.0, f64::max)
    };
    let same = device.scatterer_density == twin.scatterer_density
        && device.texture == twin.texture
        && device.has_reflected == twin.has_reflected
        && device.scatterer_mean == twin.scatterer_mean
        && device.scatterer_deviation == twin.scatterer_deviation;
    let errors = [
        (device.start_mm - twin.start_mm).abs() / 1.0e-3,
        place / 1.0e-2,
        level / 1.0e-3,
        passed / (1.0e-3 + 1.0e-5 * twin.ln_passed_at_zero.abs()),
        echo / 1.0e-3,
        (device.echo_range_mm - twin.echo_range_mm).abs() / 1.0e-3,
        if same { 0.0 } else { 2.0 },
    ];
    errors.into_iter().fold(0.0, |worst, e| if e <= worst { worst } else { e })
}

/// Checks that each hint names the segment of the path that holds the first sample of its block.
fn hints(s: &Snapshot) -> Result<(), Mismatch> {
    let mut tally = Tally::new("trace", "hints", 0.0);
    let blocks = s.hints.len() / s.paths.len();
    for (path, hints) in s.paths.iter().zip(s.hints.chunks_exact(blocks)) {
        for (block, &hint) in hints.iter().enumerate().take(s.inputs.samples.div_ceil(s.hint_block)) {
            let range_mm = s.inputs.range_mm(block * s.hint_block);
            let near = |mm: f64| holds(path, hint.into(), range_mm + mm);
            tally.add(if near(0.0) || near(1.0e-4) || near(-1.0e-4) { 0.0 } else { f64::NAN });
        }
    }
    tally.finish()
}

fn holds(path: &Path, segment: usize, range_mm: f64) -> bool {
    twin::segment_at(path, range_mm) == segment
}

/// Adds the errors of rows of complex samples, each relative to the greatest magnitude within eight samples.
fn add_rows(tally: &mut Tally, s: &Snapshot, device: &[DVec2], twin: &[DVec2], tolerance: f64) {
    let n = s.inputs.samples;
    for (device, twin) in device.chunks_exact(n).zip(twin.chunks_exact(n)) {
        for i in 0..n {
            let near = &twin[i.saturating_sub(8)..(i + 9).min(n)];
            let scale = near.iter().map(|v| v.length()).fold(1.0e-33, f64::max);
            tally.add((device[i] - twin[i]).length() / (scale * tolerance));
        }
    }
}

/// Tolerance of a phase, rad. The device rounds a range a few times, and each mm is many turns.
fn phase_tolerance(s: &Snapshot) -> f64 {
    let reach_mm = s.inputs.depth_mm + s.inputs.probe_mm.length();
    std::f64::consts::TAU * s.inputs.phase_turns_per_mm * 4.0 * ROUNDING * reach_mm + 1.0e-5
}

fn transmission(s: &Snapshot) -> Result<(), Mismatch> {
    let Some(aperture) = &s.inputs.aperture else { return Ok(()) };
    let twin = twin::transmission(&s.inputs, aperture, &s.paths);
    // A loss of hundreds of nepers, rounded, at the start of an interval.
    let mut tally = Tally::new("transmission", "cells", 0.001);
    for (device, twin) in s.transmission.mask.iter().zip(&twin.mask) {
        tally.add((*device - *twin).length() / 2.0e-4);
    }
    tally.finish()?;
    let mut tally = Tally::new("transmission", "row losses", 0.0);
    for (device, twin) in s.transmission.row_np.iter().zip(&twin.row_np) {
        tally.add((device - twin).abs() / (2.0e-4 + 1.0e-4 * twin));
    }
    tally.finish()
}

fn propagate(s: &Snapshot) -> Result<(), Mismatch> {
    let Some(aperture) = &s.inputs.aperture else { return Ok(()) };
    // A renderer skips the transmission of planes before the first obstacle. It differs from 1 by rounding.
    let mut mask = s.shaded_mask.clone();
    mask[..s.first_plane * aperture.cells].fill(DVec2::X);
    let twin = twin::propagate(aperture, &mask);
    let mut tally = Tally::new("propagate", "fields", 0.0);
    for (row, (device, twin)) in
        s.fields.chunks_exact(aperture.cells).zip(twin.chunks_exact(aperture.cells)).enumerate()
    {
        let (slot, plane) = (row / aperture.planes, row % aperture.planes);
        if plane >= s.first_plane && slot < aperture.mode_count[plane] {
            for (device, twin) in device.iter().zip(twin) {
                // A mode's amplitude on the face is 1.
                tally.add((*device - *twin).length() / 1.0e-4);
            }
        }
    }
    // A renderer may begin at the first obstacle, not behind it.
    let shaded = |row: &[DVec2]| row.iter().any(|passes| passes.x < 1.0 - 1.5e-5 || passes.y.abs() > 1.5e-3);
    let obstacle = s.shaded_mask.chunks_exact(aperture.cells).position(shaded).unwrap_or(aperture.planes);
    tally.add(if s.first_plane <= obstacle { 0.0 } else { f64::NAN });
    tally.finish()
}

fn beams(s: &Snapshot) -> Result<(), Mismatch> {
    let Some(aperture) = &s.inputs.aperture else { return Ok(()) };
    let twin = twin::amplitudes(aperture, &s.fields);
    let mut tally = Tally::new("beams", "amplitudes", 0.0);
    let of_plane = aperture.beams * aperture.cells;
    let planes = s.amplitudes.chunks_exact(of_plane).zip(twin.chunks_exact(of_plane)).skip(s.first_plane);
    for (device, twin) in planes {
        let greatest = twin.iter().copied().fold(1.0e-20, f64::max);
        for (device, twin) in device.iter().zip(twin) {
            tally.add((device - twin).abs() / (1.0e-4 * greatest));
        }
    }
    tally.finish()
}

fn profiles(s: &Snapshot) -> Result<(), Mismatch> {
    let Some(aperture) = &s.inputs.aperture else { return Ok(()) };
    let twin = twin::powers(aperture, &s.amplitudes);
    let mut tally = Tally::new("profiles", "powers", 0.0);
    for (at, (device, twin)) in s.beam_powers.iter().zip(&twin).enumerate() {
        let twin = if at / aperture.cells < s.first_plane { aperture.shares[at] } else { *twin };
        // Beyond the array's ends the power is tiny.
        tally.add((device - twin).abs() / (1.0e-3 * twin.max(1.0e-9)));
    }
    tally.finish()?;
    // A weight at the cut may count or not.
    let mut tally = Tally::new("profiles", "weights", 0.002);
    for (device, twin) in s.profiles.iter().zip(&twin::profiles(&s.inputs, aperture, s.first_plane, &s.amplitudes)) {
        // Rounding of the correlation moves `kept`, and with it all weights, by 1e-5.
        let greatest = twin.weights.iter().copied().fold(0.05, f64::max);
        let pairs = device.weights.iter().zip(&twin.weights);
        let worst = pairs.map(|(a, b)| (a - b).abs() / (1.0e-3 * greatest)).fold(0.0, f64::max);
        tally.add(worst.max((device.kept - twin.kept).abs() / 1.0e-3));
    }
    tally.finish()
}

fn visibility(s: &Snapshot) -> Result<(), Mismatch> {
    let Some(aperture) = &s.inputs.aperture else { return Ok(()) };
    let twin = twin::visibility(&s.inputs, aperture, &s.paths, &s.beam_powers, &s.transmission.row_np);
    let mut tally = Tally::new("visibility", "scanlines", 0.002);
    for (device, twin) in s.line_gains.iter().zip(&twin) {
        let errors = [
            (device.position - twin.position).abs() / 2.0e-3,
            (device.loss_np - twin.loss_np).abs() / (1.0e-3 + 1.0e-5 * twin.loss_np),
            (device.ln_gain - twin.ln_gain).abs() / 1.0e-3,
            (device.shared_np - twin.shared_np).abs() / (1.0e-3 + 1.0e-5 * twin.shared_np),
        ];
        tally.add(errors.into_iter().fold(0.0, |worst, e| if e <= worst { worst } else { e }));
    }
    tally.finish()?;
    let mut tally = Tally::new("visibility", "blocks", 0.002);
    for (device, twin) in s.block_gains.iter().zip(&twin::block_gains(&s.inputs, aperture, &s.paths, &s.line_gains)) {
        tally.add((device.gain / twin.gain - 1.0).abs() / 1.0e-3);
        tally.add((device.position - twin.position).abs() / 2.0e-3);
    }
    tally.finish()
}

fn march(s: &Snapshot) -> Result<(), Mismatch> {
    // A sample within 10⁻⁵ mm of a face of its lattice cell (0.15 mm) may fall into the neighbour.
    let mut tally = Tally::new("march", "scatterers", 0.005);
    add_rows(&mut tally, s, &s.scattered, &twin::march(&s.inputs, &s.paths, &s.line_gains), phase_tolerance(s));
    tally.finish()?;
    if s.inputs.aperture.is_none() {
        return Ok(());
    }
    // A block that begins within rounding of a segment's end may have the neighbour's.
    let mut tally = Tally::new("march", "blocks with reflections", 0.005);
    for (device, twin) in s.reflected.iter().zip(&twin::reflected(&s.inputs, &s.paths, &s.line_gains)) {
        tally.add((device - twin).abs() / (1.0e-3 * twin.max(1.0e-6)));
    }
    tally.finish()
}

fn echo(s: &Snapshot) -> Result<(), Mismatch> {
    let mut twin = s.scattered.clone();
    twin::echo(&s.inputs, &s.paths, &s.line_gains, &mut twin);
    // Only samples with an echo; a few echoes may round to the neighbouring sample.
    let mut tally = Tally::new("echo", "samples with echoes", 0.005);
    for ((before, device), twin) in s.scattered.iter().zip(&s.baseband).zip(&twin) {
        if before != device || before != twin {
            let scale = before.length() + (*twin - *before).length();
            tally.add((*device - *twin).length() / (scale * phase_tolerance(s)));
        }
    }
    tally.finish()
}

fn lateral(s: &Snapshot) -> Result<(), Mismatch> {
    let mut tally = Tally::new("lateral", "focused baseband", 0.001);
    let twin = twin::lateral(&s.inputs, &s.block_gains, &s.reflected, &s.profiles, &s.baseband);
    // The shift of a steered look is a whole number of samples; at a tie it may be the neighbour.
    add_rows(&mut tally, s, &s.focused, &twin, phase_tolerance(s));
    tally.finish()
}

fn multiples(s: &Snapshot) -> Result<(), Mismatch> {
    let mut tally = Tally::new(MULTIPLES, "baseband", 0.0);
    let mut twin = s.with_needle.clone();
    twin::multiples(&s.inputs, &mut twin);
    add_rows(&mut tally, s, &s.with_multiples, &twin, 1.0e-4);
    tally.finish()
}

fn receive(s: &Snapshot) -> Result<(), Mismatch> {
    let mut tally = Tally::new("receive", "received baseband", 0.0);
    add_rows(&mut tally, s, &s.received, &twin::receive(&s.inputs, &s.paths, &s.with_multiples), 1.0e-5);
    tally.finish()
}

fn detect(s: &Snapshot) -> Result<(), Mismatch> {
    let twin = twin::detect(&s.inputs, &s.received);
    let mut tally = Tally::new("detect", "lines", 0.0);
    add_rows(&mut tally, s, &s.lines, &twin.lines, 1.0e-5);
    tally.finish()?;
    // A null of the speckle is a difference of large numbers, so a few levels differ.
    let mut tally = Tally::new("detect", "grey", 0.005);
    for (device, twin) in s.grey.iter().zip(&twin.grey) {
        tally.add((device - twin).abs() / 0.01);
    }
    tally.finish()
}

fn section(s: &Snapshot) -> Result<(), Mismatch> {
    let twin = twin::section(&s.inputs);
    let mut tally = Tally::new("section", "runs", 0.01);
    for (device, twin) in s.sections.runs.iter().zip(&twin.runs) {
        let pairs = device.iter().zip(twin);
        let error = pairs.map(|(a, b)| {
            let same = a.tissue == b.tissue && a.rate_np_mm == b.rate_np_mm;
            let start = (a.start_mm - b.start_mm).abs() / 1.0e-3;
            let sum = (a.sum_np - b.sum_np).abs() / (1.0e-4 + 1.0e-5 * b.sum_np);
            if same { start.max(sum) } else { 2.0 }
        });
        let worst = error.fold(0.0, f64::max);
        tally.add(if device.len() == twin.len() { worst } else { f64::NAN });
    }
    tally.finish()?;
    let mut tally = Tally::new("section", "raster", 0.005);
    for (device, twin) in s.sections.raster.iter().zip(&twin.raster) {
        // The raster keeps 16 of the 24 bits of a number.
        let tolerance = 1.0e-4 + twin.sum_np / 32768.0;
        let same = device.tissue == twin.tissue;
        tally.add(if same { (device.sum_np - twin.sum_np).abs() / tolerance } else { f64::NAN });
    }
    tally.finish()
}

fn percentile(s: &Snapshot) -> Result<(), Mismatch> {
    let twin = twin::percentile(&s.inputs, &s.sections.runs);
    let mut tally = Tally::new("percentile", "Σμ", 0.0);
    tally.add((s.percentile_np - twin).abs() / (1.0e-5 + 1.0e-4 * twin));
    tally.finish()
}

fn scan_convert(s: &Snapshot) -> Result<(), Mismatch> {
    let mut twin = twin::scan_convert(&s.inputs, &s.grey, &s.sections.raster, s.percentile_np);
    twin::needle_map(&s.inputs, &mut twin.segmentation);
    // The nearest level, or its neighbour at a tie.
    let mut grey = Tally::new("scan_convert", "B-mode", 0.0);
    let mut tissue = Tally::new("scan_convert", "segmentation", 0.001);
    let mut level = Tally::new("scan_convert", "attenuation", 0.001);
    for i in 0..s.inputs.pixels.len() {
        grey.add((f64::from(s.bmode[i]) - twin.grey[i]).abs() / 0.51);
        tissue.add(if s.segmentation[i] == twin.segmentation[i] { 0.0 } else { f64::NAN });
        level.add((s.attenuation[i] - twin.attenuation[i]).abs() / 1.0e-4);
    }
    grey.finish()?;
    tissue.finish()?;
    level.finish()
}

fn needle_shadow(s: &Snapshot) -> Result<(), Mismatch> {
    let mut twin = s.transmission.mask.clone();
    twin::needle_shadow(&s.inputs, &mut twin);
    let mut tally = Tally::new("needle_shadow", "cells", 0.0);
    for (device, twin) in s.shaded_mask.iter().zip(&twin) {
        tally.add((*device - *twin).length() / 1.0e-6);
    }
    if s.inputs.aperture.is_some() { tally.finish() } else { Ok(()) }
}

fn needle_echo(s: &Snapshot) -> Result<(), Mismatch> {
    let mut twin = s.focused.clone();
    twin::needle_echo(&s.inputs, &s.paths, &s.line_gains, &mut twin);
    // Only samples with an echo; a few echoes may round to the neighbouring sample.
    let mut tally = Tally::new("needle_echo", "samples with echoes", 0.005);
    for ((before, device), twin) in s.focused.iter().zip(&s.with_needle).zip(&twin) {
        if before != device || before != twin {
            // Errors of echoes below 10⁻⁶ (−120 dB) are relative to 10⁻⁶.
            let scale = before.length() + (*twin - *before).length() + 1.0e-6;
            tally.add((*device - *twin).length() / (scale * (1.0e-3 + phase_tolerance(s))));
        }
    }
    tally.finish()
}

fn needle_map(s: &Snapshot) -> Result<(), Mismatch> {
    let needle = s.inputs.needle.as_ref().unwrap();
    let mut twin = twin::scan_convert(&s.inputs, &s.grey, &s.sections.raster, s.percentile_np).segmentation;
    twin::needle_map(&s.inputs, &mut twin);
    // A pixel's centre on the outline may count or not.
    let mut tally = Tally::new("needle_map", "pixels", 0.02);
    for (&device, &twin) in s.segmentation.iter().zip(&twin) {
        let shown = [device, twin].map(|tissue| tissue == needle.tissue());
        if shown.contains(&true) {
            tally.add(if shown[0] == shown[1] { 0.0 } else { f64::NAN });
        }
    }
    tally.finish()
}
