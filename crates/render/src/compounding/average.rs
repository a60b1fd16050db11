//! Weighted mean of the pictures of all angles, at the present picture's pixels.

use insonify_core::simd::{at_least, at_most, log2, nearest_bits, widened};

use super::codes::{BLOCK, Codes, amplitude};
use super::registration::Registration;
use crate::angle_order::ACROSS_SIGMA_MM;

/// Pixels of a row that are summed at once.
const SEGMENT: usize = 64 * BLOCK;
/// Blocks in a segment.
const BLOCKS: usize = SEGMENT / BLOCK;
/// Displacements are rounded to this fraction of a pixel.
const PARTS: i32 = 256;
/// Coefficient 1/8σ², 1/mm². The weight (1 − y²/8σ²)⁸ at a distance y from the slice is close to exp(−y²/σ²) for small
/// y, and 0 at √8 σ.
const PER_MM2: f32 = (1.0 / (8.0 * ACROSS_SIGMA_MM * ACROSS_SIGMA_MM)) as f32;
/// Eighth root of the least weight. Above 0, so that pictures off the slice fill pixels that no other picture shows.
const WEIGHT_ROOT_MIN: f32 = 0.2;
const AMPLITUDE_MIN: f32 = 1.0e-30;
/// Columns of a block's pixels, counted from its first.
const PLACES: [f32; BLOCK] = [0.0, 1.0, 2.0, 3.0, 4.0, 5.0, 6.0, 7.0];

/// An angle that the mean includes, and its registration.
#[derive(Debug, Clone, Copy)]
pub(super) struct Source {
    pub(super) angle: usize,
    pub(super) registration: Registration,
}

/// Data from which rows of the mean are computed.
#[derive(Debug, Clone, Copy)]
pub(super) struct View<'a> {
    pub(super) angles: &'a [Codes],
    pub(super) sources: &'a [Source],
    /// Whether a picture of the straight angle, the last one, is stored.
    pub(super) straight: bool,
    /// 255 inside the sector [height × width].
    pub(super) mask: &'a [u8],
    /// First column inside the sector and first one beyond it, for each row.
    pub(super) spans: &'a [[usize; 2]],
    pub(super) width: usize,
    /// Grey levels per doubling of the amplitude.
    pub(super) levels_per_octave: f32,
}

