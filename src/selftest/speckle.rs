//! Speckle of homogeneous blocks: its statistics, level, decay with depth, and phase shift with tissue displacement.

use glam::DVec2;

use super::bench::{Bench, at, grainy, linear, slab, small};
use super::measure::{line, magnitude, mean_square};
use super::{Check, Family, Rig};
use crate::acoustics::attenuation::attenuation_db_mm;
use crate::acoustics::decibel::db_from_amplitude;
use crate::anatomy::Tissue;
use crate::render::{Choice, Effect, Frame, RenderError};
use crate::statistics::slope;
use crate::transducer::Probe;

/// RMS amplitude of the scatterers.
const DEVIATION: f64 = 0.01;
/// Attenuation of the lossy block, dB/cm/MHz.
const ALPHA: f64 = 0.5;
/// Displacement of the tissue toward the probe, mm.
const NEARER_MM: f64 = 0.01;
/// Ratio of mean to standard deviation of a Rayleigh distribution: √(π/(4 − π)).
const RAYLEIGH_SNR: f64 = 1.913_058_4;
/// Number of depth bands for the fit of the decay.
const BANDS: usize = 64;
/// Ranges of lags in depth and across in which repetition is searched, mm. They begin beyond the smear by pulse and
/// beam, and end while enough samples remain.
const LAGS_MM: (f64, f64) = (3.0, 80.0);
const LAGS_ACROSS_MM: (f64, f64) = (4.0, 25.0);
/// Step between compared scanlines; about a beam width.
const LINE_STEP: u32 = 4;
/// Samples from one lag to the next; less than the pulse's length.
const LAG_STEP: usize = 2;

/// Elevational slides of the probe, mm, and the depth range in which speckle is compared, mm.
const SLIDES_MM: [f64; 3] = [0.1, 0.4, 1.0];
const SLIDE_DEPTHS_MM: [f64; 2] = [55.0, 85.0];

/// Positions of a lossless block and a lossy one.
pub(super) struct Speckle {
    plain: DVec2,
    lossy: DVec2,
}

impl Speckle {
    pub(super) fn new(bench: &mut Bench) -> Self {
        let mut block = |tissue: Tissue| {
            let (tissue, place) = (bench.tissue(tissue), bench.place());
            // The probe is inside the block, so the block's surface is not seen.
            bench.add(tissue, 1, slab(place, 40.0, -20.0, 130.0));
            place
        };
        Self {
            plain: block(grainy(0.0, DEVIATION)),
            lossy: block(Tissue { attenuation_db_cm_mhz: ALPHA, ..grainy(0.0, DEVIATION) }),
        }
    }
}

/// Envelopes in each depth band. Omits scanlines whose beam is cut off by the sector's edge.
fn bands(probe: &Probe, frame: &Frame, bands: usize) -> Vec<Vec<f64>> {
    let length = probe.sample_count() as usize / bands;
    let lines = || (8..probe.scanlines - 8).map(|l| line(probe, frame, l));
    (0..bands)
        .map(|band| {
            let part = |l: &'_ [[f32; 2]]| l.iter().skip(band * length).take(length).map(|&s| magnitude(s)).collect();
            lines().flat_map(|l| -> Vec<f64> { part(l) }).collect()
        })
        .collect()
}

/// Magnitude of the correlation over pairs of scanlines, 0 to 1.
fn correlation<'a>(pairs: impl Iterator<Item = (&'a [[f32; 2]], &'a [[f32; 2]])>) -> f64 {
    let [re, im, first, second] = sums(pairs);
    // 0/0 stays NaN, so that a frame without speckle fails.
    re.hypot(im) / (first * second).sqrt()
}

/// Sums over pairs of scanlines: real and imaginary part of the second's samples times the first's conjugate samples,
/// then the powers of both.
fn sums<'a>(pairs: impl Iterator<Item = (&'a [[f32; 2]], &'a [[f32; 2]])>) -> [f64; 4] {
    let [mut re, mut im, mut first, mut second] = [0.0; 4];
    for (a, b) in pairs.flat_map(|(a, b)| a.iter().zip(b)) {
        let [ar, ai, br, bi] = [a[0], a[1], b[0], b[1]].map(f64::from);
        re += br * ar + bi * ai;
        im += bi * ar - br * ai;
        first += ar * ar + ai * ai;
        second += br * br + bi * bi;
    }
    [re, im, first, second]
}

/// Maximum of two values, NaN if either is NaN.
fn most(a: f64, b: f64) -> f64 {
    if a.is_nan() || a > b { a } else { b }
}

/// Largest correlation of a frame's scanlines with themselves at another depth.
fn likeness_along(probe: &Probe, frame: &Frame) -> f64 {
    let lag = |mm: f64| (mm / probe.sample_spacing_mm()) as usize;
    let lines = || (0..probe.scanlines).step_by(LINE_STEP as usize).map(|l| line(probe, frame, l));
    (lag(LAGS_MM.0)..lag(LAGS_MM.1))
        .step_by(LAG_STEP)
        .map(|lag| correlation(lines().map(|l| (l, l.get(lag..).unwrap_or_default()))))
        .fold(0.0, most)
}

