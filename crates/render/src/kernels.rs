//! The point-spread function as kernels: the lateral beam at each depth, the pulse, and a scatterer gain that
//! compensates for both.

use std::fmt;

use insonify_core::settings::RenderSettings;
use insonify_core::transducer::{Probe, ProbeKind};
use rayon::prelude::*;

use super::constants::{AXIAL_HALF_MAX, CELL_MM, DEPTH_BLOCK, LATERAL_HALF_MAX, PROJECTION_MIN, PULSE_PAD};
use super::fractional_delay::{TAPS, delay_weights};
use super::lateral_beam::LateralBeam;
use super::sheets::Sheets;

/// Half width of the beam's main lobe at −26 dB over its half width at −6 dB.
const MAIN_LOBE: f64 = 2.1;
/// Half width of the pulse's kernel, in standard deviations of the pulse.
const AXIAL_REACH: f64 = 4.0;

/// The two kernels of the point-spread function.
#[derive(Debug, Clone, Copy, PartialEq, Eq)]
pub(crate) enum Kernel {
    /// The beam across scanlines, applied by the pass `lateral`: at most 32 scanlines to either side.
    Lateral,
    /// The pulse along a scanline, applied by the pass `detect`: at most 128 samples to either side.
    Axial,
}

/// A kernel that was cut to the largest width of its pass. Speckle is then narrower than the beam or pulse makes it;
/// its level stays right.
#[derive(Debug, Clone, Copy, PartialEq)]
pub(crate) struct ClippedKernel {
    /// Kernel that was cut.
    pub(crate) kernel: Kernel,
    /// Half width that the kernel needs at its widest, scanlines or samples.
    pub(crate) wanted: u32,
    /// Half width after the cut, scanlines or samples.
    pub(crate) kept: u32,
    /// Smallest and largest depth at which it is cut, mm.
    pub(crate) depths_mm: [f64; 2],
    /// Value of the setting that widens it: `probe.scanlines` if lateral, `probe.sample_count()` if axial.
    pub(crate) value: u32,
}

impl fmt::Display for ClippedKernel {
    fn fmt(&self, f: &mut fmt::Formatter<'_>) -> fmt::Result {
        let Self { wanted, kept, depths_mm: [from, to], value, .. } = self;
        match self.kernel {
            Kernel::Lateral => write!(
                f,
                "between {from:.1} and {to:.1} mm the beam is up to ±{wanted} scanlines wide and is cut at ±{kept}: lower probe.scanlines (now {value}) for the whole beam"
            ),
            Kernel::Axial => write!(
                f,
                "the pulse is ±{wanted} samples long and is cut at ±{kept}: lower probe.samples (now {value}), or raise probe.fractional_bandwidth or probe.frequency_mhz"
            ),
        }
    }
}

/// The kernels of a probe.
#[derive(Debug, Clone)]
pub(crate) struct Kernels {
    /// Lateral weights [blocks of DEPTH_BLOCK samples × (2·lateral_half + 1)]; each block's sum is 1.
    pub(crate) lateral: Vec<f32>,
    /// Sum of the squared lateral weights [blocks].
    pub(crate) power: Vec<f32>,
    /// Half width of the lateral weights that are not zero, scanlines [blocks].
    pub(crate) reach: Vec<u32>,
    pub(crate) lateral_half: u32,
    /// Envelope of the pulse [2·axial_half + 1], 1 at its peak, between PULSE_PAD zeros on either side.
    pub(crate) pulse: Vec<f32>,
    /// Weights of the same samples midway between the middle sample and the next one, laid out like `pulse`.
    pub(crate) midway: Vec<f32>,
    pub(crate) axial_half: u32,
    /// Weights of an echo between two samples [DELAY_STEPS + 1]: see [`delay_weights`]. Empty if grey levels are detected
    /// at the samples alone; an echo then lies at the nearest sample.
    pub(crate) delays: Vec<[f32; TAPS]>,
    /// Gain of the scatterers [blocks]: keeps speckle at the tissue's level after both kernels, at every depth.
    pub(crate) scatterer_gain: Vec<f32>,
    pub(crate) clipped: Vec<ClippedKernel>,
}

