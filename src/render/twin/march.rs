//! Scatterers along the paths: complex baseband before the point-spread function.

use glam::{DVec2, DVec3};
use rayon::prelude::*;

use super::inputs::{Inputs, Layer};
use super::speckle::{self, Place, Strength};
use super::trace::{Path, segment_at};
use crate::render::constants::LN_SPECKLE_SILENT;

/// Baseband of the scatterers, a·e^(−i2π·turns·range) each [scanlines × samples].
///
/// A sample takes the scatterers at its range on the scanline's guide, for all rays of the scanline: with scatterers
/// per ray, speckle would not converge. The mean power of all rays sets their strength, and the mean density of the
/// media, weighted by power, their presence. Fully developed speckle has the same statistics with few scatterers as with
/// many.
pub fn march(inputs: &Inputs, paths: &[Path]) -> Vec<DVec2> {
    let sample = |index: usize| sample_of(inputs, paths, index / inputs.samples, index % inputs.samples);
    (0..inputs.scanlines * inputs.samples).into_par_iter().map(sample).collect()
}

fn sample_of(inputs: &Inputs, paths: &[Path], line: usize, sample: usize) -> DVec2 {
    let range_mm = inputs.range_mm(sample);
    // Two samples share a segment: that of the first.
    let segment_of = |path: usize| &paths[path].segments[segment_at(&paths[path], inputs.range_mm(sample & !1))];
    // Squared mean, squared deviation, and their sum times the density.
    let power_of = |path: usize| {
        let segment = segment_of(path);
        let ln_amplitude = segment.ln_amplitude(range_mm);
        let there = segment.scatterer_density > 0 && ln_amplitude > LN_SPECKLE_SILENT;
        let statistics = DVec2::new(segment.scatterer_mean, segment.scatterer_deviation);
        let power = if there { (ln_amplitude.exp() * statistics).powf(2.0) } else { DVec2::ZERO };
        power.extend(f64::from(segment.scatterer_density) * power.element_sum())
    };
    let rays = inputs.rays_per_line;
    let of_layer = |(number, layer): (usize, &Layer)| {
        let first = (number * inputs.scanlines + line) * rays;
        let power: DVec3 = (first..first + rays).map(power_of).sum();
        power * layer.weight / rays as f64
    };
    let power: DVec3 = inputs.layers.iter().enumerate().map(of_layer).sum();
    if power.x + power.y == 0.0 {
        return DVec2::ZERO;
    }
    let strength = Strength { mean: power.x.sqrt(), deviation: power.y.sqrt(), density: power.z / (power.x + power.y) };
    // The only path of a scanline is its own guide.
    let guide = segment_of(if inputs.guides == 0 { line } else { inputs.sounding() + line });
    let place = Place { here_mm: guide.scatterer_mm(range_mm), step: guide.step, range_mm };
    let block = sample / inputs.depth_block;
    let echo = if inputs.sheets.is_empty() {
        speckle::of_lattice(inputs, place, strength)
    } else {
        speckle::of_sheets(inputs, place, strength, inputs.sheets_per_reach_mm[block])
    };
    inputs.scatterer_gain[block] * echo
}
