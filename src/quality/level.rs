//! Difference of local mean levels: what is left of a difference when speckle is averaged out.

use super::{Pair, QualityError};

/// Side of the patches whose means are compared, pixels.
const PATCH: usize = 32;

/// Mean magnitude and root mean square of the difference of mean grey levels over patches of 32 × 32.
///
/// Two frames with the same tissues and other speckle differ much pixel by pixel, and little here. Patches and mask are
/// those of [`pkl`](fn@super::pkl).
///
/// # Errors
/// As [`pkl`](fn@super::pkl).
pub fn level_difference(pair: &Pair<'_>) -> Result<[f64; 2], QualityError> {
    let (width, height) = (pair.width, pair.height);
    if width < PATCH || height < PATCH {
        return Err(QualityError::TooSmall { metric: "the difference of levels", needed: PATCH, width, height });
    }
    let (mut sum, mut squares, mut patches) = (0.0, 0.0, 0u32);
    for top in (0..=height - PATCH).step_by(PATCH) {
        for left in (0..=width - PATCH).step_by(PATCH) {
            let (mut difference, mut pixels) = (0i64, 0usize);
            let rows = (top..top + PATCH).map(|row| row * width + left);
            for index in rows.flat_map(|start| start..start + PATCH).filter(|&index| pair.inside(index)) {
                difference += i64::from(pair.image[index]) - i64::from(pair.reference[index]);
                pixels += 1;
            }
            if 2 * pixels >= PATCH * PATCH {
                let mean = difference as f64 / pixels as f64;
                sum += mean.abs();
                squares += mean * mean;
                patches += 1;
            }
        }
    }
    let n = f64::from(patches);
    if patches == 0 { Err(QualityError::NoPatch { patch: PATCH }) } else { Ok([sum / n, (squares / n).sqrt()]) }
}

#[cfg(test)]
mod tests {
    use super::*;

    #[test]
    fn shuffled_pixels_do_not_count_and_levels_do() {
        let of = |a: &[u8], b: &[u8], mask: Option<&[u8]>| level_difference(&Pair::new([64, 40], a, b, mask).unwrap());
        let a: Vec<u8> = (0..64 * 40).map(|i| (i % 2 * 100) as u8).collect();
        let b: Vec<u8> = (0..64 * 40).map(|i| ((i + 1) % 2 * 100) as u8).collect();
        assert_eq!(of(&a, &b, None), Ok([0.0; 2]));
        let right = |i: usize| i % 64 >= 32;
        let c: Vec<u8> = a.iter().enumerate().map(|(i, &v)| v + if right(i) { 8 } else { 0 }).collect();
        assert_eq!(of(&c, &a, None), Ok([4.0, 32f64.sqrt()]));
        let mask: Vec<u8> = (0..64 * 40).map(|i| u8::from(right(i))).collect();
        assert_eq!(of(&a, &c, Some(&mask)), Ok([8.0; 2]));
        assert!(level_difference(&Pair::new([40, 31], &a[..1240], &b[..1240], None).unwrap()).is_err());
        let mut few = vec![0; 64 * 40];
        few[0] = 1;
        assert_eq!(of(&a, &b, Some(&few)), Err(QualityError::NoPatch { patch: 32 }));
    }
}