impl Kernels {
    /// Makes the kernels, no wider than `settings` allow. A kernel counts as clipped only if the limits of the passes
    /// cut it; a cut by the settings is intended. Lateral kernels have room for at least `reach` scanlines on either
    /// side.
    pub(crate) fn new(probe: &Probe, settings: &RenderSettings, sheets: Option<&Sheets>, reach: u32) -> Self {
        let half = |taps: u32| taps.saturating_sub(1) / 2;
        let (lateral_half, kernels, clipped_beam) = lateral_kernels(probe, half(settings.beam_taps_max), reach);
        let (axial_half, pulse, clipped_pulse) = pulse(probe, half(settings.pulse_taps_max));
        let sigma = probe.axial_sigma_mm() / probe.sample_spacing_mm();
        let midway = midway(axial_half, sigma);
        let correlation = match sheets {
            Some(sheets) => ScattererCorrelation::new(sheets.shared()),
            None => {
                ScattererCorrelation::new(|[across_mm, along_mm]: [f64; 2]| shared_cells(across_mm.hypot(along_mm)))
            }
        };
        let axial = autocorrelation(&pulse);
        let width = 2 * lateral_half as usize + 1;
        let gain = |(block, kernel): (usize, &[f64])| {
            let spacing_mm = probe.line_spacing_mm(depth_mm(probe, block as u32));
            let power = correlation.power(&autocorrelation(kernel), spacing_mm, &axial, probe.sample_spacing_mm());
            (1.0 / power.sqrt()) as f32
        };
        let scatterer_gain = kernels.par_chunks_exact(width).enumerate().map(gain).collect();
        Self {
            lateral: kernels.iter().map(|&w| w as f32).collect(),
            reach: kernels.chunks_exact(width).map(|kernel| reach_of(kernel, lateral_half)).collect(),
            power: kernels.chunks_exact(width).map(|k| k.iter().map(|w| w * w).sum::<f64>() as f32).collect(),
            lateral_half,
            pulse: padded(&pulse),
            midway: padded(&midway),
            axial_half,
            delays: if axial_half > 0 && probe.levels_per_sample() == 2 { delay_weights(sigma) } else { Vec::new() },
            scatterer_gain,
            clipped: clipped_beam.into_iter().chain(clipped_pulse).collect(),
        }
    }
}

/// Depth of the middle of a block of samples, mm.
fn depth_mm(probe: &Probe, block: u32) -> f64 {
    let sample = (f64::from(block) + 0.5) * f64::from(DEPTH_BLOCK);
    (sample * probe.sample_spacing_mm()).min(probe.depth_mm)
}

