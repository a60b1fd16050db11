//! Geometry of a probe: its scanlines, its beam and its sampling.

use glam::DVec3;

use crate::acoustics::beam::{Beam, Reception};
use crate::acoustics::{self, pulse, slide};
use crate::settings::{Probe, ProbeKind, SAMPLES_MAX, Samples};

/// Largest distance between automatic samples, in standard deviations of the pulse's envelope. The spectrum of the
/// envelope has fallen by 24 dB at half the sampling rate. With fewer samples, echoes between them would be displayed
/// longer (`docs/notes/samples.md`).
const SIGMAS_PER_SAMPLE: f64 = 4.0 / 3.0;
/// Ratio of the number of coarse samples to the automatic number: coarse samples are up to 2 standard deviations apart.
const COARSE_SHARE: f64 = 2.0 / 3.0;
/// Range of the distance between samples, in standard deviations of the pulse's envelope, over which the envelope is
/// also detected midway between them. Below the range, grey levels are fine enough at the samples alone. Above it,
/// pulses of neighbouring samples hardly overlap midway.
const SIGMAS_WITH_MIDWAY: [f64; 2] = [1.0, 2.0];
/// Samples of a block, which share one lateral kernel and one gain. An automatic number has an odd number of blocks:
/// scanlines a multiple of 4 KiB apart in memory would compete for the same part of the first-level cache.
pub const BLOCK_SAMPLES: u32 = 16;
/// Largest automatic number of blocks.
const BLOCKS_MAX: u32 = SAMPLES_MAX / BLOCK_SAMPLES - 1;

/// Number of samples in the next odd number of whole blocks.
fn whole_blocks(samples: u32) -> u32 {
    BLOCK_SAMPLES * (samples.div_ceil(BLOCK_SAMPLES).min(BLOCKS_MAX) | 1)
}

impl Probe {
    /// Number of samples per scanline: `samples`, or as many as the pulse needs over the depth of the image. An
    /// automatic number is an odd multiple of 16, up to 8176.
    pub fn sample_count(&self) -> u32 {
        match self.samples {
            Samples::Number(samples) => samples,
            Samples::Auto => whole_blocks(self.samples_needed()),
        }
    }

    /// This probe with a fixed number of samples. An automatic number becomes about two thirds of itself if `coarse`:
    /// samples are then at most 2 standard deviations of the pulse's envelope apart, unless the number is capped.
    pub fn sampled(&self, coarse: bool) -> Self {
        let samples = match self.samples {
            Samples::Auto if coarse => whole_blocks((COARSE_SHARE * f64::from(self.samples_needed())).ceil() as u32),
            _ => self.sample_count(),
        };
        Self { samples: samples.into(), ..*self }
    }

    /// Whether coarse samples are fewer than the probe's own: not with a named number, and not of short scanlines.
    pub fn has_coarse_samples(&self) -> bool {
        self.sampled(true).sample_count() < self.sample_count()
    }

    /// Number of samples per scanline that the pulse's bandwidth needs.
    pub fn samples_needed(&self) -> u32 {
        let needed = self.depth_mm / (SIGMAS_PER_SAMPLE * self.axial_sigma_mm());
        // The conversion saturates: values outside their ranges are reported by `validate`.
        needed.ceil().max(1.0) as u32
    }

    /// Depth between neighbouring samples, mm, at 1540 m/s. Sample j is centred at depth (j + ½)·spacing.
    pub fn sample_spacing_mm(&self) -> f64 {
        self.depth_mm / f64::from(self.sample_count())
    }

    /// Number of grey levels for each sample: 1, or 2 if the envelope is also detected midway to the next sample.
    ///
    /// Grey levels are linear between the places where they are detected. Where these are more than a standard deviation
    /// of the pulse apart, lengths of displayed points are off by more than a tenth (`docs/notes/samples.md`).
    pub fn levels_per_sample(&self) -> u32 {
        let apart = self.sample_spacing_mm() / self.axial_sigma_mm();
        let [from, to] = SIGMAS_WITH_MIDWAY;
        if apart > from && apart <= to { 2 } else { 1 }
    }

    /// Radius of the face, mm: 0 for a phased array, `None` for a flat (linear) one.
    pub fn face_radius_mm(&self) -> Option<f64> {
        match self.kind {
            ProbeKind::Convex { radius_mm, .. } => Some(radius_mm),
            ProbeKind::Phased { .. } => Some(0.0),
            ProbeKind::Linear { .. } => None,
        }
    }

