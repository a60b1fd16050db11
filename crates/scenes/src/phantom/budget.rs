//! Cell sizes that give a body's surfaces a requested number of triangles.

use rayon::prelude::*;

use super::meshing::count_triangles;
use super::organ::Organ;

/// Largest accepted relative deviation of the number of triangles from the budget.
const TOLERANCE: f64 = 0.005;

/// Cell size of each of `organs`, mm, such that they have `budget` triangles in total, within half a percent. Calls
/// `counted` each time the triangles of an organ have been counted.
///
/// # Errors
/// The budget is too small; the error is the smallest number of triangles that resolves every organ.
pub(super) fn cell_sizes_mm(organs: &[Organ], budget: usize, counted: &(dyn Fn() + Sync)) -> Result<Vec<f32>, usize> {
    // Triangle counts scale with the inverse square of the cell size, so one coarse count predicts them within a few
    // percent.
    let probes: Vec<(f32, f64)> = organs
        .par_iter()
        .map(|organ| {
            let cell_mm = (2.0 * organ.grain_mm).min(organ.coarsest_mm);
            let count = count_triangles(&organ.solid, cell_mm) as f64;
            counted();
            (cell_mm, count)
        })
        .collect();
    let estimate = |organ: usize, cell_mm: f32| {
        let (probe_mm, count) = probes[organ];
        count * f64::from(probe_mm / cell_mm).powi(2)
    };
    let sizes = |factor: f32| -> Vec<f32> {
        organs.iter().map(|organ| (organ.grain_mm * factor).min(organ.coarsest_mm)).collect()
    };
    let total = |sizes: &[f32]| -> f64 { sizes.iter().enumerate().map(|(i, &mm)| estimate(i, mm)).sum() };

    let least = total(&sizes(f32::MAX)).ceil();
    if least > budget as f64 * 1.05 {
        return Err(least as usize);
    }
    let (mut fine, mut coarse) = (1e-2f32, 1e2f32);
    for _ in 0..40 {
        let middle = (fine * coarse).sqrt();
        if total(&sizes(middle)) > budget as f64 { fine = middle } else { coarse = middle }
    }
    let mut sizes = sizes(coarse);

    // The remaining error is corrected on the largest surfaces, whose counts vary most smoothly with the cell size.
    let mut counts: Vec<f64> =
        organs.par_iter().zip(&sizes).map(|(o, &mm)| count_triangles(&o.solid, mm) as f64).collect();
    for round in 0..12 {
        let excess = counts.iter().sum::<f64>() - budget as f64;
        if excess.abs() <= TOLERANCE * budget as f64 {
            break;
        }
        let mut by_size: Vec<usize> = (0..organs.len()).filter(|&i| sizes[i] < organs[i].coarsest_mm).collect();
        by_size.sort_by(|&a, &b| counts[b].total_cmp(&counts[a]));
        let Some(&i) = by_size.get(round % by_size.len().clamp(1, 4)) else { break };
        let wanted = (counts[i] - excess).clamp(0.6 * counts[i], 1.6 * counts[i]);
        sizes[i] = (sizes[i] * (counts[i] / wanted).sqrt() as f32).min(organs[i].coarsest_mm);
        counts[i] = count_triangles(&organs[i].solid, sizes[i]) as f64;
    }
    Ok(sizes)
}
