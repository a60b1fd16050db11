//! Checks of the image that was segmented: whether it is a CT in HU, and whether it fits the labels.
//!
//! [`checked`] compares the image's values at labelled voxels with the tissues that the labels state: soft tissue,
//! bone, lungs. Its result is on the labels' grid.

mod error;
mod fit;
mod judge;
mod levels;
mod window;

pub use error::ImageError;

use glam::{DAffine3, DMat3, DVec3};
use rayon::prelude::*;

use super::grid::Grid;
use super::inputs::{Organ, least};
use super::volume::{Image, OUTSIDE};
use judge::Judgement;
use levels::{Levels, Sample};

/// An image on the grid of the labels, and its kind.
#[derive(Debug, Clone, PartialEq)]
pub struct Checked {
    /// Values in the order of the labels' grid: HU if it is a CT.
    pub values: Vec<f32>,
    /// True for a CT.
    pub is_ct: bool,
    /// Sentences on the kind of the image, with the reason, and on its fit.
    pub remarks: Vec<String>,
}

/// Checks `image` and transfers it to `grid`, the labels' grid. `labels` are 0, or 1 + the index of their organ.
/// `image` must be in canonical order.
///
/// # Errors
/// An image of one value; a CT whose values aren't HU, or are clipped above the fat. An image that doesn't fit the
/// labels: organs lie in air, or a mirror image fits better and three or more organs have borders in the image.
pub fn checked(image: &Image, grid: &Grid, labels: &[u16], organs: &[Organ]) -> Result<Checked, ImageError> {
    let (lowest, highest) = (least(&image.values), most(&image.values));
    if lowest >= highest {
        return Err(ImageError::Constant { path: image.path.clone(), value: lowest });
    }
    let sample = Sample::of(image, grid, labels, organs);
    let levels = Levels::of(image, &sample);
    let mut values = on_grid(image, grid);
    let judgement = judge::judge(image, &levels, &|low| judge::fat_ring(&values, grid, labels, low))?;
    let fit = fit::check(image, &sample, &levels, &judgement)?;
    let (is_ct, reason) = match judgement {
        Judgement::Hu(reason) => (true, reason),
        Judgement::Window { low, reason } => {
            window::restore_air(&mut values, grid, low);
            (true, reason)
        }
        Judgement::Other(reason) => (false, reason),
    };
    let remarks = std::iter::once(reason).chain(fit).collect();
    if is_ct {
        let index = nearest(grid, &image.grid());
        values.par_iter_mut().enumerate().filter(|(i, _)| index(*i).is_none()).for_each(|(_, value)| *value = OUTSIDE);
    }
    Ok(Checked { values, is_ct, remarks })
}

/// Function from the index of a voxel of grid `from` to that of the nearest voxel of grid `to`; `None` outside `to`.
pub(super) fn nearest(from: &Grid, to: &Grid) -> impl Fn(usize) -> Option<usize> + Sync + use<> {
    let to_from = to.lps_from_voxel.inverse() * from.lps_from_voxel;
    let (from, size) = (from.clone(), to.size);
    move |i: usize| {
        let p = to_from.transform_point3(DVec3::from_array(from.at(i).map(|v| v as f64))).round();
        let within = (0..3).all(|n| (0.0..size[n] as f64).contains(&p[n]));
        within.then(|| (p.z as usize * size[1] + p.y as usize) * size[0] + p.x as usize)
    }
}

/// Highest value of an image.
fn most(values: &[f32]) -> f32 {
    values.par_iter().copied().reduce(|| f32::NEG_INFINITY, f32::max)
}

/// Values of an image on `grid`; voxels outside the image get the image's lowest value.
fn on_grid(image: &Image, grid: &Grid) -> Vec<f32> {
    let least = least(&image.values);
    let index = nearest(grid, &image.grid());
    (0..grid.len()).into_par_iter().map(|i| index(i).map_or(least, |i| image.values[i])).collect()
}

/// Advice on a volume in the wrong position: axes of its affine to negate, so that the volume contains at least
/// `least_percent` of the labelled voxels; empty if no change helps. `holds(i)` tells whether voxel `i` has content.
pub(super) fn turned_hint(
    labels: &[u16],
    grid: &Grid,
    volume: &Grid,
    holds: &(dyn Fn(usize) -> bool + Sync),
    least_percent: f64,
) -> String {
    let changes = [
        (DVec3::new(-1.0, -1.0, 1.0), "x and y"),
        (DVec3::new(-1.0, 1.0, 1.0), "x"),
        (DVec3::new(1.0, -1.0, 1.0), "y"),
        (DVec3::new(1.0, 1.0, -1.0), "z"),
    ];
    for (signs, which) in changes {
        let turned = DAffine3::from_mat3(DMat3::from_diagonal(signs)) * volume.lps_from_voxel;
        let index = nearest(grid, &Grid { size: volume.size, lps_from_voxel: turned });
        let labelled = labels.par_iter().enumerate().filter(|(_, label)| **label != 0);
        let held = labelled.map(|(i, _)| (1usize, usize::from(index(i).is_some_and(holds))));
        let (count, held) = held.reduce(|| (0, 0), |a, b| (a.0 + b.0, a.1 + b.1));
        let percent = 100.0 * held as f64 / count.max(1) as f64;
        if percent >= least_percent {
            return format!(
                " With {which} of its affine negated it would hold {percent:.0} %: were LPS and RAS taken for each other?"
            );
        }
    }
    String::new()
}

#[cfg(test)]
mod tests;