widened! {
    /// Computes rows of the mean, grey levels, from `first_row` on.
    pub(super) fn average_rows(view: &View<'_>, first_row: usize, picture: &mut [u8]) = average_rows_body
}

// Plain loops: a closure would be compiled without AVX2.
#[inline(always)]
fn average_rows_body(view: &View<'_>, first_row: usize, picture: &mut [u8]) {
    for (i, line) in picture.chunks_exact_mut(view.width).enumerate() {
        let row = first_row + i;
        line.fill(0);
        let (Some(&[begin, end]), Some(mask)) = (view.spans.get(row), view.mask.get(row * view.width..)) else {
            return;
        };
        let mut column = begin / BLOCK * BLOCK;
        while column < end {
            let mut sums = [0.0; SEGMENT];
            let mut weights = [0.0; SEGMENT];
            let pixels = (end - column).min(SEGMENT);
            let blocks = pixels.div_ceil(BLOCK);
            for source in view.sources {
                if let Some(codes) = view.angles.get(source.angle) {
                    accumulate(codes, &source.registration, [column, row], blocks, &mut sums, &mut weights);
                }
            }
            let straight = view.angles.last().map_or(&[][..], |codes| codes.from(column as i64, row as i64));
            let inside = line[column..].iter_mut().zip(&mask[column..]).zip(straight);
            for (((level, mask), straight), (sum, weight)) in inside.zip(sums.iter().zip(&weights)) {
                // A pixel that no included angle shows gets the straight angle's pixel, without registration.
                let alone = if view.straight { amplitude(*straight) } else { 0.0 };
                let mean = if *weight > 0.0 { sum / weight } else { alone };
                let shown = 255.0 + view.levels_per_octave * log2(at_least(mean, AMPLITUDE_MIN));
                *level = nearest_bits(at_most(at_least(shown, 0.0), 255.0)) as u8 & mask;
            }
            column += SEGMENT;
        }
    }
}

/// Adds an angle's amplitudes and weights to the sums of `blocks` blocks of pixels, from a column and row on.
#[inline(always)]
fn accumulate(
    codes: &Codes,
    registration: &Registration,
    [column, row]: [usize; 2],
    blocks: usize,
    sums: &mut [f32; SEGMENT],
    weights: &mut [f32; SEGMENT],
) {
    let Registration { origin, per_column, per_row, across_mm } = registration;
    let row_start = *origin + row as f64 * *per_row;
    let row_across_mm = across_mm[0] + row as f64 * across_mm[2];
    let across_step_mm = across_mm[1] as f32;
    // Positions of the blocks in the angle's picture, in parts of a pixel. A block is displaced like its middle.
    let (mut lefts, mut tops) = ([0i32; BLOCKS], [0i32; BLOCKS]);
    let middle = 0.5 * (BLOCK - 1) as f64;
    // Wrapping: overflow checks would keep the loop scalar. Columns are small.
    for block in 0..BLOCKS {
        let first = (column.wrapping_add(BLOCK.wrapping_mul(block))) as f64;
        let at = row_start + (first + middle) * *per_column;
        lefts[block] = nearest((at.x - middle) * f64::from(PARTS));
        tops[block] = nearest(at.y * f64::from(PARTS));
    }
    let (sums, weights) = (sums.as_chunks_mut::<BLOCK>().0, weights.as_chunks_mut::<BLOCK>().0);
    for (block, (sums, weights)) in sums.iter_mut().zip(weights).enumerate().take(blocks) {
        let first = (column.wrapping_add(BLOCK.wrapping_mul(block))) as f64;
        let (left, right_part) = (lefts[block].div_euclid(PARTS), lefts[block].rem_euclid(PARTS));
        let (top, lower_part) = (tops[block].div_euclid(PARTS), tops[block].rem_euclid(PARTS));
        let (right_part, lower_part) = (right_part as f32 / PARTS as f32, lower_part as f32 / PARTS as f32);
        let Some(corners) = codes.corners(left.into(), top.into()) else { continue };
        let parts = [
            (1.0 - right_part) * (1.0 - lower_part),
            right_part * (1.0 - lower_part),
            (1.0 - right_part) * lower_part,
            right_part * lower_part,
        ];
        let mut least = [u16::MAX; BLOCK];
        for corner in corners {
            for k in 0..BLOCK {
                least[k] = least[k].min(corner[k]);
            }
        }
        let (mut sum, mut weight) = ([0.0; BLOCK], [0.0; BLOCK]);
        if least.iter().fold(u16::MAX, |a, &b| a.min(b)) > 0 {
            // The angle shows all pixels. Sums are in the same order as below.
            for k in 0..BLOCK {
                sum[k] = parts[0] * amplitude(corners[0][k]);
                sum[k] += parts[1] * amplitude(corners[1][k]);
                sum[k] += parts[2] * amplitude(corners[2][k]);
                sum[k] += parts[3] * amplitude(corners[3][k]);
            }
            weight = [parts[0] + parts[1] + parts[2] + parts[3]; BLOCK];
        } else {
            for (corner, part) in corners.into_iter().zip(parts) {
                for ((code, sum), weight) in corner.iter().zip(&mut sum).zip(&mut weight) {
                    // Pixels that the angle doesn't show have no weight.
                    let shown = if *code > 0 { part } else { 0.0 };
                    *sum += shown * amplitude(*code);
                    *weight += shown;
                }
            }
        }
        let first_mm = (row_across_mm + first * across_mm[1]) as f32;
        // The sums of a block are written together. In place, they would be computed one by one: the compiler can't tell
        // that the two arrays lie apart.
        let (mut block_sums, mut block_weights) = (*sums, *weights);
        for k in 0..BLOCK {
            let y_mm = first_mm + PLACES[k] * across_step_mm;
            let near = at_least(1.0 - PER_MM2 * (y_mm * y_mm), WEIGHT_ROOT_MIN);
            let fourth = (near * near) * (near * near);
            let near = fourth * fourth;
            block_sums[k] += near * sum[k];
            block_weights[k] += near * weight[k];
        }
        (*sums, *weights) = (block_sums, block_weights);
    }
}

/// The integer nearest to `x`, half to even, for |x| below 2³⁰.
#[inline(always)]
fn nearest(x: f64) -> i32 {
    /// 1.5·2⁵²: between 2⁵² and 2⁵³, neighbouring f64 are 1 apart, so the lowest bits of a sum are the integer.
    const TO_INTEGER: f64 = 6_755_399_441_055_744.0;
    (x + TO_INTEGER).to_bits() as u32 as i32
}
