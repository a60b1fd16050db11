//! Error that an eye sees: differences of local levels, and of the strength of the texture within them.

use serde::{Deserialize, Serialize};

use super::error::check_holds;
use super::{PATCH, Pair, QualityError};

/// Side of a block whose mean level is compared, pixels. A patch holds 2 × 2 blocks.
const BLOCK: usize = 16;

/// Error that an eye sees, grey levels.
#[derive(Debug, Clone, Copy, Default, PartialEq, Serialize, Deserialize)]
#[serde(deny_unknown_fields)]
pub struct SeenError {
    /// Root of the sum of squares of both parts, grey levels.
    pub whole: f64,
    /// RMS difference of the mean levels of blocks of 16 × 16 pixels, grey levels.
    pub levels: f64,
    /// RMS difference of the standard deviations of the detail within blocks, over patches of 32 × 32 pixels, grey
    /// levels.
    pub texture: f64,
}

/// Sums over a block's pixels inside the mask, of the image and of the reference.
#[derive(Debug, Clone, Copy, Default)]
struct Block {
    inside: u32,
    sums: [u32; 2],
    squares: [u32; 2],
}

impl Block {
    fn add(&mut self, levels: [u8; 2]) {
        self.inside += 1;
        for (which, level) in levels.map(u32::from).into_iter().enumerate() {
            self.sums[which] += level;
            self.squares[which] += level * level;
        }
    }

    fn mean(&self, which: usize) -> f64 {
        f64::from(self.sums[which]) / f64::from(self.inside)
    }

    /// Sum of the squared differences from the block's mean; 0 without pixels.
    fn detail(&self, which: usize) -> f64 {
        if self.inside == 0 {
            0.0
        } else {
            f64::from(self.squares[which]) - f64::from(self.sums[which]) * self.mean(which)
        }
    }
}

/// Error that an eye sees, in two parts.
///
/// The square of the pixels' error is that of the means of blocks, plus that of the detail within blocks. Speckle's
/// detail differs between any two looks, so only its strength counts. The part of texture compares the standard
/// deviation of the detail, patch by patch. The training computes the same (`seen_error` in
/// `training/insonify_training/quality.py`).
///
/// Blocks and patches do not overlap, and begin at the upper left corner. Incomplete patches at the right and bottom
/// edges are ignored. With a mask, only pixels inside count, and only in blocks and patches with at least half of their
/// pixels inside.
///
/// # Errors
/// The image is smaller than a patch, or the mask leaves no patch.
pub fn seen_error(pair: &Pair<'_>) -> Result<SeenError, QualityError> {
    check_holds([pair.width, pair.height], PATCH, "the seen error")?;
    let (mut levels, mut texture) = (MeanSquare::default(), MeanSquare::default());
    for top in (0..=pair.height - PATCH).step_by(PATCH) {
        for left in (0..=pair.width - PATCH).step_by(PATCH) {
            let blocks = [[0, 0], [0, BLOCK], [BLOCK, 0], [BLOCK, BLOCK]]
                .map(|[down, right]| block(pair, top + down, left + right));
            let counted = |inside: u32, side: usize| 2 * inside as usize >= side * side;
            for block in blocks.iter().filter(|block| counted(block.inside, BLOCK)) {
                levels.add(block.mean(0) - block.mean(1));
            }
            let inside = blocks.iter().map(|block| block.inside).sum();
            if counted(inside, PATCH) {
                let [image, reference] = [0, 1].map(|which| {
                    let detail: f64 = blocks.iter().map(|block| block.detail(which)).sum();
                    (detail / f64::from(inside)).sqrt()
                });
                texture.add(image - reference);
            }
        }
    }
    // A patch that counts has a block that counts.
    let (Some(levels), Some(texture)) = (levels.value(), texture.value()) else {
        return Err(QualityError::NoPatch { patch: PATCH });
    };
    Ok(SeenError { whole: (levels + texture).sqrt(), levels: levels.sqrt(), texture: texture.sqrt() })
}

fn block(pair: &Pair<'_>, top: usize, left: usize) -> Block {
    let mut block = Block::default();
    for start in (top..top + BLOCK).map(|row| row * pair.width + left) {
        for index in (start..start + BLOCK).filter(|&index| pair.inside(index)) {
            block.add([pair.image[index], pair.reference[index]]);
        }
    }
    block
}

/// Mean of squares.
#[derive(Debug, Default)]
struct MeanSquare {
    sum: f64,
    count: u32,
}

impl MeanSquare {
    fn add(&mut self, value: f64) {
        self.sum += value * value;
        self.count += 1;
    }

    fn value(&self) -> Option<f64> {
        (self.count > 0).then(|| self.sum / f64::from(self.count))
    }
}

#[cfg(test)]
mod tests {
    use super::*;
    use crate::quality::psnr_db;

    const SIDE: usize = 64;