    /// Half the lateral extent of the sector: radians, or mm for a linear face.
    pub fn half_extent(&self) -> f64 {
        match self.kind {
            ProbeKind::Convex { fov_deg, .. } | ProbeKind::Phased { fov_deg } => 0.5 * fov_deg.to_radians(),
            ProbeKind::Linear { width_mm } => 0.5 * width_mm,
        }
    }

    /// Lateral coordinate (radians, or mm for a linear face) at `fraction` (0..=1) of the sector's extent.
    ///
    /// Scanline i of n is at fraction (i + ½)/n.
    pub fn lateral_coordinate(&self, fraction: f64) -> f64 {
        (2.0 * fraction - 1.0) * self.half_extent()
    }

    /// Origin on the face (mm) and unit direction of the ray at a lateral coordinate, in the probe frame.
    pub fn ray(&self, lateral: f64) -> (DVec3, DVec3) {
        match self.face_radius_mm() {
            Some(radius) => {
                let (sin, cos) = lateral.sin_cos();
                // The depth of the origin is radius·(cos − 1), computed without cancellation at small angles.
                let sag = -2.0 * radius * (0.5 * lateral).sin().powi(2);
                (DVec3::new(radius * sin, 0.0, sag), DVec3::new(sin, 0.0, cos))
            }
            None => (DVec3::new(lateral, 0.0, 0.0), DVec3::Z),
        }
    }

    /// Lateral distance between neighbouring scanlines at `depth_mm`, mm.
    pub fn line_spacing_mm(&self, depth_mm: f64) -> f64 {
        let step = 2.0 * self.half_extent() / f64::from(self.scanlines);
        self.face_radius_mm().map_or(step, |radius| step * (radius + depth_mm))
    }

    /// Standard deviation of the axial pulse-echo amplitude envelope, mm.
    pub fn axial_sigma_mm(&self) -> f64 {
        let fundamental_mm = pulse::axial_sigma_mm(self.frequency_mhz, self.fractional_bandwidth);
        // The square of a Gaussian pulse is shorter by √2. Half of the echo's variance is due to reception.
        if self.harmonics { 0.75_f64.sqrt() * fundamental_mm } else { fundamental_mm }
    }

    /// The beam in the scan plane: a fixed transmit focus and a dynamic receive focus.
    pub fn lateral_beam(&self) -> Beam {
        Beam {
            frequency_mhz: self.frequency_mhz,
            fractional_bandwidth: self.fractional_bandwidth,
            apodization: self.apodization,
            aperture_mm: self.aperture_mm,
            focus_mm: self.focus_mm,
            reception: Reception::Dynamic,
            harmonic: self.harmonics,
        }
    }

    /// The beam across the slice: a lens with one focus for transmission and reception.
    pub fn elevational_beam(&self) -> Beam {
        Beam {
            aperture_mm: self.elevational_height_mm,
            focus_mm: self.elevational_focus_mm,
            reception: Reception::Fixed,
            ..self.lateral_beam()
        }
    }

    /// Standard deviation, mm, of the Gaussian that has the −6 dB width of the two-way lateral beam at `depth_mm`.
    ///
    /// Sums over the aperture take about 0.1 ms.
    pub fn lateral_sigma_mm(&self, depth_mm: f64) -> f64 {
        self.lateral_beam().width_mm(depth_mm) / pulse::FWHM_PER_SIGMA
    }

    /// Standard deviation, mm, of the Gaussian that has the −6 dB width of the two-way elevational beam at `depth_mm`.
    ///
    /// Sums over the lens take about 0.1 ms.
    pub fn elevational_sigma_mm(&self, depth_mm: f64) -> f64 {
        self.elevational_beam().width_mm(depth_mm) / pulse::FWHM_PER_SIGMA
    }

    /// The elevational lens, across the slice.
    pub fn elevational_lens(&self) -> slide::Lens {
        slide::Lens {
            frequency_mhz: self.frequency_mhz,
            height_mm: self.elevational_height_mm,
            focus_mm: self.elevational_focus_mm,
        }
    }

    /// Centre frequency of reception, MHz: twice the transmitted one for harmonics.
    pub fn returning_mhz(&self) -> f64 {
        if self.harmonics { 2.0 * self.frequency_mhz } else { self.frequency_mhz }
    }

