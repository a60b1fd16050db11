//! Marks the needle's cross-section in the segmentation.

use insonify_core::simd::widened_to_eight;
use rayon::prelude::*;

use crate::host::constants::ImageConstants;
use crate::needle::Outline;

/// Least number of rows per task.
const ROWS: usize = 32;

/// Marks pixels of `segmentation` [height × width] inside the sector.
pub(in crate::host) fn needle_map(constants: ImageConstants, outline: &Outline, width: u32, segmentation: &mut [u8]) {
    let outline = Outline { radius_mm: constants.needle_radius() * outline.radius_mm, ..*outline };
    let ([first_column, first_row], [columns, rows]) = (outline.first, outline.size);
    let end_column = (first_column + columns).min(width);
    let marked = segmentation.par_chunks_exact_mut(width as usize).enumerate();
    marked.skip(first_row as usize).take(rows as usize).with_min_len(ROWS).for_each(|(row, pixels)| {
        let columns = outline.columns(row as u32, first_column..end_column);
        if let Some(pixels) = pixels.get_mut(columns.start as usize..columns.end as usize) {
            mark(&outline, [columns.start, row as u32], pixels);
        }
    });
}

widened_to_eight! {
    /// Marks `pixels` of a row. The first one is at `[column, row]`.
    fn mark(outline: &Outline, at: [u32; 2], pixels: &mut [u8]) = mark_body
}

#[inline(always)]
fn mark_body(outline: &Outline, [first, row]: [u32; 2], pixels: &mut [u8]) {
    for (column, pixel) in (first..).zip(pixels) {
        // Branch-free, so that the loop is vectorised.
        let marked = (*pixel != 0) & outline.covers(column, row);
        *pixel = if marked { outline.tissue as u8 } else { *pixel };
    }
}
