//! Difference between local mean levels. Averaging over patches removes speckle from it.

use super::{Pair, QualityError};

/// Mean magnitude of the difference between mean grey levels, over patches of 32 × 32 pixels.
///
/// Two frames with the same tissues and different speckle differ much per pixel, but little in this measure. Patches
/// and mask work as in [`pkl`](fn@super::pkl).
///
/// # Errors
/// Errors of [`pkl`](fn@super::pkl).
pub fn level_difference(pair: &Pair<'_>) -> Result<f64, QualityError> {
    let [magnitude] = pair.mean_over_patches("the difference of levels", |indices| {
        let difference = |&i: &usize| i64::from(pair.image[i]) - i64::from(pair.reference[i]);
        let mean = indices.iter().map(difference).sum::<i64>() as f64 / indices.len() as f64;
        [mean.abs()]
    })?;
    Ok(magnitude)
}

#[cfg(test)]
mod tests {
    use super::*;

    #[test]
    fn shuffled_pixels_do_not_count_and_levels_do() {
        let of = |a: &[u8], b: &[u8], mask: Option<&[u8]>| level_difference(&Pair::new([64, 40], a, b, mask).unwrap());
        let a: Vec<u8> = (0..64 * 40).map(|i| (i % 2 * 100) as u8).collect();
        let b: Vec<u8> = (0..64 * 40).map(|i| ((i + 1) % 2 * 100) as u8).collect();
        assert_eq!(of(&a, &b, None), Ok(0.0));
        let right = |i: usize| i % 64 >= 32;
        let c: Vec<u8> = a.iter().enumerate().map(|(i, &v)| v + if right(i) { 8 } else { 0 }).collect();
        assert_eq!(of(&c, &a, None), Ok(4.0));
        let mask: Vec<u8> = (0..64 * 40).map(|i| u8::from(right(i))).collect();
        assert_eq!(of(&a, &c, Some(&mask)), Ok(8.0));
        assert!(level_difference(&Pair::new([40, 31], &a[..1240], &b[..1240], None).unwrap()).is_err());
        let mut few = vec![0; 64 * 40];
        few[0] = 1;
        assert_eq!(of(&a, &b, Some(&few)), Err(QualityError::NoPatch { patch: 32 }));
    }
}
