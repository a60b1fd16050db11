//! Outline of the body: from a label map of the body, from the image, or around the labels.

use rayon::prelude::*;
use serde::Serialize;

use super::{distances_mm, large_components};
use crate::segmentation::grid::Grid;

/// Source of the body's outline.
#[derive(Debug, Clone, Copy, PartialEq, Eq, Serialize)]
#[serde(rename_all = "snake_case")]
pub enum OutlineSource {
    /// A label of the body.
    Label,
    /// The image that was segmented.
    Image,
    /// A convex hull around all labels in each slice: a guess.
    Labels,
}

/// Lowest density that counts as body, HU: above that of air and foam.
const BODY_HU: f32 = -250.0;
/// Largest distance between two slices, mm, at which the labels of one slice extend the hull in the other.
const REACH_MM: f64 = 60.0;
/// Largest width, mm, of structures that are removed from the body in an image: the table, blankets, lines.
const OPENING_MM: f64 = 6.0;

/// Mask of the body from a given mask: its large parts, and all parts with a voxel for which `holds` is true. Holes are
/// filled.
pub fn from_mask(mut mask: Vec<bool>, grid: &Grid, holds: impl Fn(usize) -> bool) -> Vec<bool> {
    large_components(&mut mask, grid.size, holds);
    fill_slices(&mut mask, grid.size);
    mask
}

/// Mask of the body in an image. In a CT, the body's voxels are denser than foam; in other images, they are brighter
/// than Otsu's threshold. The mask is opened, reduced to its large parts and filled slice by slice. `values` are in the
/// order of the grid.
pub fn from_image(values: &[f32], grid: &Grid, is_ct: bool) -> Vec<bool> {
    let threshold = if is_ct { BODY_HU } else { otsu(values) };
    let mask: Vec<bool> = values.par_iter().map(|&v| v > threshold).collect();
    let outside: Vec<bool> = mask.par_iter().map(|&m| !m).collect();
    let radius_mm = (0.5 * OPENING_MM) as f32;
    let to_outside = distances_mm(&outside, grid.size, grid.voxel_mm());
    let mut core: Vec<bool> = to_outside.par_iter().map(|&d| d > radius_mm).collect();
    large_components(&mut core, grid.size, |_| false);
    let to_core = distances_mm(&core, grid.size, grid.voxel_mm());
    let mut body: Vec<bool> = to_core.par_iter().zip(&mask).map(|(&d, &m)| m && d <= radius_mm + 0.5).collect();
    fill_slices(&mut body, grid.size);
    body
}

/// Mask of a body around the labels: a convex hull in each slice, grown by `margin_mm` on all sides. A hull also
/// encloses the labels of slices up to 60 mm away, so that the body has no gaps between organs.
pub fn from_labels(labels: &[u16], grid: &Grid, margin_mm: f64) -> Vec<bool> {
    let [nx, ny, nz] = grid.size;
    let reach = (REACH_MM / grid.voxel_mm().z).round() as usize;
    let ends: Vec<Vec<Option<[usize; 2]>>> = labels.par_chunks(nx * ny).map(|slice| row_ends(slice, nx)).collect();
    let is_labelled = |slice: &[Option<[usize; 2]>]| slice.iter().any(Option::is_some);
    let first = ends.iter().position(|slice| is_labelled(slice)).unwrap_or(0);
    let last = ends.iter().rposition(|slice| is_labelled(slice)).unwrap_or(0);
    let mut hull = vec![false; labels.len()];
    hull.par_chunks_mut(nx * ny).enumerate().for_each(|(k, slice)| {
        if !(first..=last).contains(&k) {
            return;
        }
        let mut rows = vec![None; ny];
        for near in &ends[k.saturating_sub(reach)..(k + reach + 1).min(nz)] {
            for (row, other) in rows.iter_mut().zip(near) {
                *row = joined(*row, *other);
            }
        }
        fill_hull(slice, &rows, nx);
    });
    let to_hull = distances_mm(&hull, grid.size, grid.voxel_mm());
    to_hull.par_iter().map(|&d| f64::from(d) <= margin_mm).collect()
}

