//! Number of pixels of one kind in any rectangle, by a summed-area table.

use std::ops::Range;

/// Number of pixels of one kind above and to the left of each pixel corner.
pub(super) struct PixelCounts {
    stride: usize,
    /// Counts at the pixel corners [height + 1 × width + 1].
    sums: Vec<u32>,
}

impl PixelCounts {
    /// A table for images of the size [width, height].
    pub(super) fn new([width, height]: [usize; 2]) -> Self {
        Self { stride: width + 1, sums: vec![0; (width + 1) * (height + 1)] }
    }

    /// Counts the pixels of `map` that satisfy `is_of_kind`.
    pub(super) fn count(&mut self, map: &[u8], is_of_kind: impl Fn(u8) -> bool) {
        let stride = self.stride;
        for (row, values) in map.chunks_exact((stride - 1).max(1)).enumerate() {
            let mut of_row = 0;
            for (column, &value) in values.iter().enumerate() {
                of_row += u32::from(is_of_kind(value));
                self.sums[(row + 1) * stride + column + 1] = self.sums[row * stride + column + 1] + of_row;
            }
        }
    }

    /// Number of pixels of the kind in a rectangle.
    pub(super) fn within(&self, columns: Range<usize>, rows: Range<usize>) -> u32 {
        let at = |column: usize, row: usize| self.sums[row * self.stride + column];
        at(columns.end, rows.end) + at(columns.start, rows.start)
            - at(columns.end, rows.start)
            - at(columns.start, rows.end)
    }
}
