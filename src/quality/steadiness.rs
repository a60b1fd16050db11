//! Steadiness of frames while the probe moves: changes between two frames that the motion does not explain.

use serde::{Deserialize, Serialize};

use super::error::check_sizes;
use super::{Pair, QualityError, level_difference};
use crate::statistics;

/// Mean magnitude of the difference between `after` and the shifted `before`, grey levels. Pixel (c, r) of `before`
/// is compared with pixel (c + `shift`\[0\], r + `shift`\[1\]) of `after`, if both are inside `mask` [height × width]
/// (not 0). A picture that moves as a whole by `shift` (columns, rows) has 0.
///
/// # Errors
/// The maps have different sizes, or the shift leaves no pixel inside both.
pub fn shifted_difference(
    before: &[u8],
    after: &[u8],
    mask: &[u8],
    size @ [width, height]: [usize; 2],
    shift: [isize; 2],
) -> Result<f64, QualityError> {
    check_sizes(size, &[("frame before", before), ("frame after", after), ("mask", mask)])?;
    let (mut sum, mut pixels) = (0u64, 0u64);
    for row in 0..height {
        let Some(to) = row.checked_add_signed(shift[1]).filter(|&to| to < height) else { continue };
        for column in 0..width {
            let Some(to_column) = column.checked_add_signed(shift[0]).filter(|&to| to < width) else { continue };
            let (from, to) = (row * width + column, to * width + to_column);
            if mask[from] > 0 && mask[to] > 0 {
                sum += u64::from(before[from].abs_diff(after[to]));
                pixels += 1;
            }
        }
    }
    if pixels == 0 { Err(QualityError::EmptyMask) } else { Ok(sum as f64 / pixels as f64) }
}

/// Flicker without speckle: mean magnitude of [`level_difference`] between `after` and the shifted `before`, grey
/// levels. Speckle decorrelates as the probe moves, and a smooth picture has none. Pixels are compared as in
/// [`shifted_difference`].
///
/// # Errors
/// The maps have different sizes, the frames are smaller than a patch, or the shift leaves no patch.
pub fn shifted_level_difference(
    before: &[u8],
    after: &[u8],
    mask: &[u8],
    size @ [width, height]: [usize; 2],
    shift: [isize; 2],
) -> Result<f64, QualityError> {
    check_sizes(size, &[("frame before", before), ("frame after", after), ("mask", mask)])?;
    // `after`, shifted back onto `before`.
    let mut back = vec![0; after.len()];
    let mut both = vec![0; after.len()];
    for (index, (back, both)) in back.iter_mut().zip(&mut both).enumerate() {
        let column = (index % width).checked_add_signed(shift[0]).filter(|&to| to < width);
        let row = (index / width).checked_add_signed(shift[1]).filter(|&to| to < height);
        if let (Some(column), Some(row)) = (column, row)
            && mask[index] > 0
            && mask[row * width + column] > 0
        {
            (*back, *both) = (after[row * width + column], 255);
        }
    }
    level_difference(&Pair::new(size, &back, before, Some(&both))?)
}

/// Steadiness of a sequence, also relative to its target sequence.
#[derive(Debug, Clone, Copy, PartialEq, Serialize, Deserialize)]
pub struct Steadiness {
    /// Mean of [`shifted_difference`] over neighbouring frames, grey levels.
    pub difference: f64,
    /// Mean of [`shifted_level_difference`] over neighbouring frames, grey levels: flicker of areas.
    pub level_difference: f64,
    /// Mean of the unshifted difference over neighbouring frames, grey levels: the change that a viewer sees.
    pub unwarped_difference: f64,
    /// `difference` divided by the target's: 1 is as steady as the target, a higher value flickers more. A lower
    /// value is steadier, or has less texture.
    pub over_target: f64,
    /// `level_difference` divided by the target's.
    pub level_over_target: f64,
}

impl Steadiness {
    /// Steadiness of `frames` [height × width], whose content moves by `shift` (columns, rows) per frame, relative to
    /// `target`.
    ///
    /// # Errors
    /// Errors of [`shifted_difference`]; or there are fewer than two frames.
    pub fn of(
        frames: &[Vec<u8>],
        target: &[Vec<u8>],
        mask: &[u8],
        size: [usize; 2],
        shift: [isize; 2],
    ) -> Result<Self, QualityError> {
        let pixels = |a: &[u8], b: &[u8]| shifted_difference(a, b, mask, size, shift);
        let levels = |a: &[u8], b: &[u8]| shifted_level_difference(a, b, mask, size, shift);
        let (difference, level_difference) = (mean(frames, pixels)?, mean(frames, levels)?);
        Ok(Self {
            difference,
            level_difference,
            unwarped_difference: mean(frames, |a, b| shifted_difference(a, b, mask, size, [0, 0]))?,
            over_target: difference / mean(target, pixels)?,
            level_over_target: level_difference / mean(target, levels)?,
        })
    }
}

