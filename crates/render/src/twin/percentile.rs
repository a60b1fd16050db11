//! The 98th percentile of the attenuation map.

use super::inputs::Inputs;
use super::section::Run;
use crate::constants::BRIGHTEST_PART;

/// The 2nd percentile of Σμ, the one-way attenuation from the face, over the sector's area; nepers. e^(−Σμ) is the
/// map's 98th percentile.
pub fn percentile(inputs: &Inputs, runs: &[Vec<Run>]) -> f64 {
    let wanted = BRIGHTEST_PART * area(inputs, inputs.depth_mm) * runs.len() as f64;
    let in_front = |limit_np: f64| -> f64 { runs.iter().map(|r| area(inputs, reach_mm(inputs, r, limit_np))).sum() };
    // Bisection on Σμ, which never falls along a ray.
    let (mut low, mut high) = (0.0, 1.0e4);
    for _ in 0..200 {
        let middle = 0.5 * (low + high);
        if in_front(middle) > wanted { high = middle } else { low = middle }
    }
    0.5 * (low + high)
}

/// Area of a map ray's strip of the sector up to a depth, over the rays' spacing.
fn area(inputs: &Inputs, depth_mm: f64) -> f64 {
    inputs.face_radius_mm.map_or(depth_mm, |radius| depth_mm * (0.5 * depth_mm + radius))
}

/// Depth on a map ray at which Σμ exceeds `limit_np`, mm; at most the image's depth.
fn reach_mm(inputs: &Inputs, runs: &[Run], limit_np: f64) -> f64 {
    for (i, run) in runs.iter().enumerate() {
        let end_mm = runs.get(i + 1).map_or(inputs.depth_mm, |next| next.start_mm);
        if run.sum_np + run.rate_np_mm * (end_mm - run.start_mm) > limit_np {
            return (run.start_mm + (limit_np - run.sum_np) / run.rate_np_mm).clamp(run.start_mm, end_mm);
        }
    }
    inputs.depth_mm
}
