//! Beam coordinates for generators: resampling of a picture to a grid of scanlines × range cells, and back.
//!
//! Such a grid has no positions outside the sector, and speckle has one size everywhere. The number of grid values is
//! independent of the size of the picture.

use rayon::prelude::*;

use super::Input;
use super::manifest::{Affine, BeamGrid};
use crate::simd::{at_least, at_most, nearest_bits, real, widened};
use crate::transducer::ScanGeometry;

/// Sum of the four weights of an interpolated value.
const PARTS: u32 = 256;
/// Number of picture rows in a parallel task.
const BAND: usize = 32;
/// Number of pixels interpolated together.
const LANES: usize = 64;

/// Four neighbouring pixels whose weighted mean is one value of the grid.
#[derive(Debug, Clone, Copy, Default)]
struct Corners {
    /// Index of the first of four pixels. The others are its right neighbour and the two pixels below.
    first: u32,
    /// Weights of the four pixels, with the sum [`PARTS`]; all 0 if no pixel is inside the sector. Pixels outside it
    /// have the weight 0.
    weights: [u16; 4],
    /// Index offset from the first pixel to the pixel with the largest weight.
    nearest: u32,
}

/// For each pixel, the grid values from which it is interpolated, and their weights. Arrays allow vector loads.
#[derive(Debug, Clone, Default)]
struct Cells {
    /// First of the four grid values around each pixel: scanline (low 16 bits) and range cell (high 16 bits).
    first_values: Vec<u32>,
    /// Weight of the next scanline (low 8 bits) and of the next range cell (high 8 bits), in units of 1 / [`PARTS`].
    next: Vec<u16>,
}

/// Tables that resample pictures of one geometry to the grid and back.
#[derive(Debug)]
pub(super) struct BeamSampling {
    grid: BeamGrid,
    geometry: ScanGeometry,
    scanlines: usize,
    cells: usize,
    to_grid: Vec<Corners>,
    /// Grid values for the pixels within [`Self::spans`], row by row.
    to_picture: Cells,
    /// For each picture row: its first column inside the sector, the column after the last, and the index of its first
    /// entry in `to_picture`.
    spans: Vec<[usize; 3]>,
    image: Vec<u8>,
    segmentation: Vec<u8>,
    attenuation: Vec<f32>,
    mask: Vec<u8>,
    /// Differences between a model's output and the kept share of its input on the grid, grey levels.
    changes: Vec<f32>,
}

impl BeamSampling {
    /// Computes the tables for `geometry`. This visits every pixel, so callers keep the tables until the geometry
    /// changes.
    pub(super) fn new(grid: BeamGrid, geometry: ScanGeometry) -> Self {
        let (scanlines, cells) = (grid.scanlines as usize, grid.cells(geometry.depth_mm) as usize);
        let (width, height) = (geometry.sector.width as usize, geometry.sector.height as usize);
        let pixels = Picture { geometry: &geometry, width, height };
        let point = |index: usize| {
            let (cell, scanline) = (index / scanlines, index % scanlines);
            let fraction = (scanline as f64 + 0.5) / scanlines as f64;
            pixels.corners(fraction, (cell as f64 + 0.5) * grid.cell_mm)
        };
        let to_grid: Vec<_> = (0..scanlines * cells).into_par_iter().map(point).collect();
        let rows: Vec<_> = (0..height).into_par_iter().map(|row| pixels.row(row, &grid, [scanlines, cells])).collect();
        let mut to_picture = Cells::default();
        let mut spans = Vec::with_capacity(height);
        for (first, cells) in rows {
            spans.push([first, first + cells.len(), to_picture.first_values.len()]);
            let (first_values, next): (Vec<_>, Vec<_>) = cells.into_iter().unzip();
            to_picture.first_values.extend(first_values);
            to_picture.next.extend(next);
        }
        let mask = to_grid.iter().map(|corners| if corners.weights == [0; 4] { 0 } else { 255 }).collect();
        let (image, segmentation, attenuation) = Default::default();
        Self {
            grid,
            geometry,
            scanlines,
            cells,
            to_grid,
            to_picture,
            spans,
            image,
            segmentation,
            attenuation,
            mask,
            changes: Vec::new(),
        }
    }

    /// Whether the tables are for this grid and geometry.
    pub(super) fn is_of(&self, grid: &BeamGrid, geometry: &ScanGeometry) -> bool {
        self.grid == *grid && self.geometry == *geometry
    }

