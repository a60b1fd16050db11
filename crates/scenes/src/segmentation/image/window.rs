//! Air in images whose low values are clipped.

use rayon::prelude::*;

use crate::segmentation::grid::Grid;

/// Radiodensity of air, HU.
const AIR_HU: f32 = -1000.0;

/// Largest height above the window's lower end, HU, at which a value counts as clipped; allows for rounding.
const ROUNDING_HU: f32 = 1.0;

/// Restores the value of air, −1000 HU, in a CT whose values are clipped to `low`. A clipped voxel counts as air if
/// most of its neighbours are clipped, too, since noise alone clips single voxels of fat.
pub(super) fn restore_air(values: &mut [f32], grid: &Grid, low: f32) {
    let size = grid.size;
    let at_end: Vec<bool> = values.par_iter().map(|value| *value <= low + ROUNDING_HU).collect();
    let near = |at: usize, axis: usize| at.saturating_sub(1)..(at + 2).min(size[axis]);
    values.par_iter_mut().enumerate().filter(|(i, _)| at_end[*i]).for_each(|(i, value)| {
        let [x, y, z] = grid.at(i);
        let (mut count, mut low_ones) = (0, 0);
        for z in near(z, 2) {
            for y in near(y, 1) {
                let row = (z * size[1] + y) * size[0];
                for x in near(x, 0) {
                    count += 1;
                    low_ones += usize::from(at_end[row + x]);
                }
            }
        }
        if 2 * low_ones > count {
            *value = AIR_HU;
        }
    });
}
