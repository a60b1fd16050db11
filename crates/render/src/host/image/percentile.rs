//! The 98th percentile of the attenuation map.

use crate::constants::{ENTRIES, PERCENTILE_STEPS};
use crate::host::constants::ImageConstants;
use crate::params::Params;

/// Number of partial sums.
const LANES: usize = 8;

/// The 2nd percentile of Σμ, the one-way attenuation from the face, over the sector's area; nepers. The inputs are the
/// map rays' runs [map_rays × ENTRIES] and their counts. Found by bisection on Σμ, which never falls along a ray.
pub(crate) fn percentile(
    params: &Params,
    constants: ImageConstants,
    entries: &[[f32; 4]],
    entry_counts: &[u32],
) -> f32 {
    let (mut low, mut high) = (0.0f32, 1.0e4f32);
    let wanted = constants.brightest_part() * area(params, params.depth_mm) * params.map_rays as f32;
    let rays = || entries.chunks_exact(ENTRIES as usize).zip(entry_counts).take(params.map_rays as usize);
    for step in 0..PERCENTILE_STEPS {
        let middle = if step < 14 { (low.max(1.0e-6) * high).sqrt() } else { 0.5 * (low + high) };
        let mut sums = [0.0f32; LANES];
        for (i, (runs, &count)) in rays().enumerate() {
            sums[i % LANES] += area(params, reach_mm(params, &runs[..count as usize], middle));
        }
        if sums.iter().sum::<f32>() > wanted {
            high = middle;
        } else {
            low = middle;
        }
    }
    0.5 * (low + high)
}

/// Area of a map ray's strip of the sector up to a depth, in units that cancel.
fn area(params: &Params, depth_mm: f32) -> f32 {
    if params.face_radius_mm < 0.0 { depth_mm } else { depth_mm * (0.5 * depth_mm + params.face_radius_mm) }
}

/// Depth on a map ray at which Σμ exceeds `limit_np`, mm; at most the image's depth.
fn reach_mm(params: &Params, runs: &[[f32; 4]], limit_np: f32) -> f32 {
    for (i, &[start_mm, sum_np, rate_np_mm, _]) in runs.iter().enumerate() {
        let end_mm = runs.get(i + 1).map_or(params.depth_mm, |next| next[0]);
        if sum_np + rate_np_mm * (end_mm - start_mm) > limit_np {
            return (start_mm + (limit_np - sum_np) / rate_np_mm.max(1.0e-30)).max(start_mm).min(end_mm);
        }
    }
    params.depth_mm
}
