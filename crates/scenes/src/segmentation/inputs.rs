//! Inputs of a scene: labels on a grid, organs, and the body's outline, fat and image if they are known.

use glam::{DAffine3, DVec3};
use rayon::prelude::*;

use super::body::hull_margin_mm;
use super::classes::Wall;
use super::grid::Grid;
use super::meshing::NONE;
use super::volume::OUTSIDE;

/// Organ of a scene: a segment with the tissue, wall and gas of its surfaces.
#[derive(Debug, Clone, PartialEq)]
pub struct Organ {
    /// Name of the organ's surface.
    pub name: String,
    /// Tissue that fills the organ.
    pub tissue: String,
    /// Priority among organs: where segments overlap, the highest priority wins.
    pub priority: i32,
    /// Layers of the organ's wall, the outermost first. The wall lies just within the organ's surface.
    pub wall: Vec<Wall>,
    /// Gas in the organ's lumen: its tissue, and the fraction of the lumen it fills, 0..=1.
    pub gas: Option<(String, f64)>,
}

/// Inputs of a scene. All arrays are in the order of the grid, x fastest.
#[derive(Debug, Clone)]
pub struct Inputs {
    /// Grid of all arrays; its axes run nearest to the patient's left, back and head.
    pub grid: Grid,
    /// Label of each voxel: 0, or 1 + index of its organ.
    pub labels: Vec<u16>,
    /// Organs; label `n` is organ `n − 1`.
    pub organs: Vec<Organ>,
    /// Voxels of the body, if a label map defines it.
    pub body: Option<Vec<bool>>,
    /// Voxels of subcutaneous fat, if a label map defines them.
    pub fat: Option<Vec<bool>>,
    /// Values of the image that was segmented, if one was given: HU for a CT.
    pub image: Option<Vec<f32>>,
    /// Whether the image is a CT.
    pub is_ct: bool,
    /// Assumptions and choices in reading the files, one sentence each.
    pub remarks: Vec<String>,
}

/// Memory needed per voxel while a scene is made, bytes: labels, masks, distances and surfaces.
const WORKING_BYTES: u64 = 28;

/// Lowest value of an image.
pub(super) fn least(image: &[f32]) -> f32 {
    image.par_iter().copied().reduce(|| f32::INFINITY, f32::min)
}

impl Organ {
    /// Thickness of the wall, mm; 0 without a wall.
    pub(super) fn wall_mm(&self) -> f64 {
        self.wall.iter().map(|layer| layer.mm).sum()
    }
}

impl Inputs {
    /// The image, if it is a CT.
    pub(super) fn ct(&self) -> Option<&[f32]> {
        self.image.as_deref().filter(|_| self.is_ct)
    }

    /// Lowest and highest voxel indices along each axis of the region that is labelled or may belong to the body.
    fn bounds(&self) -> Option<([usize; 3], [usize; 3])> {
        let grid = &self.grid;
        let inside =
            |i: usize| self.labels[i] != NONE || self.body.as_ref().is_some_and(|b| b[i]) || self.image.is_some();
        let bounds = (0..grid.len()).into_par_iter().filter(|&i| inside(i)).map(|i| (grid.at(i), grid.at(i)));
        bounds.reduce_with(|a, b| {
            (std::array::from_fn(|n| a.0[n].min(b.0[n])), std::array::from_fn(|n| a.1[n].max(b.1[n])))
        })
    }

    /// Approximate memory for making a scene of these inputs, bytes.
    pub(super) fn working_bytes(&self) -> u64 {
        let Some((low, high)) = self.bounds() else { return 0 };
        let voxels: usize = (0..3).map(|n| high[n] - low[n] + 1).product();
        (voxels as u64).saturating_mul(WORKING_BYTES)
    }

    /// The inputs on a grid cropped to the body, with an empty margin around the body except on sides where the scan
    /// itself ends.
    pub(super) fn with_margin(self, skin_mm: f64, fat_mm: f64) -> Self {
        let grid = &self.grid;
        let Some((low, high)) = self.bounds() else { return self };
        let guessed = self.body.is_none() && self.image.is_none();
        let margin_mm = if guessed { hull_margin_mm(skin_mm, fat_mm) } else { 0.0 };
        let voxel_mm = grid.voxel_mm();
        let margin = |axis: usize| (margin_mm / voxel_mm[axis]).ceil() as usize + 2;
        // Corners `first` and `last` of the new grid, as voxel indices in the old grid. A guessed body gets a margin
        // in x and y even at the map's border, since maps are often cropped to their organs.
        let ends = |n: usize, at_border: bool| at_border && !(guessed && n < 2);
        let first: [i64; 3] =
            std::array::from_fn(|n| if ends(n, low[n] == 0) { 0 } else { low[n] as i64 - margin(n) as i64 });
        let last: [i64; 3] = std::array::from_fn(|n| {
            if ends(n, high[n] + 1 == grid.size[n]) { high[n] as i64 } else { (high[n] + margin(n)) as i64 }
        });
        let size: [usize; 3] = std::array::from_fn(|n| (last[n] - first[n] + 1).max(1) as usize);
        let shift = DVec3::from_array(first.map(|v| v as f64));
        let lps_from_voxel = grid.lps_from_voxel * DAffine3::from_translation(shift);
        let new = Grid { size, lps_from_voxel };
        let old_index = |i: usize| {
            let at = new.at(i);
            let old: [i64; 3] = std::array::from_fn(|n| at[n] as i64 + first[n]);
            let within = (0..3).all(|n| (0..grid.size[n] as i64).contains(&old[n]));
            within.then(|| (old[2] as usize * grid.size[1] + old[1] as usize) * grid.size[0] + old[0] as usize)
        };
        fn moved<T: Copy + Send + Sync>(
            of: &[T],
            none: T,
            count: usize,
            index: impl Fn(usize) -> Option<usize> + Sync,
        ) -> Vec<T> {
            (0..count).into_par_iter().map(|i| index(i).map_or(none, |i| of[i])).collect()
        }
        let count = new.len();
        Self {
            labels: moved(&self.labels, NONE, count, old_index),
            body: self.body.as_ref().map(|b| moved(b, false, count, old_index)),
            fat: self.fat.as_ref().map(|b| moved(b, false, count, old_index)),
            image: self.image.as_ref().map(|image| {
                let beyond = if self.is_ct { OUTSIDE } else { least(image) };
                moved(image, beyond, count, old_index)
            }),
            is_ct: self.is_ct,
            remarks: self.remarks,
            organs: self.organs,
            grid: new,
        }
    }
}
