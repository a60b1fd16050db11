//! Sums over square windows of pixels, without the pixels outside the sector.

use rayon::prelude::*;

use insonify_core::simd::{at_least, at_most, nearest_bits, widened};

/// Rows of the picture per task.
const ROWS: usize = 32;
/// Number of pixels whose windows are summed at once.
pub(super) const LANES: usize = 32;
/// One number for each of [`LANES`] pixels.
pub(super) type Lanes = [f32; LANES];

/// Reused memory for the sums.
#[derive(Debug, Default)]
pub(super) struct Blur {
    /// Copy of the unchanged picture.
    source: Vec<u8>,
    /// Column sums of each task.
    columns: Vec<Columns>,
}

/// For each column of pixels, over the rows of a window: number of pixels inside the sector, sum of their levels, and
/// sum of the squared levels. Element `i + half` belongs to column `i`; zeros pad both ends.
#[derive(Debug, Default, Clone)]
pub(super) struct Columns {
    counts: Vec<u16>,
    levels: Vec<u16>,
    squares: Vec<u32>,
}

impl Columns {
    /// Mean level and mean squared level in the windows of [`LANES`] pixels, from column `from` on. A window is `SIZE`
    /// pixels wide.
    #[inline(always)]
    pub(super) fn means<const SIZE: usize>(&self, from: usize) -> [Lanes; 2] {
        let (mut counts, mut levels, mut squares) = ([0u16; LANES], [0u16; LANES], [0u32; LANES]);
        for offset in from..from + SIZE {
            // Overflow checks would prevent vectorisation.
            for (sum, count) in counts.iter_mut().zip(&self.counts[offset..][..LANES]) {
                *sum = sum.wrapping_add(*count);
            }
            for (sum, level) in levels.iter_mut().zip(&self.levels[offset..][..LANES]) {
                *sum = sum.wrapping_add(*level);
            }
            for (sum, square) in squares.iter_mut().zip(&self.squares[offset..][..LANES]) {
                *sum = sum.wrapping_add(*square);
            }
        }
        let (mut means, mut mean_squares) = ([0.0; LANES], [0.0; LANES]);
        for i in 0..LANES {
            let count = f32::from(counts[i].max(1));
            means[i] = f32::from(levels[i]) / count;
            mean_squares[i] = squares[i] as f32 / count;
        }
        [means, mean_squares]
    }

    fn clear(&mut self, columns: usize) {
        for sums in [&mut self.counts, &mut self.levels] {
            sums.clear();
            sums.resize(columns, 0);
        }
        self.squares.clear();
        self.squares.resize(columns, 0);
    }
}

impl Blur {
    /// Calls `each(pixels of a row, their mask, column sums)` for every row. The sums are over the 2·`half` + 1 rows
    /// around it.
    pub(super) fn rows(
        &mut self,
        width: usize,
        half: usize,
        mask: &[u8],
        picture: &mut [u8],
        each: impl Fn(&mut [u8], &[u8], &Columns) + Sync,
    ) {
        let Self { source, columns } = self;
        source.clear();
        source.extend_from_slice(picture);
        let (source, height) = (&source[..], picture.len() / width);
        columns.resize(height.div_ceil(ROWS), Columns::default());
        let row = |row: usize| (&source[row * width..][..width], &mask[row * width..][..width]);
        let bands = picture.par_chunks_mut(ROWS * width).zip(columns);
        bands.enumerate().for_each(|(band, (picture, sums))| {
            let first = band * ROWS;
            sums.clear(width + 2 * half + LANES);
            for above in first.saturating_sub(half)..(first + half).min(height) {
                let (levels, mask) = row(above);
                add(levels, mask, half, sums);
            }
            for (i, pixels) in picture.chunks_exact_mut(width).enumerate() {
                let at = first + i;
                if at + half < height {
                    let (levels, mask) = row(at + half);
                    add(levels, mask, half, sums);
                }
                each(pixels, row(at).1, sums);
                if let Some(above) = at.checked_sub(half) {
                    let (levels, mask) = row(above);
                    subtract(levels, mask, half, sums);
                }
            }
        });
    }
}

/// Replaces each pixel of a row inside the sector by `level(its level, mean level, mean squared level)`, with the means
/// over its window.
#[inline(always)]
pub(super) fn each_chunk<const SIZE: usize>(
    columns: &Columns,
    mask: &[u8],
    pixels: &mut [u8],
    level: impl Fn(f32, f32, f32) -> f32,
) {
    for (chunk, (pixels, mask)) in pixels.chunks_mut(LANES).zip(mask.chunks(LANES)).enumerate() {
        let [means, mean_squares] = columns.means::<SIZE>(chunk * LANES);
        let (mut own, mut inside) = ([0; LANES], [0; LANES]);
        own[..pixels.len()].copy_from_slice(pixels);
        inside[..mask.len()].copy_from_slice(mask);
        for i in 0..LANES {
            let level = level(f32::from(own[i]), means[i], mean_squares[i]);
            let rounded = nearest_bits(at_most(at_least(level, 0.0), 255.0)) as u8;
            own[i] = rounded & inside[i];
        }
        pixels.copy_from_slice(&own[..pixels.len()]);
    }
}

widened! {
    /// Adds a row of pixels to the column sums.
    fn add(levels: &[u8], mask: &[u8], half: usize, sums: &mut Columns) = add_body
}

#[inline(always)]
fn add_body(levels: &[u8], mask: &[u8], half: usize, sums: &mut Columns) {
    let columns = half..half + levels.len();
    let counts = sums.counts[columns.clone()].iter_mut().zip(&mut sums.levels[columns.clone()]);
    let sums = counts.zip(&mut sums.squares[columns]);
    for (((count, sum), square), (&level, &inside)) in sums.zip(levels.iter().zip(mask)) {
        let level = u16::from(level & inside);
        *count = count.wrapping_add(u16::from(inside & 1));
        *sum = sum.wrapping_add(level);
        *square = square.wrapping_add(u32::from(level).wrapping_mul(u32::from(level)));
    }
}

widened! {
    /// Subtracts a row of pixels from the column sums.
    fn subtract(levels: &[u8], mask: &[u8], half: usize, sums: &mut Columns) = subtract_body
}

#[inline(always)]
fn subtract_body(levels: &[u8], mask: &[u8], half: usize, sums: &mut Columns) {
    let columns = half..half + levels.len();
    let counts = sums.counts[columns.clone()].iter_mut().zip(&mut sums.levels[columns.clone()]);
    let sums = counts.zip(&mut sums.squares[columns]);
    for (((count, sum), square), (&level, &inside)) in sums.zip(levels.iter().zip(mask)) {
        let level = u16::from(level & inside);
        *count = count.wrapping_sub(u16::from(inside & 1));
        *sum = sum.wrapping_sub(level);
        *square = square.wrapping_sub(u32::from(level).wrapping_mul(u32::from(level)));
    }
}