    /// Resamples the maps of `input` to the grid. Grey levels are interpolated; other maps take the nearest pixel.
    /// Empty maps stay empty.
    pub(super) fn resample(&mut self, input: &Input<'_>) -> Input<'_> {
        let take = |corners: &Corners| corners.first as usize + corners.nearest as usize;
        let row = self.geometry.sector.width as usize;
        let mean = |levels: &[u8], corners: &Corners| {
            let at = corners.first as usize;
            let pair = |from: usize| match levels.get(from..) {
                Some(&[one, next, ..]) => [one, next].map(u32::from),
                Some(&[last]) => [last.into(), 0],
                _ => [0; 2],
            };
            let [a, b, c, d] = corners.weights.map(u32::from);
            let ([upper, upper_next], [lower, lower_next]) = (pair(at), pair(at + row));
            let sum = a * upper + b * upper_next + c * lower + d * lower_next;
            ((sum + PARTS / 2) / PARTS) as u8
        };
        let to_grid = &self.to_grid;
        fill(&mut self.image, to_grid, !input.image.is_empty(), |corners| mean(input.image, corners));
        fill(&mut self.segmentation, to_grid, !input.segmentation.is_empty(), |corners| {
            input.segmentation.get(take(corners)).copied().unwrap_or(0)
        });
        fill(&mut self.attenuation, to_grid, !input.attenuation.is_empty(), |corners| {
            input.attenuation.get(take(corners)).copied().unwrap_or(0.0)
        });
        Input {
            width: self.scanlines as u32,
            height: self.cells as u32,
            image: &self.image,
            segmentation: &self.segmentation,
            attenuation: &self.attenuation,
            mask: &self.mask,
            scan: None,
        }
    }

    /// Writes the rounded grey levels of the picture [height × width] to `out`, 0 outside the mask of `input`. They are
    /// interpolated from the model's `values` on the grid, whose rows have the length `stride`; the first row begins at
    /// index `first`. If the grid keeps detail, the kept share of the last resampled image is subtracted before, and the
    /// same share of the image of `input` is added afterwards.
    pub(super) fn picture(
        &mut self,
        values: &[f32],
        [first, stride]: [usize; 2],
        affine: Affine,
        input: &Input<'_>,
        out: &mut Vec<u8>,
    ) {
        out.clear();
        out.resize(input.mask.len(), 0);
        let (last_line, last_cell) = (self.scanlines - 1, self.cells - 1);
        if first + last_cell * stride + last_line >= values.len() {
            return;
        }
        let kept = self.grid.detail_kept;
        if kept == 0.0 || self.image.len() != self.to_grid.len() || input.image.len() != out.len() {
            let model = Model { values, first, stride, last_line, last_cell, affine };
            self.interpolate_rows(&model, (&[], 0.0), input.mask, out);
            return;
        }
        let mut changes = std::mem::take(&mut self.changes);
        changes.resize(self.image.len(), 0.0);
        let (scale, offset) = (affine.scale * 255.0, affine.offset * 255.0);
        let rows = changes.chunks_exact_mut(self.scanlines).zip(self.image.chunks_exact(self.scanlines));
        for ((changes, image), values) in rows.zip(values[first..].chunks(stride)) {
            for ((change, &level), &value) in changes.iter_mut().zip(image).zip(values) {
                *change = at_most(at_least(value * scale + offset, 0.0), 255.0) - kept * real(level.into());
            }
        }
        // The changes are grey levels already.
        let affine = Affine::new(1.0 / 255.0, 0.0);
        let model = Model { values: &changes, first: 0, stride: self.scanlines, last_line, last_cell, affine };
        self.interpolate_rows(&model, (input.image, kept), input.mask, out);
        self.changes = changes;
    }

    /// Interpolates `model` at all pixels inside `mask`, and adds a share of the grey levels of an image, which may be
    /// empty.
    fn interpolate_rows(&self, model: &Model<'_>, (image, share): (&[u8], f32), mask: &[u8], out: &mut [u8]) {
        let width = self.geometry.sector.width as usize;
        let bands = out.par_chunks_mut(BAND * width).zip(self.spans.par_chunks(BAND)).enumerate();
        bands.for_each(|(band, (rows, spans))| {
            for (at, (row, &[begin, end, entry])) in rows.chunks_exact_mut(width).zip(spans).enumerate() {
                let of_row = entry..entry + end - begin;
                let Cells { first_values, next } = &self.to_picture;
                let start = (band * BAND + at) * width;
                interpolate(
                    model,
                    &first_values[of_row.clone()],
                    &next[of_row],
                    (image.get(start + begin..start + end).unwrap_or(&[]), share),
                    &mask[start + begin..start + end],
                    &mut row[begin..end],
                );
            }
        });
    }
}

/// A model's output on the grid. `values` reach at least to the last cell of the last scanline.
struct Model<'a> {
    values: &'a [f32],
    /// Index of the grid's first value, and index distance from one row to the next.
    first: usize,
    stride: usize,
    last_line: usize,
    last_cell: usize,
    affine: Affine,
}