/// First and last labelled voxel in each row of a slice along x. No other voxel can be a corner of the hull.
fn row_ends(slice: &[u16], nx: usize) -> Vec<Option<[usize; 2]>> {
    let ends = |row: &[u16]| Some([row.iter().position(|&l| l != 0)?, row.iter().rposition(|&l| l != 0)?]);
    slice.chunks(nx).map(ends).collect()
}

fn joined(a: Option<[usize; 2]>, b: Option<[usize; 2]>) -> Option<[usize; 2]> {
    match (a, b) {
        (Some([a, b]), Some([c, d])) => Some([a.min(c), b.max(d)]),
        (a, b) => a.or(b),
    }
}

/// Sets the voxels of a slice within the convex hull of the row ends given by `rows`.
fn fill_hull(slice: &mut [bool], rows: &[Option<[usize; 2]>], nx: usize) {
    let mut points: Vec<(i64, i64)> = Vec::new();
    for (y, ends) in (0..).zip(rows) {
        points.extend(ends.iter().flatten().map(|&x| (x as i64, y)));
    }
    if points.is_empty() {
        return;
    }
    // Left or right side of the hull, row by row (Andrew's monotone chain).
    let side = |points: &mut dyn Iterator<Item = (i64, i64)>, sign: i64| {
        let mut chain: Vec<(i64, i64)> = Vec::new();
        for p in points {
            while let [.., a, b] = chain[..] {
                let cross = (b.0 - a.0) * (p.1 - a.1) - (b.1 - a.1) * (p.0 - a.0);
                if cross * sign > 0 {
                    break;
                }
                chain.pop();
            }
            chain.push(p);
        }
        chain
    };
    let ends = |pick: fn(i64, i64) -> i64| {
        let mut rows: Vec<(i64, i64)> = Vec::new();
        for &(x, y) in &points {
            match rows.last_mut() {
                Some(last) if last.1 == y => last.0 = pick(last.0, x),
                _ => rows.push((x, y)),
            }
        }
        rows
    };
    let left = side(&mut ends(i64::min).into_iter(), -1);
    let right = side(&mut ends(i64::max).into_iter(), 1);
    let along = |chain: &[(i64, i64)], y: i64| -> Option<f64> {
        let n = chain.windows(2).position(|w| (w[0].1..=w[1].1).contains(&y));
        match n.map(|n| (chain[n], chain[n + 1])) {
            Some((a, b)) if b.1 > a.1 => Some(a.0 as f64 + (b.0 - a.0) as f64 * (y - a.1) as f64 / (b.1 - a.1) as f64),
            _ => chain.iter().find(|p| p.1 == y).map(|p| p.0 as f64),
        }
    };
    for (y, row) in (0..).zip(slice.chunks_mut(nx)) {
        if let (Some(from), Some(to)) = (along(&left, y), along(&right, y)) {
            let (from, to) = (from.round().max(0.0) as usize, (to.round() as usize).min(nx - 1));
            row[from..=to.max(from)].fill(true);
        }
    }
}

/// Fills the holes in each slice of equal k.
fn fill_slices(mask: &mut [bool], size: [usize; 3]) {
    let [nx, ny, _] = size;
    mask.par_chunks_mut(nx * ny).for_each(|slice| {
        let mut outside = vec![false; slice.len()];
        let mut stack: Vec<usize> = (0..nx).flat_map(|x| [x, (ny - 1) * nx + x]).collect();
        stack.extend((0..ny).flat_map(|y| [y * nx, y * nx + nx - 1]));
        while let Some(index) = stack.pop() {
            if slice[index] || outside[index] {
                continue;
            }
            outside[index] = true;
            let (x, y) = (index % nx, index / nx);
            if x > 0 {
                stack.push(index - 1);
            }
            if x + 1 < nx {
                stack.push(index + 1);
            }
            if y > 0 {
                stack.push(index - nx);
            }
            if y + 1 < ny {
                stack.push(index + nx);
            }
        }
        slice.iter_mut().zip(outside).for_each(|(inside, outside)| *inside = !outside);
    });
}

