//! Marks the needle's cross-section in the segmentation.

use crate::host::constants::ImageConstants;
use crate::needle::Outline;

/// Marks pixels of `segmentation` [height × width] inside the sector.
pub(in crate::host) fn needle_map(
    constants: ImageConstants,
    outline: &Outline,
    width: u32,
    height: u32,
    segmentation: &mut [u8],
) {
    let outline = Outline { radius_mm: constants.needle_radius() * outline.radius_mm, ..*outline };
    let ([first_column, first_row], [columns, rows]) = (outline.first, outline.size);
    for row in first_row..(first_row + rows).min(height) {
        let end = (first_column + columns).min(width);
        for column in outline.columns(row, first_column..end) {
            let pixel = &mut segmentation[(row * width + column) as usize];
            if *pixel != 0 && outline.covers(column, row) {
                *pixel = outline.tissue as u8;
            }
        }
    }
}