/// Largest correlation of a frame's scanlines with others at a lateral distance.
fn likeness_across(probe: &Probe, frame: &Frame) -> f64 {
    let lag = |mm: f64| (mm / probe.line_spacing_mm(0.0)) as u32;
    (lag(LAGS_ACROSS_MM.0)..lag(LAGS_ACROSS_MM.1))
        .map(|lag| {
            correlation((0..probe.scanlines - lag).map(|l| (line(probe, frame, l), line(probe, frame, l + lag))))
        })
        .fold(0.0, most)
}

impl Family for Speckle {
    fn groups(&self) -> &'static [&'static str] {
        &["Speckle", "Attenuation"]
    }

    fn measure(&self, rig: &mut Rig) -> Result<Vec<Check>, RenderError> {
        let probe = linear(128, 0.3, 2048, 100.0);
        let settings = small(1, 1);
        let first = rig.frame(&probe, &settings, &at(self.plain.x, self.plain.y, 0.0))?.clone();
        let envelope = bands(&probe, &first, 1).concat();
        let power = mean_square(envelope.iter().copied());
        let mean = envelope.iter().sum::<f64>() / envelope.len() as f64;
        let snr = mean / (power - mean * mean).max(0.0).sqrt();
        let level = db_from_amplitude(power.sqrt());

        let nearer = rig.frame(&probe, &settings, &at(self.plain.x, self.plain.y, NEARER_MM))?;
        let [re, im, ..] = sums([(&first.lines[..], &nearer.lines[..])].into_iter());
        // The phase is −turns·z, so it increases as the tissue comes nearer.
        let moved_um = 1e3 * im.atan2(re) / (std::f64::consts::TAU * probe.phase_turns_per_mm());

        // Without the effect, the lattice of single cells replaces the sheets of scatterers.
        let mut lattice = settings;
        lattice.effects = lattice.effects.with(Effect::ElevationalSpeckle, Choice::Off);
        let single = rig.frame(&probe, &lattice, &at(self.plain.x, self.plain.y, 0.0))?.clone();

        let sample = |mm: f64| (mm / probe.sample_spacing_mm()) as usize;
        let between = sample(SLIDE_DEPTHS_MM[0])..sample(SLIDE_DEPTHS_MM[1]);
        let theory = probe
            .elevational_lens()
            .slide_correlation(|part| probe.apodization.weight(part), &[70.0], &SLIDES_MM)
            .concat();
        let mut slid = Vec::new();
        for (mm, rho) in SLIDES_MM.into_iter().zip(theory) {
            let frame = rig.frame(&probe, &settings, &at(self.plain.x, self.plain.y + mm, 0.0))?;
            let part = |frame, l| line(&probe, frame, l).get(between.clone()).unwrap_or_default();
            let alike = correlation((8..probe.scanlines - 8).map(|l| (part(&first, l), part(frame, l))));
            let name = format!("correlation after a slide of {mm} mm across the slice");
            slid.push(Check::new("Speckle", name, "", rho, alike, 0.07));
        }

        let lossy = rig.frame(&probe, &settings, &at(self.lossy.x, self.lossy.y, 0.0))?;
        // Whole samples to a band: the last samples may be left over.
        let band_cm = 0.1 * probe.sample_spacing_mm() * (probe.sample_count() as usize / BANDS) as f64;
        let centre_cm = |band: usize| band_cm * (band as f64 + 0.5);
        let points: Vec<_> = bands(&probe, lossy, BANDS)
            .into_iter()
            .enumerate()
            .map(|(band, values)| (centre_cm(band), db_from_amplitude(mean_square(values.into_iter()).sqrt())))
            .collect();
        let want = -20.0 * attenuation_db_mm(ALPHA, 1.0, probe.frequency_mhz);
        let mut checks = vec![
            Check::new("Attenuation", "of speckle, two-way slope", "dB/cm", want, slope(&points).0, 0.02 * want.abs()),
            Check::new("Speckle", "mean over deviation of the envelope", "", RAYLEIGH_SNR, snr, 0.05),
            Check::new("Speckle", "level", "dB", db_from_amplitude(DEVIATION), level, 0.5),
            // Thousands of independent speckles have a correlation of a few hundredths; a periodic lattice has almost
            // 1. The lattice is exact integer arithmetic, so devices differ only by rounding.
            Check::zero("Speckle", "likeness to itself 3 to 80 mm deeper", likeness_along(&probe, &first), 0.2),
            Check::zero("Speckle", "likeness to itself 4 to 25 mm beside", likeness_across(&probe, &first), 0.2),
            Check::zero("Speckle", "the same deeper, of single cells", likeness_along(&probe, &single), 0.2),
            Check::zero("Speckle", "the same beside, of single cells", likeness_across(&probe, &single), 0.2),
            Check::new("Speckle", "nearer by, from its phase", "µm", 1e3 * NEARER_MM, moved_um, 0.5),
        ];
        checks.extend(slid);
        Ok(checks)
    }
}
