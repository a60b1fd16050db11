//! An angle's picture as 16-bit codes of amplitude, with a border of zeros.

use rayon::prelude::*;

/// Neighbouring pixels that are read at a common displacement. If the probe turns by 5 degrees, the ends of a block are
/// off by 0.3 pixels.
pub(super) const BLOCK: usize = 8;
/// A code is the upper bits of an f32 amplitude: 11 bits of mantissa, and 32 octaves below 1.
const SHIFT: u32 = 12;
const OFFSET: u32 = (1f32.to_bits() >> SHIFT) - u16::MAX as u32;
/// Rows of the picture per task.
const ROWS: usize = 16;

/// Code of each grey level, for a dynamic range in dB.
pub(super) fn of_levels(dynamic_range_db: f64) -> [u16; 256] {
    std::array::from_fn(|level| {
        let amplitude = 10f64.powf((level as f64 / 255.0 - 1.0) * dynamic_range_db / 20.0);
        // The nearest code, at least 1; 0 stands for pixels that are not shown.
        let bits = (amplitude as f32).to_bits() + (1 << (SHIFT - 1));
        (bits >> SHIFT).saturating_sub(OFFSET).clamp(1, u16::MAX.into()) as u16
    })
}

/// Amplitude of a code, 0..=1.
#[inline(always)]
pub(super) fn amplitude(code: u16) -> f32 {
    f32::from_bits((u32::from(code) + OFFSET) << SHIFT)
}

/// A picture as codes; 0 where the angle shows nothing.
#[derive(Debug)]
pub(super) struct Codes {
    codes: Vec<u16>,
    width: usize,
    height: usize,
}

impl Codes {
    /// A picture that shows nothing.
    pub(super) fn new(width: usize, height: usize) -> Self {
        Self { codes: vec![0; Self::stride(width) * (height + 2)], width, height }
    }

    /// Codes per row: a block to the left of the picture, and two to its right.
    fn stride(width: usize) -> usize {
        BLOCK + width + 2 * BLOCK
    }

    /// Stores a picture of grey levels at the pixels that the angle shows: where `covered` has the bit `bit`.
    pub(super) fn set(&mut self, picture: &[u8], covered: &[u16], bit: u16, of_levels: &[u16; 256]) {
        let (width, stride) = (self.width, Self::stride(self.width));
        let rows = self.codes[stride..].par_chunks_mut(ROWS * stride);
        let rows = rows.zip(picture.par_chunks(ROWS * width)).zip(covered.par_chunks(ROWS * width));
        rows.for_each(|((codes, picture), covered)| {
            let rows = codes.chunks_mut(stride).zip(picture.chunks(width)).zip(covered.chunks(width));
            for ((codes, picture), covered) in rows {
                for ((code, level), covered) in codes[BLOCK..].iter_mut().zip(picture).zip(covered) {
                    *code = if covered & bit == 0 { 0 } else { of_levels[usize::from(*level)] };
                }
            }
        });
    }

    /// Codes from a pixel on; empty outside the picture and its border.
    #[inline(always)]
    pub(super) fn from(&self, column: i64, row: i64) -> &[u16] {
        if column < -(BLOCK as i64) || column >= self.width as i64 || row < -1 || row >= self.height as i64 {
            return &[];
        }
        let start = (row + 1) as usize * Self::stride(self.width) + (column + BLOCK as i64) as usize;
        self.codes.get(start..).unwrap_or(&[])
    }

    /// Blocks of codes from a pixel on, from its right neighbour on, and from the two pixels below; `None` outside the
    /// picture and its border.
    #[inline(always)]
    pub(super) fn corners(&self, column: i64, row: i64) -> Option<[&[u16; BLOCK]; 4]> {
        let codes = self.from(column, row);
        let below = codes.get(Self::stride(self.width)..)?;
        Some([
            codes.first_chunk()?,
            codes.get(1..)?.first_chunk()?,
            below.first_chunk()?,
            below.get(1..)?.first_chunk()?,
        ])
    }
}
