//! Profiles of the lateral beam, computed at some depths and interpolated between them.

use rayon::prelude::*;

use insonify_core::acoustics::beam::{Beam, OFFSETS, Profile};
use insonify_core::settings::Apodization;
use insonify_core::transducer::Probe;

/// Number of intervals between the depths with a profile: for a smooth apodization, and for a rectangular one, whose
/// width ripples with depth.
const INTERVALS: [u32; 2] = [96, 144];
/// Amplitude below which side lobes are cut: −30 dB. A lower limit would widen the kernels at small depths without a
/// visible effect.
const CUT: f64 = 0.031_622_776_601_683_79;

/// Profiles of a probe's lateral beam at equally spaced depths.
#[derive(Debug, Clone)]
pub(crate) struct LateralBeam {
    beam: Beam,
    spacing_mm: f64,
    profiles: Vec<Profile>,
}

/// The beam at one depth: the two nearest profiles, and the depth's position between them, 0..=1. The spacing of their
/// points grows with depth.
pub(crate) struct AtDepth<'a> {
    profiles: [&'a Profile; 2],
    part: f64,
    step_mm: f64,
}

impl LateralBeam {
    pub(crate) fn new(probe: &Probe) -> Self {
        let beam = probe.lateral_beam();
        let intervals = INTERVALS[usize::from(probe.apodization == Apodization::Rectangular)];
        let spacing_mm = probe.depth_mm / f64::from(intervals);
        let profiles = (0..=intervals).into_par_iter().map(|i| beam.profile(f64::from(i) * spacing_mm)).collect();
        Self { beam, spacing_mm, profiles }
    }

    /// The beam at `depth_mm`, clamped to the image.
    pub(crate) fn at(&self, depth_mm: f64) -> AtDepth<'_> {
        let last = self.profiles.len() - 1;
        let place = (depth_mm / self.spacing_mm).clamp(0.0, last as f64);
        let below = (place as usize).min(last - 1);
        AtDepth {
            profiles: [&self.profiles[below], &self.profiles[below + 1]],
            part: place - below as f64,
            step_mm: self.beam.reach_mm(depth_mm) / OFFSETS as f64,
        }
    }
}

impl AtDepth<'_> {
    fn between(&self, [a, b]: [f64; 2]) -> f64 {
        a + self.part * (b - a)
    }

    /// Two-way amplitude at a lateral offset from the axis, relative to the axis.
    pub(crate) fn amplitude(&self, offset_mm: f64) -> f64 {
        let place = (offset_mm.abs() / self.step_mm).min((OFFSETS - 1) as f64);
        let below = (place as usize).min(OFFSETS - 2);
        let part = place - below as f64;
        self.between(self.profiles.map(|p| p.levels[below] + part * (p.levels[below + 1] - p.levels[below])))
    }

    /// Half of the −6 dB width, mm.
    pub(crate) fn half_width_mm(&self) -> f64 {
        self.step_mm * self.between(self.profiles.map(|p| p.steps_above(0.5)))
    }

    /// Offset beyond which side lobes are below −30 dB, mm.
    pub(crate) fn reach_mm(&self) -> f64 {
        self.step_mm * self.between(self.profiles.map(|p| p.steps_above(CUT)))
    }
}

#[cfg(test)]
mod tests {
    use super::*;

    #[test]
    fn interpolated_profiles_are_those_of_their_depths() {
        for apodization in Apodization::ALL {
            for (frequency_mhz, focus_mm) in [(3.5, 70.0), (8.0, 70.0), (5.0, 40.0), (8.0, 40.0), (5.0, 100.0)] {
                let probe = Probe { apodization, frequency_mhz, focus_mm, ..Probe::default() };
                let table = LateralBeam::new(&probe);
                for depth in (0..=80).map(|i| 20.0 + 1.5 * f64::from(i)) {
                    let (got, want) = (2.0 * table.at(depth).half_width_mm(), probe.lateral_beam().width_mm(depth));
                    assert!((got / want - 1.0).abs() < 0.06, "{probe:?} at {depth} mm: {got}, not {want}");
                    assert!((table.at(depth).amplitude(0.5 * want) - 0.5).abs() < 0.05);
                }
            }
        }
    }
}
