//! Conversion from scanlines to pixels.

use super::inputs::Inputs;
use super::section::RasterPoint;
use crate::constants::{CONTRAST_MIN_NP_MM, FIRST_TISSUE, ONE_WAY};

/// Image and maps of a frame, row-major, the first row nearest to the probe; 0 outside the sector.
#[derive(Debug, Clone, PartialEq)]
pub struct Maps {
    /// Grey levels before rounding, 0..=255 [height × width].
    pub grey: Vec<f64>,
    /// Tissue numbers: index of the tissue + 1 [height × width].
    pub segmentation: Vec<u8>,
    /// One-way attenuation e^(−Σμ) over its 98th percentile, 0..=1 [height × width].
    pub attenuation: Vec<f64>,
}

/// Interpolates every pixel. Grey levels are bilinear between scanlines. Between two map rays, Σμ is linear and the
/// tissue is the nearer ray's; between the depths of a map ray, both are exact.
pub fn scan_convert(inputs: &Inputs, grey: &[f64], raster: &[RasterPoint], percentile_np: f64) -> Maps {
    let count = inputs.pixels.len();
    let mut maps = Maps { grey: vec![0.0; count], segmentation: vec![0; count], attenuation: vec![0.0; count] };
    for (pixel, positions) in inputs.pixels.iter().zip(&inputs.map_pixels).enumerate() {
        if let Some([line, sample]) = *positions.0 {
            maps.grey[pixel] = bilinear(inputs, grey, line, sample);
        }
        // Map rays are straight, even if scanlines are steered.
        if let Some([line, sample]) = *positions.1 {
            let point = across(inputs, raster, line, (sample + 0.5) * inputs.sample_spacing_mm);
            maps.segmentation[pixel] = (point.tissue as u32 + FIRST_TISSUE) as u8;
            maps.attenuation[pixel] = (percentile_np - point.sum_np).min(0.0).exp();
        }
    }
    maps
}

fn bilinear(inputs: &Inputs, grey: &[f64], line: f64, sample: f64) -> f64 {
    let line = line.clamp(0.0, (inputs.scanlines - 1) as f64);
    let sample = sample.clamp(0.0, (inputs.samples - 1) as f64);
    let mix = |a: f64, b: f64, part: f64| a + (b - a) * part;
    let levels = inputs.samples * inputs.levels_per_sample();
    let level = sample * inputs.levels_per_sample() as f64;
    let along = |line: usize| {
        let row = &grey[line * levels..(line + 1) * levels];
        mix(row[level as usize], row[(level as usize + 1).min(levels - 1)], level.fract())
    };
    mix(along(line as usize), along((line as usize + 1).min(inputs.scanlines - 1)), line.fract())
}

/// Tissue and Σμ at a depth and a fractional scanline index: between two map rays, or up to half a spacing beyond the
/// outer rays.
fn across(inputs: &Inputs, raster: &[RasterPoint], line: f64, depth_mm: f64) -> RasterPoint {
    let count = inputs.map_rays.len();
    let position = (line + 0.5) / inputs.scanlines as f64 * count as f64 - 0.5;
    let first = (position.max(0.0) as usize).min(count.max(2) - 2);
    let part = (position - first as f64).clamp(-0.5, 1.5);
    let on_ray =
        |ray: usize| between(inputs, &raster[ray * inputs.map_depths..(ray + 1) * inputs.map_depths], depth_mm);
    let (one, next) = (on_ray(first), on_ray((first + 1).min(count - 1)));
    let sum_np = (one.sum_np + (next.sum_np - one.sum_np) * part).max(0.0);
    RasterPoint { sum_np, tissue: if part >= 0.5 { next.tissue } else { one.tissue } }
}

/// Tissue and Σμ between two depths of a map ray. If the depths lie in different tissues, their Σμ gives the position
/// of the boundary.
fn between(inputs: &Inputs, on_ray: &[RasterPoint], depth_mm: f64) -> RasterPoint {
    let step_mm = inputs.map_step_mm;
    let index = ((depth_mm / step_mm) as usize).min(on_ray.len() - 2);
    let (before, after) = (on_ray[index], on_ray[index + 1]);
    let beyond_mm = depth_mm - index as f64 * step_mm;
    if before.tissue == after.tissue {
        let sum_np = before.sum_np + (after.sum_np - before.sum_np) * (beyond_mm / step_mm).clamp(0.0, 1.0);
        return RasterPoint { sum_np, tissue: before.tissue };
    }
    let rate = |point: RasterPoint| ONE_WAY * inputs.media[point.tissue].attenuation_np_mm;
    let contrast = rate(before) - rate(after);
    let boundary_mm = if contrast.abs() > CONTRAST_MIN_NP_MM {
        ((after.sum_np - before.sum_np - rate(after) * step_mm) / contrast).clamp(0.0, step_mm)
    } else {
        // If both tissues attenuate alike, the boundary is unknown. The midpoint is at most half a pixel off.
        0.5 * step_mm
    };
    let in_after_mm = (beyond_mm - boundary_mm).max(0.0);
    RasterPoint {
        sum_np: before.sum_np + rate(before) * beyond_mm.min(boundary_mm) + rate(after) * in_after_mm,
        tissue: if beyond_mm > boundary_mm { after.tissue } else { before.tissue },
    }
}
