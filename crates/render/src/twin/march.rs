//! Scatterers along the paths: complex baseband before the point-spread function.

use glam::{DVec2, DVec3};
use rayon::prelude::*;

use super::inputs::Inputs;
use super::segment::{Path, Segment, segment_at};
use super::speckle::{self, Position, Strength};
use super::texture::texture_level_np;
use super::visibility::{ApertureGain, Boundary};
use crate::constants::{LN_SPECKLE_SILENT, REFLECTED_MAX, TEXTURE_SAMPLES};

/// Baseband of the scatterers [scanlines × samples]. Scatterer amplitude is a·e^(−i2π·phase_turns_per_mm·range).
///
/// All rays of a scanline share the scatterers at a sample's range on its axial path: with scatterers per ray, speckle
/// would not converge. Their strength is the mean power of all rays, their density the mean of the media's, weighted by
/// power. Fully developed speckle has the same statistics with few scatterers as with many.
///
/// With the effect `aperture`, the aperture's gain replaces a path's loss up to its first reflection. After the
/// reflection the path adds its own power, and the axial path's power times the gain.
pub fn march(inputs: &Inputs, paths: &[Path], gains: &[Boundary]) -> Vec<DVec2> {
    let sample = |index: usize| sample_of(inputs, paths, gains, index / inputs.samples, index % inputs.samples);
    (0..inputs.scanlines * inputs.samples).into_par_iter().map(sample).collect()
}

/// Ratio of the scatterers' amplitude on reflected paths to their amplitude with the aperture's gain, at the first
/// sample of each block [scanlines × blocks]; empty without the aperture.
pub fn reflected(inputs: &Inputs, paths: &[Path], gains: &[Boundary]) -> Vec<f64> {
    let Some(aperture) = &inputs.aperture else { return Vec::new() };
    let of_block = |line: usize, block: usize| {
        let range_mm = inputs.range_mm(block * inputs.depth_block);
        let segment_of = |path: usize| &paths[path].segments[segment_at(&paths[path], range_mm)];
        let power_of = |path: usize| {
            let segment = segment_of(path);
            if segment.has_reflected { own_power(segment, range_mm) } else { DVec3::ZERO }
        };
        let power = paths_of(inputs, line).map(power_of).sum::<DVec3>() * inputs.path_weight();
        let axial_path = segment_of(inputs.axial_path_of(line));
        let ln_gain = ApertureGain::new(aperture, gains, line).at(range_mm, -0.5 * axial_path.ln_passed(range_mm));
        let scatterers = scatterer_power(axial_path);
        let by_aperture = (scatterers.x + scatterers.y) * (2.0 * ln_gain.max(LN_SPECKLE_SILENT)).exp();
        let over_aperture = ((power.x + power.y) / by_aperture).sqrt();
        if power == DVec3::ZERO { 0.0 } else { over_aperture.min(REFLECTED_MAX) }
    };
    (0..inputs.scanlines * inputs.blocks())
        .into_par_iter()
        .map(|at| of_block(at / inputs.blocks(), at % inputs.blocks()))
        .collect()
}

/// Amplitude factor of the texture at a sample of an axial path. Groups of four samples share the factor at their
/// middle.
fn texture_gain(inputs: &Inputs, axial_path: &Path, sample: usize) -> f64 {
    let samples = TEXTURE_SAMPLES as usize;
    let first = sample / samples * samples;
    let segment = &axial_path.segments[segment_at(axial_path, inputs.range_mm(first))];
    let Some(texture) = segment.texture.checked_sub(1).map(|number| &inputs.textures[number]) else { return 1.0 };
    let middle_mm = inputs.range_mm(first) + 0.5 * (samples - 1) as f64 * inputs.sample_spacing_mm;
    texture_level_np(texture, segment.scatterer_mm(middle_mm)).exp()
}

/// Indices of the paths that carry a scanline's echoes.
fn paths_of(inputs: &Inputs, line: usize) -> impl Iterator<Item = usize> {
    let rays = inputs.rays_per_line;
    let first = move |layer: usize| (layer * inputs.scanlines + line) * rays;
    (0..inputs.layers).flat_map(move |layer| first(layer)..first(layer) + rays)
}

/// Power of a segment's scatterers at a range, as [`scatterer_power`] times the path's own loss.
fn own_power(segment: &Segment, range_mm: f64) -> DVec3 {
    let ln_amplitude = segment.ln_amplitude(range_mm);
    let loss = if ln_amplitude > LN_SPECKLE_SILENT { (2.0 * ln_amplitude).exp() } else { 0.0 };
    loss * scatterer_power(segment)
}

/// Power of a segment's scatterers without loss: squared mean amplitude, squared deviation, and the sum of both times
/// the density.
fn scatterer_power(segment: &Segment) -> DVec3 {
    let mean = segment.scatterer_mean.powi(2);
    let deviation = segment.scatterer_deviation.powi(2);
    let density = f64::from(segment.scatterer_density);
    if density == 0.0 { DVec3::ZERO } else { DVec3::new(mean, deviation, (mean + deviation) * density) }
}

fn sample_of(inputs: &Inputs, paths: &[Path], gains: &[Boundary], line: usize, sample: usize) -> DVec2 {
    let range_mm = inputs.range_mm(sample);
    // Each pair of samples shares the segment of its first sample.
    let segment_of = |path: usize| &paths[path].segments[segment_at(&paths[path], inputs.range_mm(sample & !1))];
    let axial_path = segment_of(inputs.axial_path_of(line));
    let gain = inputs.aperture.as_ref().map(|aperture| {
        let ln_amplitude = ApertureGain::new(aperture, gains, line).at(range_mm, -0.5 * axial_path.ln_passed(range_mm));
        (2.0 * ln_amplitude.max(LN_SPECKLE_SILENT)).exp()
    });
    let power_of = |path: usize| {
        let segment = segment_of(path);
        if let Some(gain) = gain.filter(|_| !segment.has_reflected) {
            return gain * scatterer_power(segment);
        }
        own_power(segment, range_mm) + gain.map_or(DVec3::ZERO, |gain| gain * scatterer_power(axial_path))
    };
    let power = paths_of(inputs, line).map(power_of).sum::<DVec3>() * inputs.path_weight();
    if power.x + power.y == 0.0 {
        return DVec2::ZERO;
    }
    let strength = Strength { mean: power.x.sqrt(), deviation: power.y.sqrt(), density: power.z / (power.x + power.y) };
    let position = Position { here_mm: axial_path.scatterer_mm(range_mm), step: axial_path.step, range_mm };
    let block = sample / inputs.depth_block;
    let texture = texture_gain(inputs, &paths[inputs.axial_path_of(line)], sample);
    let echo = if inputs.sheets.is_empty() {
        speckle::of_lattice(inputs, position, strength)
    } else {
        speckle::of_sheets(inputs, position, strength, inputs.sheets_per_reach_mm[block])
    };
    inputs.scatterer_gain[block] * texture * echo
}
