//! The beam along the face, at positions of the needle: amplitude across scanlines, and what a tilted mirror returns.

use insonify_core::acoustics::beam::RECEIVE_F_NUMBER_MIN;
use insonify_core::transducer::Probe;

use super::slice::{Overlap, reflection_shift_mm};
use crate::lateral_beam::LateralBeam;

/// Number of intervals between the depths at which integrals of the beam are tabulated.
const INTERVALS: u32 = 64;
/// Number of positions of an integral, on one side of the axis.
const POSITIONS: u32 = 128;

/// The beam of a scanline at equally spaced depths.
#[derive(Debug, Clone)]
pub(super) struct ScanlineBeam {
    beam: LateralBeam,
    depth_step_mm: f64,
    depths: Vec<AtDepth>,
}

/// Integrals of the beam at one depth.
#[derive(Debug, Clone)]
struct AtDepth {
    /// Integral of the two-way amplitude over all offsets, mm.
    area_mm: f64,
    /// Inverse of the L2 norm of the two-way amplitude, mm^-½.
    inverse_norm: f64,
    /// Standard deviation of the Gaussian that has the −6 dB width, mm.
    sigma_mm: f64,
    /// Offset beyond which the beam is cut, mm.
    reach_mm: f64,
    /// Overlap of the transmit aperture with the mirror image of the receive aperture.
    overlap: Overlap,
}

impl ScanlineBeam {
    pub(super) fn new(probe: &Probe) -> Self {
        let beam = LateralBeam::new(probe);
        let depth_step_mm = probe.depth_mm / f64::from(INTERVALS);
        let receive_mm = |depth_mm: f64| probe.aperture_mm.min((depth_mm / RECEIVE_F_NUMBER_MIN).max(0.1));
        let at = |i: u32| {
            let depth_mm = f64::from(i) * depth_step_mm;
            let profile = beam.at(depth_mm);
            let reach_mm = profile.reach_mm();
            let step_mm = reach_mm / f64::from(POSITIONS);
            let levels = (0..POSITIONS).map(|i| profile.amplitude((f64::from(i) + 0.5) * step_mm));
            let (area, power) = levels.fold((0.0, 0.0), |(area, power), level| (area + level, power + level * level));
            AtDepth {
                area_mm: (2.0 * area * step_mm).max(1e-6),
                inverse_norm: 1.0 / (2.0 * power * step_mm).max(1e-6).sqrt(),
                sigma_mm: (profile.half_width_mm() / (2.0 * std::f64::consts::LN_2).sqrt()).max(1e-3),
                reach_mm,
                overlap: Overlap::new(probe, [probe.aperture_mm, receive_mm(depth_mm)]),
            }
        };
        Self { depths: (0..=INTERVALS).map(at).collect(), depth_step_mm, beam }
    }

    /// Interpolates a value between the tabulated depths.
    fn between(&self, depth_mm: f64, value: impl Fn(&AtDepth) -> f64) -> f64 {
        let place = (depth_mm / self.depth_step_mm).clamp(0.0, f64::from(INTERVALS));
        let low = (place as usize).min(INTERVALS as usize - 1);
        let [a, b] = [value(&self.depths[low]), value(&self.depths[low + 1])];
        a + (b - a) * (place - low as f64)
    }

    /// Two-way amplitude at a depth, by the offset from the scanline, 1/mm. Its integral over all offsets is 1.
    pub(super) fn amplitudes(&self, depth_mm: f64) -> impl Fn(f64) -> f64 {
        let (profile, area_mm) = (self.beam.at(depth_mm), self.between(depth_mm, |at| at.area_mm));
        move |offset_mm| profile.amplitude(offset_mm) / area_mm
    }

    /// Two-way amplitude at a depth and an offset from the scanline, divided by its L2 norm, mm^-½.
    pub(super) fn normalised_amplitude(&self, depth_mm: f64, offset_mm: f64) -> f64 {
        self.beam.at(depth_mm).amplitude(offset_mm) * self.between(depth_mm, |at| at.inverse_norm)
    }

    /// Standard deviation of the amplitude, mm.
    pub(super) fn sigma_mm(&self, depth_mm: f64) -> f64 {
        self.between(depth_mm, |at| at.sigma_mm)
    }

    /// Offset beyond which the beam is cut, mm.
    pub(super) fn reach_mm(&self, depth_mm: f64) -> f64 {
        self.between(depth_mm, |at| at.reach_mm)
    }

    /// Amplitude of a long mirror that is tilted along the face by an angle with this tangent, relative to none.
    pub(super) fn tilt(&self, depth_mm: f64, tangent: f64) -> f64 {
        let shift_mm = reflection_shift_mm(depth_mm, tangent);
        self.between(depth_mm, |at| at.overlap.at(shift_mm))
    }
}