widened! {
    /// Interpolates the pixels of a picture row: rounded grey levels, 0 where the mask is 0. A share of an image's row,
    /// which may be empty, is added.
    fn interpolate(
        model: &Model<'_>, first_values: &[u32], next: &[u16], image: (&[u8], f32), mask: &[u8], row: &mut [u8],
    ) = interpolate_body
}

#[inline(always)]
fn interpolate_body(
    model: &Model<'_>,
    first_values: &[u32],
    next: &[u16],
    (image, share): (&[u8], f32),
    mask: &[u8],
    row: &mut [u8],
) {
    let groups = first_values.chunks(LANES).zip(next.chunks(LANES));
    let images = image.chunks(LANES).chain(std::iter::repeat(&[] as &[u8]));
    for (((first_values, next), image), (mask, row)) in
        groups.zip(images).zip(mask.chunks(LANES).zip(row.chunks_mut(LANES)))
    {
        let mut added = [0.0; LANES];
        for (added, &level) in added.iter_mut().zip(image) {
            *added = share * real(level.into());
        }
        if let (Some(first_values), Some(next)) = (first_values.first_chunk(), next.first_chunk())
            && let (Some(mask), Some(row)) = (mask.first_chunk::<LANES>(), row.first_chunk_mut::<LANES>())
        {
            let levels = levels(model, first_values, next, &added);
            for i in 0..LANES {
                row[i] = levels[i] & mask[i];
            }
            continue;
        }
        let (mut whole, mut whole_next) = ([0; LANES], [0; LANES]);
        whole[..first_values.len()].copy_from_slice(first_values);
        whole_next[..next.len()].copy_from_slice(next);
        let levels = levels(model, &whole, &whole_next, &added);
        for ((level, &found), &inside) in row.iter_mut().zip(&levels).zip(mask) {
            *level = found & inside;
        }
    }
}

/// Interpolated grey levels of a group of `LANES` pixels, plus `added`.
#[inline(always)]
fn levels(model: &Model<'_>, first_values: &[u32; LANES], next: &[u16; LANES], added: &[f32; LANES]) -> [u8; LANES] {
    let &Model { values, first, stride, last_line, last_cell, affine } = model;
    let (mut at, mut right, mut below) = ([0u32; LANES], [0u32; LANES], [0u32; LANES]);
    for i in 0..LANES {
        // Clamps the indices to the grid, so that all reads stay within `values`.
        let line = (first_values[i] & 0xffff).min(last_line as u32);
        let cell = (first_values[i] >> 16).min(last_cell as u32);
        at[i] = (first as u32).wrapping_add(cell.wrapping_mul(stride as u32)).wrapping_add(line);
        right[i] = u32::from(line < last_line as u32);
        below[i] = if cell < last_cell as u32 { stride as u32 } else { 0 };
    }
    let mut corners = [[0.0f32; LANES]; 4];
    for i in 0..LANES {
        let [at, right, below] = [at[i], right[i], below[i]].map(|offset| offset as usize);
        // SAFETY: the greatest index is that of the last cell of the last scanline; `picture` checked that it lies in
        // `values`. Volatile reads, because the compiler's gather instructions take longer.
        unsafe {
            let values = values.as_ptr().add(at);
            corners[0][i] = values.read_volatile();
            corners[1][i] = values.add(right).read_volatile();
            corners[2][i] = values.add(below).read_volatile();
            corners[3][i] = values.add(below + right).read_volatile();
        }
    }
    let (scale, offset) = (affine.scale * 255.0, affine.offset * 255.0);
    let mut levels = [0u8; LANES];
    for i in 0..LANES {
        let x = real(u32::from(next[i] & 0xff)) * (1.0 / PARTS as f32);
        let y = real(u32::from(next[i] >> 8)) * (1.0 / PARTS as f32);
        let upper = corners[0][i] + x * (corners[1][i] - corners[0][i]);
        let lower = corners[2][i] + x * (corners[3][i] - corners[2][i]);
        let mean = upper + y * (lower - upper);
        let level = at_most(at_least(mean * scale + offset + added[i], 0.0), 255.0);
        levels[i] = nearest_bits(level) as u8;
    }
    levels
}