/// Half width (scanlines) and weights of the lateral kernel for each block of samples: the two-way profile by
/// diffraction, with its side lobes. Also reports a kernel whose main lobe was cut.
///
/// Weights are real: they give points their image and diffuse clutter its power. Off-axis phases matter only for smooth
/// plates. The kernel's sum of 1 keeps the level of a plate, except off the normal of a phased array.
fn lateral_kernels(probe: &Probe, cap: u32, reach: u32) -> (u32, Vec<f64>, Option<ClippedKernel>) {
    let blocks = probe.sample_count().div_ceil(DEPTH_BLOCK);
    let depth_mm = |block: u32| depth_mm(probe, block);
    let beam = LateralBeam::new(probe);
    let spacing_mm = |block: u32| probe.line_spacing_mm(depth_mm(block)).max(1e-9);
    // A kernel is at most as wide as the array.
    let array = probe.scanlines.max(2) - 1;
    let lines = |block: u32, reach_mm: f64| ((reach_mm / spacing_mm(block)).ceil() as u32).clamp(1, array);
    let wanted = |block: u32| lines(block, beam.at(depth_mm(block)).reach_mm());
    // Off the normal of a phased array, kernels are wider by one over the cosine.
    let projection = match probe.kind {
        ProbeKind::Phased { fov_deg } => (0.5 * fov_deg.to_radians()).cos().max(PROJECTION_MIN),
        ProbeKind::Convex { .. } | ProbeKind::Linear { .. } => 1.0,
    };
    let widest = |block: u32| {
        let reach = f64::from(wanted(block));
        if projection < 1.0 { (((reach + 1.0) / projection).ceil() as u32).min(array) } else { wanted(block) }
    };
    let half = (0..blocks).map(widest).max().unwrap_or(1).max(reach.min(array)).min(LATERAL_HALF_MAX).min(cap);
    // A cut main lobe is reported, cut side lobes are not.
    let main_lobe = |block: u32| lines(block, MAIN_LOBE * beam.at(depth_mm(block)).half_width_mm() / projection);
    let mut cut = (0..blocks).filter(|&block| main_lobe(block) > LATERAL_HALF_MAX && half == LATERAL_HALF_MAX);
    let clipped = cut.next().map(|first| ClippedKernel {
        kernel: Kernel::Lateral,
        wanted: (0..blocks).map(main_lobe).max().unwrap_or(1),
        kept: half,
        depths_mm: [depth_mm(first), depth_mm(cut.next_back().unwrap_or(first))],
        value: probe.scanlines,
    });
    let mut kernels = Vec::with_capacity((blocks * (2 * half + 1)) as usize);
    for block in 0..blocks {
        let (at, reach) = (beam.at(depth_mm(block)), wanted(block));
        let weight = |tap: u32| {
            let lines = tap.abs_diff(half);
            if lines <= reach { at.amplitude(f64::from(lines) * spacing_mm(block)) } else { 0.0 }
        };
        let kernel: Vec<f64> = (0..=2 * half).map(weight).collect();
        let sum: f64 = kernel.iter().sum();
        kernels.extend(kernel.iter().map(|w| w / sum));
    }
    (half, kernels, clipped)
}

/// Half width of a kernel's nonzero weights, taps. `half` is the half width of the whole kernel.
fn reach_of(kernel: &[f64], half: u32) -> u32 {
    let first = kernel.iter().position(|&weight| weight > 0.0).unwrap_or(0);
    half - (first as u32).min(half)
}

/// A Gaussian of 2·`half` + 1 taps with standard deviation `sigma` (taps), 1 at its peak.
fn gaussian(half: u32, sigma: f64) -> Vec<f64> {
    (0..=2 * half).map(|tap| (-0.5 * ((f64::from(tap) - f64::from(half)) / sigma).powi(2)).exp()).collect()
}

/// Half width (samples) and envelope of the pulse, 1 at its peak, and a report if the pulse was cut. `cap` is the
/// largest half width.
fn pulse(probe: &Probe, cap: u32) -> (u32, Vec<f64>, Option<ClippedKernel>) {
    let sigma = probe.axial_sigma_mm() / probe.sample_spacing_mm();
    let wanted = ((AXIAL_REACH * sigma).ceil() as u32).max(1);
    let half = wanted.min(AXIAL_HALF_MAX).min(cap);
    let clipped = (wanted > half && half == AXIAL_HALF_MAX).then_some(ClippedKernel {
        kernel: Kernel::Axial,
        wanted,
        kept: half,
        depths_mm: [0.0, probe.depth_mm],
        value: probe.sample_count(),
    });
    (half, gaussian(half, sigma), clipped)
}

/// The Gaussian of [`gaussian`] half a sample later. The first tap, which has no counterpart on the other side, is 0.
fn midway(half: u32, sigma: f64) -> Vec<f64> {
    let offset = |tap: u32| f64::from(tap) - f64::from(half) - 0.5;
    let weight = |tap: u32| if tap == 0 { 0.0 } else { (-0.5 * (offset(tap) / sigma).powi(2)).exp() };
    (0..=2 * half).map(weight).collect()
}

/// The pulse between PULSE_PAD zeros on either side.
fn padded(pulse: &[f64]) -> Vec<f32> {
    let zeros = || std::iter::repeat_n(0.0, PULSE_PAD as usize);
    zeros().chain(pulse.iter().map(|&w| w as f32)).chain(zeros()).collect()
}