    fn seen(image: &[u8], reference: &[u8], mask: Option<&[u8]>) -> SeenError {
        seen_error(&Pair::new([SIDE; 2], image, reference, mask).unwrap()).unwrap()
    }

    /// Noise of `deviation` grey levels, about `level`: sums of four uniform numbers.
    fn picture(seed: u32, deviation: f64, level: f64) -> Vec<u8> {
        let mut state = seed;
        let mut uniform = || {
            state = state.wrapping_mul(1_664_525).wrapping_add(1_013_904_223);
            f64::from(state >> 8) / f64::from(1 << 24) - 0.5
        };
        let mut noise = || (0..4).map(|_| uniform()).sum::<f64>() * 3f64.sqrt();
        (0..SIDE * SIDE).map(|_| (level + deviation * noise()).round().clamp(0.0, 255.0) as u8).collect()
    }

    #[test]
    fn another_look_of_the_same_speckle_is_a_small_error() {
        let [a, b] = [1, 2].map(|seed| picture(seed, 25.5, 127.5));
        let SeenError { whole, levels, texture } = seen(&a, &b, None);
        let pixels = 255.0 * 10f64.powf(-psnr_db(&Pair::new([SIDE; 2], &a, &b, None).unwrap()) / 20.0);
        assert!(pixels > 30.0 && whole < 4.0, "{pixels} {whole}");
        assert!((whole - levels.hypot(texture)).abs() < 1e-12);
    }

    #[test]
    fn smoothing_is_an_error_of_texture() {
        let SeenError { whole, levels, texture } = seen(&picture(1, 0.0, 127.5), &picture(2, 25.5, 127.5), None);
        assert!((texture - 25.5).abs() < 1.3 && levels < 3.0 && whole > 25.0, "{whole} {levels} {texture}");
    }

    #[test]
    fn another_level_is_an_error_of_levels() {
        let SeenError { levels, texture, .. } = seen(&picture(1, 25.5, 102.0), &picture(1, 25.5, 127.5), None);
        assert!((levels - 25.5).abs() < 0.5 && texture < 0.5, "{levels} {texture}");
    }

    #[test]
    fn pixels_outside_the_mask_do_not_count() {
        let (reference, mut image) = (picture(1, 25.5, 127.5), picture(1, 25.5, 127.5));
        let mask: Vec<u8> = (0..SIDE * SIDE).map(|i| u8::from(i % SIDE < 40)).collect();
        image.iter_mut().zip(&mask).filter(|(_, inside)| **inside == 0).for_each(|(level, _)| *level = 255);
        assert_eq!(seen(&image, &reference, Some(&mask)), SeenError { whole: 0.0, levels: 0.0, texture: 0.0 });
        assert!(seen(&image, &reference, None).whole > 50.0);
    }

    #[test]
    fn small_images_and_small_masks_are_errors() {
        let few = [0; 31 * 40];
        let small = seen_error(&Pair::new([31, 40], &few, &few, None).unwrap()).unwrap_err();
        assert!(small.to_string().contains("32 x 32") && small.to_string().contains("31 x 40"), "{small}");
        let (image, mut mask) = ([0; 1024], [0; 1024]);
        // A block that counts, in a patch that does not.
        mask[..511].fill(1);
        let of = |mask: &[u8]| seen_error(&Pair::new([32, 32], &image, &image, Some(mask)).unwrap());
        assert_eq!(of(&mask), Err(QualityError::NoPatch { patch: 32 }));
        mask[511] = 1;
        assert_eq!(of(&mask).map(|seen| seen.whole), Ok(0.0));
    }

    /// The values are those of `insonify_training.quality.seen_error` for [1, 1, 70, 101] pictures `image / 255` and
    /// `reference / 255`, with rows y and columns x:
    ///
    /// `image = (7 x + 13 y + 5 (x y mod 31)) mod 256`, `reference = 20 + (3 x + 5 y + 4 (x y mod 29)) mod 200`,
    /// `mask = 2 x + 3 y >= 120`.
    #[test]
    fn it_agrees_with_the_training() {
        let size = [101, 70];
        let map = |of: fn(usize, usize) -> usize| -> Vec<u8> {
            (0..size[0] * size[1]).map(|i| of(i % size[0], i / size[0]) as u8).collect()
        };
        let image = map(|x, y| (7 * x + 13 * y + x * y % 31 * 5) % 256);
        let reference = map(|x, y| (3 * x + 5 * y + x * y % 29 * 4) % 200 + 20);
        let mask = map(|x, y| usize::from(2 * x + 3 * y >= 120));
        for (mask, expected) in
            [(Some(&mask[..]), [28.647673, 20.088415, 20.424122]), (None, [26.291534, 19.093168, 18.074726])]
        {
            let found = seen_error(&Pair::new(size, &image, &reference, mask).unwrap()).unwrap();
            let found = [found.whole, found.levels, found.texture];
            assert!(found.iter().zip(expected).all(|(a, b)| (a - b).abs() < 1e-3), "{found:?}, not {expected:?}");
        }
    }
}
