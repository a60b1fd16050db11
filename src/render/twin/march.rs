//! Scatterers along the paths: complex baseband before the point-spread function.

use glam::DVec2;
use rayon::prelude::*;

use super::inputs::Inputs;
use super::lattice;
use super::trace::{Path, segment_at};
use crate::render::constants::LN_SPECKLE_SILENT;

/// Baseband of the scatterers, a·e^(−i2π·turns·range) each [scanlines × samples].
///
/// A sample takes the scatterer of the lattice cell at its range on the scanline's guide, for all rays of the scanline:
/// with a scatterer per ray, speckle would not converge. The mean power of all rays sets the scatterer's strength.
/// Fully developed speckle has the same statistics with one sheet of scatterers as with many.
pub fn march(inputs: &Inputs, paths: &[Path]) -> Vec<DVec2> {
    let sample = |index: usize| sample_of(inputs, paths, index / inputs.samples, index % inputs.samples);
    (0..inputs.scanlines * inputs.samples).into_par_iter().map(sample).collect()
}

fn sample_of(inputs: &Inputs, paths: &[Path], line: usize, sample: usize) -> DVec2 {
    let range_mm = inputs.range_mm(sample);
    // Two samples share a segment: that of the first.
    let segment_of = |path: usize| &paths[path].segments[segment_at(&paths[path], inputs.range_mm(sample & !1))];
    // The only path of a scanline is its own guide.
    let alone = inputs.guides == 0;
    let place = segment_of(if alone { line } else { inputs.sounding() + line });
    let here = place.scatterer_mm(range_mm);
    let cell = lattice::cell(here);
    let [presence, offset, amplitude] = lattice::hash(cell);
    let mean_and_deviation = |path: usize| {
        let segment = segment_of(path);
        let ln_amplitude = segment.ln_amplitude(range_mm);
        let there = presence >> 15 < segment.scatterer_density && ln_amplitude > LN_SPECKLE_SILENT;
        let statistics = DVec2::new(segment.scatterer_mean, segment.scatterer_deviation);
        if there { ln_amplitude.exp() * statistics } else { DVec2::ZERO }
    };
    let DVec2 { x: mean, y: deviation } = {
        let rays = inputs.rays_per_line;
        let of_layer = |layer: usize| {
            let first = (layer * inputs.scanlines + line) * rays;
            (first..first + rays).map(|path| mean_and_deviation(path).powf(2.0)).sum::<DVec2>()
        };
        ((0..inputs.layers).map(of_layer).sum::<DVec2>() * inputs.path_weight()).powf(0.5)
    };
    let strength = DVec2::new(mean, 0.0) + deviation * lattice::scatterer_deviate(amplitude);
    // The scatterer's own range sets the phase, whichever sample finds its cell.
    let ahead_mm = (lattice::scatterer_mm(cell, offset) - here).dot(place.step) / place.step.length_squared();
    // `rotate` is the complex product.
    inputs.scatterer_gain[sample / inputs.depth_block] * strength.rotate(inputs.carrier(range_mm + ahead_mm))
}

impl Inputs {
    /// Baseband phase of an echo at `range_mm`: e^(−i2k₀z) for 2k₀ = 2π·2f/c₀.
    pub fn carrier(&self, range_mm: f64) -> DVec2 {
        DVec2::from_angle(-std::f64::consts::TAU * (self.phase_turns_per_mm * range_mm).fract())
    }
}