    /// Two-way loss, dB per mm, in a tissue whose one-way attenuation at 1 MHz is `db_cm_mhz`; `exponent` is the power
    /// of the frequency.
    ///
    /// A harmonic is generated on the way by the square of the transmitted pressure, which loses twice as much as the
    /// pressure (quasi-linear plane waves: Hamilton and Blackstock, Nonlinear Acoustics, 1998, chapter 4).
    pub fn two_way_loss_db_mm(&self, db_cm_mhz: f64, exponent: f64) -> f64 {
        let at = |frequency_mhz| acoustics::attenuation::attenuation_db_mm(db_cm_mhz, exponent, frequency_mhz);
        let out = if self.harmonics { 2.0 * at(self.frequency_mhz) } else { at(self.frequency_mhz) };
        out + at(self.returning_mhz())
    }

    /// Turns of baseband phase per mm of depth: 2f/c₀ at the receive frequency. An echo at depth z has the phase
    /// factor e^(−i2π·turns·z).
    pub fn phase_turns_per_mm(&self) -> f64 {
        2.0 / acoustics::wavelength_mm(self.returning_mhz())
    }
}

#[cfg(test)]
mod tests {
    use super::*;
    use crate::settings::SettingsGroup as _;

    #[test]
    fn coarse_samples_are_two_sigmas_apart_at_most_and_named_numbers_stay() {
        for frequency_mhz in [1.5, 3.5, 8.0, 15.0] {
            let probe = Probe { frequency_mhz, samples: Samples::Auto, ..Probe::default() };
            let (all, coarse) = (probe.sampled(false), probe.sampled(true));
            assert_eq!(all.sample_count(), probe.sample_count());
            let share = f64::from(coarse.sample_count()) / f64::from(all.sample_count());
            assert!((0.6..0.75).contains(&share), "{frequency_mhz} MHz: {share}");
            assert_eq!((coarse.levels_per_sample(), coarse.sample_count() / BLOCK_SAMPLES % 2), (2, 1));
            let named = Probe { samples: 3072.into(), ..probe };
            assert_eq!(named.sampled(true), named);
            assert!(probe.has_coarse_samples() && !named.has_coarse_samples());
        }
    }

    #[test]
    fn automatic_samples_are_a_pulse_apart_at_every_frequency_and_depth() {
        assert_eq!(Probe::default().sample_count(), 1872);
        for frequency_mhz in [1.0, 2.5, 8.0, 18.0] {
            for depth_mm in [20.0, 60.0, 150.0, 240.0] {
                for harmonics in [false, true] {
                    let probe = Probe { frequency_mhz, depth_mm, harmonics, ..Probe::default() };
                    let samples = probe.sample_count();
                    assert!(samples / BLOCK_SAMPLES % 2 == 1 && samples.is_multiple_of(BLOCK_SAMPLES), "{samples}");
                    let (spacing_mm, sigma_mm) = (probe.sample_spacing_mm(), probe.axial_sigma_mm());
                    let capped = samples == BLOCK_SAMPLES * BLOCKS_MAX;
                    assert!(spacing_mm <= SIGMAS_PER_SAMPLE * sigma_mm || capped, "{probe:?}: {spacing_mm} mm");
                    assert!(capped || probe.levels_per_sample() == 2 || samples < 20 * BLOCK_SAMPLES, "{probe:?}");
                    // No more than two blocks are spare.
                    assert!(samples <= probe.samples_needed() + 2 * BLOCK_SAMPLES, "{probe:?}: {samples}");
                }
            }
        }
        let most = Probe { frequency_mhz: 40.0, depth_mm: 500.0, ..Probe::default() };
        assert!(most.validate().is_ok() && most.sample_count() == 8176 && most.samples_needed() > 8176);
        assert_eq!(Probe { samples: Samples::Number(333), ..most }.sample_count(), 333);
    }

    #[test]
    fn grey_levels_lie_midway_where_samples_are_one_to_two_deviations_of_the_pulse_apart() {
        let levels = |sigmas: f64| {
            let probe = Probe::default();
            let samples = (probe.depth_mm / (sigmas * probe.axial_sigma_mm())).round() as u32;
            Probe { samples: samples.into(), ..probe }.levels_per_sample()
        };
        assert_eq!([0.2, 0.82, 0.99, 1.01, 1.5, 1.99, 2.01, 5.0].map(levels), [1, 1, 1, 2, 2, 2, 1, 1]);
    }
}
