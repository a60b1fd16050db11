//! Scatterers along the paths: complex baseband before the point-spread function.

use glam::DVec2;
use rayon::prelude::*;

use super::trace::{LN_SILENT, Segment, segment_at};
use super::{Inputs, Path, hash, lattice};

/// Baseband of the scatterers, a·e^(−i2π·turns·range) each [scanlines × samples].
///
/// A sample meets the scatterer of the lattice cell that lies on the scanline's guide at its range, as strong as a ray of the
/// scanline says. Rays and layers take turns, a layer as often as its weight says, so that their power adds up: where speckle is
/// fully developed, that of many sheets of scatterers and that of one are the same noise. All rays of a scanline sound the same
/// tissue: no number of them would make speckle converge that each read elsewhere.
pub fn march(inputs: &Inputs, paths: &[Path]) -> Vec<DVec2> {
    let sample = |index: usize| sample_of(inputs, paths, index / inputs.samples, index % inputs.samples);
    (0..inputs.scanlines * inputs.samples).into_par_iter().map(sample).collect()
}

fn sample_of(inputs: &Inputs, paths: &[Path], line: usize, sample: usize) -> DVec2 {
    let count = inputs.paths_per_sample;
    let gain = inputs.scatterer_gain[sample / inputs.depth_block] / (count as f64).sqrt();
    // Two samples share a segment: that of the first.
    let segment_of = |path: usize| &paths[path].segments[segment_at(&paths[path], inputs.range_mm(sample & !1))];
    // The only path of a scanline is its own guide.
    let place = segment_of(if inputs.guides > 0 { inputs.sounding() + line } else { line });
    let echo = |k: usize| scatter(inputs, segment_of(turn(inputs, line, sample, k)), place, inputs.range_mm(sample));
    gain * (0..count).map(echo).sum::<DVec2>()
}

/// The path whose turn it is to carry the `k`-th echo of `sample`: an order of low discrepancy over depth and scanlines, two samples
/// each. The generators are 2³² times the powers 1 and 2 of the inverse plastic number (Roberts, "The unreasonable effectiveness of
/// quasirandom sequences", 2018).
fn turn(inputs: &Inputs, line: usize, sample: usize, k: usize) -> usize {
    let rotation = hash::pcg3d([inputs.seed, 0, 0])[0];
    let number = ((sample / 2) * inputs.paths_per_sample + k) as u32;
    let place = number.wrapping_mul(3_242_174_889).wrapping_add((line as u32).wrapping_mul(2_447_445_414));
    let mut turn = (place.wrapping_add(rotation) >> 16) as usize;
    let share = |layer: usize| (inputs.layers[layer].weight * 65536.0) as usize;
    let mut layer = 0;
    while turn >= share(layer) && layer + 1 < inputs.layers.len() {
        turn -= share(layer);
        layer += 1;
    }
    // The last one's share is what rounding left.
    let ray = (turn * inputs.rays_per_line / share(layer).max(1)).min(inputs.rays_per_line - 1);
    (layer * inputs.scanlines + line) * inputs.rays_per_line + ray
}

/// Echo at `range_mm` of the scatterer that the segment `place` meets, as strong as `segment` says.
fn scatter(inputs: &Inputs, segment: &Segment, place: &Segment, range_mm: f64) -> DVec2 {
    let here = place.scatterer_mm(range_mm);
    let cell = lattice::cell(here);
    let [presence, offset, amplitude] = lattice::hash(cell);
    let ln_amplitude = segment.ln_amplitude(range_mm);
    if presence >> 15 >= segment.scatterer_density || ln_amplitude <= LN_SILENT {
        return DVec2::ZERO;
    }
    // The scatterer's own range sets the phase, whichever sample meets its cell.
    let ahead_mm = (lattice::scatterer_mm(cell, offset) - here).dot(place.step) / place.step.length_squared();
    let strength =
        DVec2::new(segment.scatterer_mean, 0.0) + segment.scatterer_deviation * lattice::scatterer_deviate(amplitude);
    // Complex numbers multiply as vectors rotate.
    ln_amplitude.exp() * strength.rotate(inputs.carrier(range_mm + ahead_mm))
}

impl Inputs {
    /// Baseband phase of an echo at `range_mm`: e^(−i2k₀z) for 2k₀ = 2π·2f/c₀.
    pub fn carrier(&self, range_mm: f64) -> DVec2 {
        DVec2::from_angle(-std::f64::consts::TAU * (self.phase_turns_per_mm * range_mm).fract())
    }
}