fn fill<T: Send + Default + Clone>(
    plane: &mut Vec<T>,
    to_grid: &[Corners],
    given: bool,
    value: impl Fn(&Corners) -> T + Sync,
) {
    plane.resize(if given { to_grid.len() } else { 0 }, T::default());
    let chunks = plane.par_chunks_mut(1 << 14).zip(to_grid.par_chunks(1 << 14));
    chunks.for_each(|(plane, to_grid)| {
        for (target, corners) in plane.iter_mut().zip(to_grid) {
            *target = value(corners);
        }
    });
}

/// A picture's size and the geometry of its scanlines.
struct Picture<'a> {
    geometry: &'a ScanGeometry,
    width: usize,
    height: usize,
}

impl Picture<'_> {
    /// Pixels around the point at `depth_mm` and at `fraction` (0 to 1) of the lateral extent. All weights are 0
    /// outside the sector.
    fn corners(&self, fraction: f64, depth_mm: f64) -> Corners {
        if depth_mm >= self.geometry.depth_mm {
            return Corners::default();
        }
        let at = self.geometry.pixel_at(fraction, depth_mm);
        // Clamped so that all four pixels are in the picture.
        let [left, top] = [(at.x, self.width), (at.y, self.height)]
            .map(|(position, side)| position.floor().clamp(0.0, side.saturating_sub(2) as f64));
        let [x, y] = [at.x - left, at.y - top].map(|part| part.clamp(0.0, 1.0));
        let shares = [(1.0 - x) * (1.0 - y), x * (1.0 - y), (1.0 - x) * y, x * y];
        let offsets = [(0, 0), (1, 0), (0, 1), (1, 1)];
        let (left, top) = (left as u32, top as u32);
        let inside = offsets.map(|(right, below)| self.geometry.beam_at(left + right, top + below).is_some());
        let shown: f64 = shares.iter().zip(inside).map(|(share, inside)| if inside { *share } else { 0.0 }).sum();
        if shown <= 0.0 {
            return Corners::default();
        }
        let mut weights = [0; 4];
        for ((weight, share), inside) in weights.iter_mut().zip(shares).zip(inside) {
            *weight = if inside { (f64::from(PARTS) * share / shown).round() as u16 } else { 0 };
        }
        let heaviest = (0..4).max_by_key(|&i| weights[i]).unwrap_or(0);
        // The largest weight absorbs the rounding error of the sum.
        let others: u16 = weights.iter().sum::<u16>() - weights[heaviest];
        weights[heaviest] = PARTS as u16 - others;
        let (right, below) = offsets[heaviest];
        let width = self.width as u32;
        Corners { first: top * width + left, weights, nearest: below * width + right }
    }

    /// First column of a picture row inside the sector, and entries of [`Cells`] (positions and weights) for the pixels
    /// from there to the last one inside.
    fn row(&self, row: usize, grid: &BeamGrid, [scanlines, cells]: [usize; 2]) -> (usize, Vec<(u32, u16)>) {
        let beam = |column: usize| self.geometry.beam_at(column as u32, row as u32);
        let Some(first) = (0..self.width).find(|&column| beam(column).is_some()) else {
            return (0, Vec::new());
        };
        let last = (first..self.width).rev().find(|&column| beam(column).is_some()).unwrap_or(first);
        let split = |position: f64, count: usize| {
            let position = position.clamp(0.0, (count - 1) as f64);
            let parts = (position * f64::from(PARTS)).round() as u32;
            (parts / PARTS, (parts % PARTS) as u16)
        };
        let cell = |column: usize| {
            // The row's span may contain pixels outside the sector, at the arc of the face. The mask excludes them.
            let Some((fraction, depth_mm)) = beam(column) else { return (0, 0) };
            let (scanline, x) = split(fraction * scanlines as f64 - 0.5, scanlines);
            let (cell, y) = split(depth_mm / grid.cell_mm - 0.5, cells);
            (scanline | cell << 16, x | y << 8)
        };
        (first, (first..=last).map(cell).collect())
    }
}

#[cfg(test)]
mod tests;