/// Autocorrelation Σ wᵢ·wᵢ₊ₗ of the weights at each lag l from 0 on.
fn autocorrelation(weights: &[f64]) -> Vec<f64> {
    let at = |lag: usize| weights.iter().zip(&weights[lag..]).map(|(a, b)| a * b).sum();
    (0..weights.len()).map(at).collect()
}

/// Correlation of the scatterers at two points of a slice, against the distance of the points across and along
/// scanlines.
struct ScattererCorrelation {
    /// Correlation at multiples of `ACROSS_MM` (rows) and `ALONG_MM` (columns). Rows end before their first 0.
    rows: Vec<Vec<f64>>,
}

impl ScattererCorrelation {
    const ACROSS_MM: f64 = 0.04;
    const ALONG_MM: f64 = 0.01;
    const STEPS_MAX: usize = 256;

    fn new(shared: impl Fn([f64; 2]) -> f64 + Sync) -> Self {
        let row = |i: usize| -> Vec<f64> {
            let at = |j: usize| shared([i as f64 * Self::ACROSS_MM, j as f64 * Self::ALONG_MM]);
            (0..Self::STEPS_MAX).map(at).take_while(|&value| value > 0.0).collect()
        };
        let mut rows: Vec<Vec<f64>> = (0..Self::STEPS_MAX).into_par_iter().map(row).collect();
        rows.truncate(rows.iter().position(Vec::is_empty).unwrap_or(rows.len()));
        Self { rows }
    }

    /// Correlation at a distance across and along scanlines, by bilinear interpolation.
    fn at(&self, [across_mm, along_mm]: [f64; 2]) -> f64 {
        let (across, along) = (across_mm / Self::ACROSS_MM, along_mm / Self::ALONG_MM);
        let of = |i: usize, j: usize| self.rows.get(i).and_then(|row| row.get(j)).copied().unwrap_or(0.0);
        let in_row = |i: usize| {
            let (j, part) = (along as usize, along.fract());
            of(i, j) * (1.0 - part) + of(i, j + 1) * part
        };
        let (i, part) = (across as usize, across.fract());
        in_row(i) * (1.0 - part) + in_row(i + 1) * part
    }

    /// Power of unit scatterers after both kernels, from the kernels' autocorrelations. Samples that share a scatterer
    /// add in amplitude.
    fn power(&self, lateral: &[f64], spacing_mm: f64, axial: &[f64], sample_mm: f64) -> f64 {
        let across_max_mm = self.rows.len() as f64 * Self::ACROSS_MM;
        let along_max_mm = self.rows.iter().map(Vec::len).max().unwrap_or(0) as f64 * Self::ALONG_MM;
        let twice = |lag: usize| if lag == 0 { 1.0 } else { 2.0 };
        let mut power = 0.0;
        for (line, across) in lateral.iter().enumerate().take_while(|(i, _)| *i as f64 * spacing_mm < across_max_mm) {
            for (sample, along) in axial.iter().enumerate().take_while(|(i, _)| *i as f64 * sample_mm < along_max_mm) {
                let distance_mm = [line as f64 * spacing_mm, sample as f64 * sample_mm];
                power += twice(line) * twice(sample) * across * along * self.at(distance_mm);
            }
        }
        power
    }
}

/// Probability that two points at a distance lie in one cell of the scatterer lattice, averaged over all directions.
fn shared_cells(distance_mm: f64) -> f64 {
    const STEPS: i32 = 24;
    let mut sum = 0.0;
    for i in 0..STEPS {
        for j in 0..STEPS {
            // Directions spread evenly over one octant of the sphere.
            let z = (f64::from(i) + 0.5) / f64::from(STEPS);
            let angle = (f64::from(j) + 0.5) / f64::from(STEPS) * std::f64::consts::FRAC_PI_2;
            let radius = (1.0 - z * z).sqrt();
            sum += [radius * angle.cos(), radius * angle.sin(), z]
                .iter()
                .map(|n| (1.0 - distance_mm * n / CELL_MM).max(0.0))
                .product::<f64>();
        }
    }
    sum / f64::from(STEPS * STEPS)
}

#[cfg(test)]
mod tests {
    use super::*;

    fn new(probe: &Probe) -> Kernels {
        Kernels::new(probe, &RenderSettings::default(), None, 0)
    }

