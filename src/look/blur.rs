//! Means over squares of pixels within the sector.

use rayon::prelude::*;

/// Rows per task.
const ROWS: usize = 16;

/// Memory of the means of pictures of one size.
#[derive(Debug, Default)]
pub(super) struct Blur {
    /// Sums along rows of (1, level, level²) within the sector.
    rows: Vec<[u32; 3]>,
    /// Sums of each task's columns.
    columns: Vec<[u32; 3]>,
}

impl Blur {
    /// Calls `each(row index, pixels of the row, sums over the square around each pixel)` for every row; the sums are
    /// the number of pixels within the sector, and of their levels and squared levels. A square is 2·half + 1 wide.
    pub(super) fn rows(
        &mut self,
        width: usize,
        half: usize,
        mask: &[u8],
        picture: &mut [u8],
        each: impl Fn(usize, &mut [u8], &[[u32; 3]]) + Sync,
    ) {
        self.rows.resize(picture.len(), [0; 3]);
        let rows = self.rows.par_chunks_mut(width).zip(picture.par_chunks(width)).zip(mask.par_chunks(width));
        rows.for_each(|((sums, levels), mask)| along_row(half, mask, levels, sums));
        let (height, along) = (picture.len() / width, &self.rows[..]);
        self.columns.resize(height.div_ceil(ROWS) * width, [0; 3]);
        let bands = picture.par_chunks_mut(ROWS * width).zip(self.columns.par_chunks_mut(width));
        bands.enumerate().for_each(|(band, (picture, sums))| {
            let first = band * ROWS;
            sums.fill([0; 3]);
            for row in first.saturating_sub(half)..(first + half).min(height) {
                add(sums, &along[row * width..][..width]);
            }
            for (i, pixels) in picture.chunks_exact_mut(width).enumerate() {
                let row = first + i;
                if row + half < height {
                    add(sums, &along[(row + half) * width..][..width]);
                }
                each(row, pixels, sums);
                if let Some(above) = row.checked_sub(half) {
                    subtract(sums, &along[above * width..][..width]);
                }
            }
        });
    }
}

fn along_row(half: usize, mask: &[u8], levels: &[u8], sums: &mut [[u32; 3]]) {
    let width = levels.len();
    let value = |i: usize| {
        let inside = u32::from(mask[i] != 0);
        let level = u32::from(levels[i]) * inside;
        [inside, level, level * level]
    };
    let mut sum = [0; 3];
    for i in 0..half.min(width) {
        add_one(&mut sum, value(i));
    }
    for (i, out) in sums.iter_mut().enumerate() {
        if i + half < width {
            add_one(&mut sum, value(i + half));
        }
        *out = sum;
        if let Some(behind) = i.checked_sub(half) {
            let value = value(behind);
            (0..3).for_each(|part| sum[part] -= value[part]);
        }
    }
}

fn add_one(sum: &mut [u32; 3], value: [u32; 3]) {
    (0..3).for_each(|part| sum[part] += value[part]);
}

fn add(sums: &mut [[u32; 3]], row: &[[u32; 3]]) {
    sums.as_flattened_mut().iter_mut().zip(row.as_flattened()).for_each(|(sum, value)| *sum += value);
}

fn subtract(sums: &mut [[u32; 3]], row: &[[u32; 3]]) {
    sums.as_flattened_mut().iter_mut().zip(row.as_flattened()).for_each(|(sum, value)| *sum -= value);
}