fn mean(
    frames: &[Vec<u8>],
    difference: impl Fn(&[u8], &[u8]) -> Result<f64, QualityError>,
) -> Result<f64, QualityError> {
    let steps = frames.array_windows().map(|[a, b]| difference(a, b));
    let steps = steps.collect::<Result<Vec<f64>, QualityError>>()?;
    statistics::mean(steps).ok_or(QualityError::FewFrames { found: frames.len() })
}

#[cfg(test)]
mod tests {
    use super::*;

    const SIZE: [usize; 2] = [90, 50];

    /// A texture that is fixed in the scene, seen through a window that is displaced by `moved`.
    fn seen(moved: [isize; 2], noise: u32) -> Vec<u8> {
        let hash = |x: isize, y: isize, salt: u32| {
            let n = (x as u32).wrapping_mul(0x9e37_79b1) ^ (y as u32).wrapping_mul(0x85eb_ca77);
            let n = n ^ salt.wrapping_mul(0x68e3_1da4);
            let n = (n ^ (n >> 16)).wrapping_mul(0x7feb_352d);
            (n ^ (n >> 15)).wrapping_mul(0x846c_a68b) >> 24
        };
        let at = |i: isize| {
            let (x, y) = (i % 90 + moved[0], i / 90 + moved[1]);
            let grain = if noise == 0 { 0 } else { hash(i, 0, noise) % 16 };
            (hash(x, y, 7) % 200 + grain) as u8
        };
        (0..90 * 50).map(at).collect()
    }

    #[test]
    fn a_picture_that_moves_as_a_whole_has_no_difference() {
        let mask = vec![255; 90 * 50];
        for moved in [[3, 0], [-4, 2], [0, 0]] {
            let frames: Vec<_> = (0..5).map(|i| seen([i * moved[0], i * moved[1]], 0)).collect();
            let shift = moved.map(|v| -v);
            let found = Steadiness::of(&frames, &seen_with_noise(moved), &mask, SIZE, shift).unwrap();
            assert_eq!((found.difference, found.over_target), (0.0, 0.0), "{moved:?}");
            assert_eq!((found.level_difference, found.level_over_target), (0.0, 0.0), "{moved:?}");
            assert_eq!(found.unwarped_difference > 20.0, moved != [0, 0]);
        }
    }

    fn seen_with_noise(moved: [isize; 2]) -> Vec<Vec<u8>> {
        (0..5).map(|i| seen([i * moved[0], i * moved[1]], 1 + i as u32)).collect()
    }

    #[test]
    fn flicker_is_what_the_motion_does_not_explain() {
        let mask = vec![255; 90 * 50];
        let noisy = seen_with_noise([3, 0]);
        let found = Steadiness::of(&noisy, &noisy, &mask, SIZE, [-3, 0]).unwrap();
        // The mean difference between two random numbers in 0..16.
        assert!((found.difference - 85.0 / 16.0).abs() < 0.2 && found.over_target == 1.0, "{found:?}");
        // The grain averages out over a patch, but a rise of the level by 6 does not.
        assert!(found.level_difference < 0.6, "{found:?}");
        let rising: Vec<Vec<u8>> =
            (0..4).map(|i| seen([3 * i, 0], 0).iter().map(|&v| v + 6 * i as u8).collect()).collect();
        let found = Steadiness::of(&rising, &noisy, &mask, SIZE, [-3, 0]).unwrap();
        assert_eq!((found.difference, found.level_difference), (6.0, 6.0));
        assert!(found.level_over_target > 10.0, "{found:?}");
    }

    #[test]
    fn only_what_is_inside_in_both_counts() {
        let (before, mut after) = ([10, 20, 30, 40], [20, 30, 40, 99]);
        let of = |after: &[u8], mask: &[u8], shift| shifted_difference(&before, after, mask, [4, 1], [shift, 0]);
        assert_eq!(of(&after, &[1; 4], -1), Ok(0.0));
        after[1] = 36;
        assert_eq!(of(&after, &[1; 4], -1), Ok(2.0));
        assert_eq!(of(&after, &[1, 0, 1, 1], -1), Ok(0.0));
        assert_eq!(of(&after, &[1; 4], 4), Err(QualityError::EmptyMask));
        assert!(of(&after[1..], &[1; 4], 0).is_err());
        let one = [before.to_vec()];
        let few = Steadiness::of(&one, &one, &[1; 4], [4, 1], [0, 0]);
        assert_eq!(few, Err(QualityError::FewFrames { found: 1 }));
    }
}
