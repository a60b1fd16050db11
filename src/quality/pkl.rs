//! Patch-wise Kullback-Leibler divergence of grey-level histograms.

use super::{Pair, QualityError};

/// Number of bins of a histogram, all of equal width over 0..=255.
pub(crate) const BINS: usize = 50;
/// Number that is added to the count of every bin, so that empty bins have a finite logarithm. Half a pixel is
/// Jeffreys' prior for a multinomial (Krichevsky and Trofimov 1981). Zhang et al. 2020 do not state their value.
pub(crate) const PSEUDO_COUNT: f64 = 0.5;

/// pKL: mean over patches of the divergence D(reference ‖ image) = Σ p·ln(p/q), nats. p is the histogram of the
/// reference's patch, q the histogram of the image's patch. The paper's table shows it × 10².
///
/// Patches have [`PATCH`](super::PATCH) pixels a side, do not overlap, and begin at the upper left corner. Incomplete
/// patches at the right and bottom edges are ignored. With a mask, only pixels inside count, and only in patches with
/// at least half of their pixels inside.
///
/// # Errors
/// The image is smaller than a patch, or the mask leaves no patch.
pub fn pkl(pair: &Pair<'_>) -> Result<f64, QualityError> {
    let [mean] = pair.mean_over_patches("pKL", |indices| [divergence(pair, indices)])?;
    Ok(mean)
}

fn divergence(pair: &Pair<'_>, indices: &[usize]) -> f64 {
    let [mut p, mut q] = [[0u32; BINS]; 2];
    for &index in indices {
        p[bin(pair.reference[index])] += 1;
        q[bin(pair.image[index])] += 1;
    }
    let total = indices.len() as f64 + BINS as f64 * PSEUDO_COUNT;
    let term = |(p, q): (u32, u32)| {
        let [p, q] = [p, q].map(|count| f64::from(count) + PSEUDO_COUNT);
        p / total * (p / q).ln()
    };
    p.into_iter().zip(q).map(term).sum()
}

fn bin(level: u8) -> usize {
    (usize::from(level) * BINS / 255).min(BINS - 1)
}

#[cfg(test)]
mod tests {
    use super::*;

    #[test]
    fn bins_are_even_and_the_last_holds_white() {
        let mut counts = [0; BINS];
        (0..=255).for_each(|level| counts[bin(level)] += 1);
        assert!(counts.iter().all(|c| (5..=6).contains(c)), "{counts:?}");
        assert_eq!((bin(0), bin(5), bin(6), bin(254), bin(255)), (0, 0, 1, 49, 49));
    }

    #[test]
    fn equal_histograms_are_0_wherever_their_pixels_are() {
        let a: Vec<u8> = (0..32 * 32).map(|i| (i % 256) as u8).collect();
        let b: Vec<u8> = a.iter().rev().copied().collect();
        assert_eq!(pkl(&Pair::new([32, 32], &a, &b, None).unwrap()), Ok(0.0));
    }

    #[test]
    fn empty_bins_and_constant_images_are_finite() {
        let (black, white) = ([0; 1024], [255; 1024]);
        let apart = pkl(&Pair::new([32, 32], &black, &white, None).unwrap()).unwrap();
        let total = 1024.0 + 25.0;
        let expected = 1024.5 / total * (1024.5f64 / 0.5).ln() + 0.5 / total * (0.5f64 / 1024.5).ln();
        assert!((apart - expected).abs() < 1e-12, "{apart} {expected}");
        assert_eq!(pkl(&Pair::new([32, 32], &white, &white, None).unwrap()), Ok(0.0));
    }

    #[test]
    fn small_images_and_small_masks_are_errors() {
        let few = [0; 31 * 40];
        let small = pkl(&Pair::new([31, 40], &few, &few, None).unwrap()).unwrap_err();
        assert!(small.to_string().contains("32 x 32") && small.to_string().contains("31 x 40"), "{small}");
        let (image, mut mask) = ([0; 1024], [0; 1024]);
        mask[..511].fill(1);
        let of = |mask: &[u8]| pkl(&Pair::new([32, 32], &image, &image, Some(mask)).unwrap());
        assert_eq!(of(&mask), Err(QualityError::NoPatch { patch: 32 }));
        mask[511] = 1;
        assert_eq!(of(&mask), Ok(0.0));
    }

    #[test]
    fn it_has_a_direction() {
        let half: Vec<u8> = (0..1024).map(|i| if i < 512 { 0 } else { 255 }).collect();
        let of = |a: &[u8], b: &[u8]| pkl(&Pair::new([32, 32], a, b, None).unwrap()).unwrap();
        // A reference in two bins and an image in one of them have a large divergence; exchanged, it is about ln 2.
        assert!(of(&[0; 1024], &half) > 3.0);
        assert!((of(&half, &[0; 1024]) - 0.7).abs() < 0.05);
    }
}