/// Threshold that best separates the values into two classes (Otsu 1979).
fn otsu(values: &[f32]) -> f32 {
    const BINS: usize = 256;
    let (least, most) = values.iter().fold((f32::INFINITY, f32::NEG_INFINITY), |(a, b), &v| (a.min(v), b.max(v)));
    if least >= most {
        return least;
    }
    let scale = BINS as f32 / (most - least);
    let mut counts = [0u64; BINS];
    for &v in values {
        counts[(((v - least) * scale) as usize).min(BINS - 1)] += 1;
    }
    let total = values.len() as f64;
    let all: f64 = counts.iter().enumerate().map(|(n, &c)| n as f64 * c as f64).sum();
    let (mut below, mut sum, mut best) = (0.0, 0.0, (0.0, 0));
    for (n, &count) in counts.iter().enumerate() {
        below += count as f64;
        sum += n as f64 * count as f64;
        if below > 0.0 && below < total {
            let apart = sum / below - (all - sum) / (total - below);
            let between = below * (total - below) * apart * apart;
            if between > best.0 {
                best = (between, n);
            }
        }
    }
    least + (best.1 + 1) as f32 / scale
}

/// Margin between the labels' hull and the body's outline in [`from_labels`], mm.
pub(crate) fn hull_margin_mm(skin_mm: f64, fat_mm: f64) -> f64 {
    /// Assumed thickness of muscle and fascia, which are seldom labelled, mm.
    const WALL_MM: f64 = 4.0;
    skin_mm + fat_mm + WALL_MM
}

#[cfg(test)]
mod tests {
    use glam::{DAffine3, DVec3};

    use super::*;

    fn grid(size: [usize; 3]) -> Grid {
        Grid { size, lps_from_voxel: DAffine3::from_scale(DVec3::splat(2.0)) }
    }

    #[test]
    fn a_body_in_a_scan_loses_its_table_and_keeps_its_lungs() {
        let size = [60, 50, 8];
        let grid = grid(size);
        let value = |i: usize| {
            let [x, y, _] = grid.at(i).map(|v| v as f64);
            let from = |cx: f64, cy: f64| ((x - cx).powi(2) + (y - cy).powi(2)).sqrt();
            match () {
                () if from(25.0, 22.0) < 6.0 => -850.0,
                () if from(30.0, 22.0) < 18.0 => 40.0,
                () if (44.0..46.0).contains(&y) => 200.0,
                () => -1000.0,
            }
        };
        let values: Vec<f32> = (0..grid.len()).map(|i| value(i) as f32).collect();
        let body = from_image(&values, &grid, true);
        let disc = (0..grid.len()).filter(|&i| {
            let [x, y, _] = grid.at(i).map(|v| v as f64);
            ((x - 30.0).powi(2) + (y - 22.0).powi(2)).sqrt() < 18.0
        });
        let (mut wrong, mut count) = (0, 0);
        for i in disc {
            count += 1;
            wrong += usize::from(!body[i]);
        }
        assert!(wrong * 50 < count, "{wrong} of {count} lost");
        assert!(body.iter().filter(|&&b| b).count() <= count, "the table stayed");
    }

    #[test]
    fn the_hull_of_two_discs_holds_what_lies_between_them() {
        let size = [60, 30, 3];
        let grid = grid(size);
        let labels: Vec<u16> = (0..grid.len())
            .map(|i| {
                let [x, y, _] = grid.at(i).map(|v| v as f64);
                let near = |cx: f64| (x - cx).powi(2) + (y - 15.0).powi(2) < 25.0;
                u16::from(near(12.0) || near(45.0))
            })
            .collect();
        let body = from_labels(&labels, &grid, 6.0);
        let at = |x: usize, y: usize| body[(30 + y) * 60 + x];
        assert!(at(28, 15) && at(28, 19) && at(12, 22) && !at(12, 25) && !at(2, 15) && at(5, 15));
    }

    #[test]
    fn otsus_threshold_lies_between_two_peaks() {
        let values: Vec<f32> =
            (0..1000).map(|i| if i % 3 == 0 { 90.0 + (i % 7) as f32 } else { (i % 11) as f32 }).collect();
        let threshold = otsu(&values);
        assert!((10.0..90.0).contains(&threshold), "{threshold}");
    }
}