    #[test]
    fn kernels_are_normalised() {
        let (half, kernels, _) = lateral_kernels(&Probe::default(), LATERAL_HALF_MAX, 0);
        for kernel in kernels.chunks_exact(2 * half as usize + 1) {
            assert!((kernel.iter().sum::<f64>() - 1.0).abs() < 1e-12);
        }
        let (half, kernel, _) = pulse(&Probe::default(), AXIAL_HALF_MAX);
        assert_eq!(kernel[half as usize], 1.0);
    }

    #[test]
    fn a_kernel_that_is_cut_says_so_and_names_its_key() {
        assert_eq!(new(&Probe::default()).clipped, []);
        let many = new(&Probe { scanlines: 1024, aperture_mm: 1.5, ..Probe::default() });
        let [beam] = many.clipped[..] else { panic!("{:?}", many.clipped) };
        assert_eq!((beam.kernel, beam.kept, beam.value), (Kernel::Lateral, LATERAL_HALF_MAX, 1024));
        assert!(beam.wanted > LATERAL_HALF_MAX && beam.depths_mm[0] < beam.depths_mm[1], "{beam:?}");
        assert!(beam.to_string().contains("probe.scanlines (now 1024)"), "{beam}");

        let long = Probe { samples: 8192.into(), depth_mm: 30.0, frequency_mhz: 1.0, ..Probe::default() };
        let long = new(&long);
        assert_eq!(long.axial_half, AXIAL_HALF_MAX);
        let cut = long.clipped.iter().find(|c| c.kernel == Kernel::Axial).expect("a pulse that is cut");
        assert!(cut.wanted > cut.kept && cut.to_string().contains("probe.samples (now 8192)"), "{cut}");
    }

    #[test]
    fn the_pulse_midway_is_symmetric_and_nearly_as_strong_as_at_the_samples() {
        for spacing in [1.0, 1.25, 1.5] {
            let sigma = 1.0 / spacing;
            let half = (AXIAL_REACH * sigma).ceil() as u32;
            let (at, midway) = (gaussian(half, sigma), midway(half, sigma));
            assert_eq!((midway.len(), midway[0]), (at.len(), 0.0));
            for tap in 1..midway.len() {
                assert!((midway[tap] - midway[midway.len() - tap]).abs() < 1e-12, "{tap}");
            }
            // Poisson's sum over the squared Gaussian: its first harmonic is 2·exp(−(π·σ/Δ)²).
            let harmonic = 2.0 * (-(std::f64::consts::PI * sigma).powi(2)).exp();
            let power = |taps: &[f64]| taps.iter().map(|w| w * w).sum::<f64>();
            let expected = (1.0 - harmonic) / (1.0 + harmonic);
            assert!((power(&midway) / power(&at) - expected).abs() < 1e-3, "{spacing}");
            assert!(expected > 0.95, "{spacing}: {expected}");
        }
    }

    #[test]
    fn a_beam_wider_than_the_array_is_not_cut() {
        let narrow = new(&Probe { scanlines: 8, ..Probe::default() });
        assert!(narrow.lateral_half <= 7 && narrow.clipped.is_empty(), "{:?}", narrow.clipped);
    }

    #[test]
    fn caps_cut_kernels_without_a_word_and_keep_the_level() {
        let probe = Probe::default();
        let whole = new(&probe);
        for taps in [3, 4, 5] {
            let capped = RenderSettings { beam_taps_max: taps, pulse_taps_max: taps, ..RenderSettings::default() };
            let cut = Kernels::new(&probe, &capped, None, 0);
            let half = (taps - 1) / 2;
            assert_eq!((cut.lateral_half, cut.axial_half), (half, half));
            assert_eq!(cut.clipped, []);
            for (kernel, gain) in cut.lateral.chunks_exact(2 * half as usize + 1).zip(&cut.scatterer_gain) {
                assert!((kernel.iter().sum::<f32>() - 1.0).abs() < 1e-6 && *gain < whole.scatterer_gain[0] * 10.0);
            }
        }
        assert!(whole.lateral_half > 2 && whole.axial_half > 2);
    }
}
