//! Gas in hollow organs. It collects in the highest part of a patient who lies on the back.

use rayon::prelude::*;

use super::{BORDER_VOXELS, distances_mm};
use crate::segmentation::grid::Grid;

/// Density below which a voxel of a CT is gas, HU.
const GAS_HU: f32 = -400.0;

/// Information on the gas of an organ.
#[derive(Debug, Clone, Copy)]
pub enum Gas<'a> {
    /// Gas that a CT shows: HU of each voxel.
    Seen(&'a [f32]),
    /// Share of the lumen that is gas, 0..=1, at its front. Each slice of equal k has the same share, as loops of bowel
    /// fill separately.
    Share(f64),
}

/// Indices of the voxels of `label` that are gas, all of them more than `wall_mm` below the organ's surface.
pub fn gas_of(labels: &[u16], grid: &Grid, label: u16, wall_mm: f64, gas: Gas) -> Vec<usize> {
    let Some((low, high)) = bounds(labels, grid, label) else { return Vec::new() };
    let size: [usize; 3] = std::array::from_fn(|axis| high[axis] - low[axis] + 3);
    // A box around the organ, one voxel wider on each side. Indices beyond the grid are clamped to its border.
    let index = |[x, y, z]: [usize; 3]| {
        let at = |axis: usize, v: usize| (v + low[axis]).saturating_sub(1).min(grid.size[axis] - 1);
        (at(2, z) * grid.size[1] + at(1, y)) * grid.size[0] + at(0, x)
    };
    let coordinates = |i: usize| [i % size[0], i / size[0] % size[1], i / (size[0] * size[1])];
    let count: usize = size.iter().product();
    let outside: Vec<bool> = (0..count).into_par_iter().map(|i| labels[index(coordinates(i))] != label).collect();
    let depth_mm = distances_mm(&outside, size, grid.voxel_mm());
    let border_mm = BORDER_VOXELS * grid.voxel_mm().min_element();
    let inner = |i: usize| f64::from(depth_mm[i]) - border_mm > wall_mm;
    let layer = size[0] * size[1];
    let mut found: Vec<usize> = (0..size[2])
        .into_par_iter()
        .flat_map_iter(|z| {
            let mut lumen: Vec<usize> = (z * layer..(z + 1) * layer).filter(|&i| inner(i)).collect();
            let share = match gas {
                Gas::Seen(hu) => {
                    lumen.retain(|&i| hu[index(coordinates(i))] < GAS_HU);
                    1.0
                }
                Gas::Share(share) => share,
            };
            // Rows ascend to the patient's back, so the first rows are the most anterior.
            let keep = (share.clamp(0.0, 1.0) * lumen.len() as f64).round() as usize;
            let row = |i: usize| i / size[0];
            // Only whole rows are kept, as gas has a level surface.
            let level = lumen.get(keep).map_or(usize::MAX, |&i| row(i));
            lumen.retain(|&i| row(i) < level);
            lumen.into_iter().map(|i| index(coordinates(i))).collect::<Vec<_>>()
        })
        .collect();
    found.sort_unstable();
    found.dedup();
    found
}

/// Lowest and highest index of a label's voxels along each axis; `None` for a label without voxels.
fn bounds(labels: &[u16], grid: &Grid, label: u16) -> Option<([usize; 3], [usize; 3])> {
    let found = labels.par_iter().enumerate().filter(|(_, l)| **l == label).map(|(i, _)| (grid.at(i), grid.at(i)));
    found.reduce_with(|a, b| {
        let pick = |f: fn(usize, usize) -> usize, a: [usize; 3], b: [usize; 3]| std::array::from_fn(|n| f(a[n], b[n]));
        (pick(usize::min, a.0, b.0), pick(usize::max, a.1, b.1))
    })
}

#[cfg(test)]
mod tests {
    use glam::{DAffine3, DVec3};

    use super::*;

    #[test]
    fn gas_lies_in_front_within_the_wall_and_has_a_level() {
        let grid = Grid { size: [30, 30, 20], lps_from_voxel: DAffine3::from_scale(DVec3::splat(1.5)) };
        let inside = |i: usize| {
            let [x, y, _] = grid.at(i).map(|v| v as f64);
            (x - 15.0).powi(2) + (y - 15.0).powi(2) < 100.0
        };
        let labels: Vec<u16> = (0..grid.len()).map(|i| if inside(i) { 7 } else { 0 }).collect();
        let gas = gas_of(&labels, &grid, 7, 3.0, Gas::Share(0.3));
        let lumen = (0..grid.len())
            .filter(|&i| {
                let [x, y, _] = grid.at(i).map(|v| v as f64);
                (x - 15.0).powi(2) + (y - 15.0).powi(2) < 64.0
            })
            .count();
        let share = gas.len() as f64 / lumen as f64;
        assert!((0.18..0.36).contains(&share), "{share}");
        let level = gas.iter().map(|&i| grid.at(i)[1]).max().unwrap();
        assert!(gas.iter().all(|&i| labels[i] == 7) && level < 15, "{level}");
        assert!(gas_of(&labels, &grid, 3, 3.0, Gas::Share(0.3)).is_empty());
        // The CT shows gas in the left half of the organ.
        let hu: Vec<f32> = (0..grid.len()).map(|i| if grid.at(i)[0] > 15 { -900.0 } else { 30.0 }).collect();
        let seen = gas_of(&labels, &grid, 7, 3.0, Gas::Seen(&hu));
        assert!(seen.len() > 1000 && seen.iter().all(|&i| labels[i] == 7 && grid.at(i)[0] > 15));
    }
}
