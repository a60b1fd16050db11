//! Speckle statistics of each tissue: grey levels, and the signal-to-noise ratio of the envelope.

use serde::{Deserialize, Serialize};

use super::QualityError;
use super::error::check_sizes;
use crate::statistics::median;

/// Side of the patches in which the envelope is measured, pixels.
pub const PATCH: usize = 32;
/// Largest share of black or white pixels in a patch, 0..=1. The envelope is clipped at these pixels.
const CLIPPED_MAX: f64 = 0.01;

/// Speckle statistics of one tissue.
#[derive(Debug, Clone, Copy, PartialEq, Serialize, Deserialize)]
pub struct ClassSpeckle {
    /// Number of the tissue in the segmentation, from 1.
    pub class: u8,
    /// Number of pixels of the tissue.
    pub pixels: usize,
    /// Mean grey level.
    pub grey_mean: f64,
    /// Standard deviation of the grey levels.
    pub grey_deviation: f64,
    /// Signal-to-noise ratio of the envelope: mean over standard deviation, as the median over patches that are
    /// wholly inside the tissue. So depth, shadows and borders count little. `None` if there is no such patch, or all
    /// are clipped. Fully developed speckle has √(π/(4 − π)) = 1.91 (Rayleigh; Burckhardt 1978); fewer scatterers, or
    /// mixtures, have less.
    pub envelope_snr: Option<f64>,
    /// Number of patches behind `envelope_snr`.
    pub patches: usize,
}

/// Speckle statistics of every tissue in `segmentation` [height × width], in the order of their numbers; 0 is
/// outside.
///
/// `image` [height × width] holds log-compressed levels over `dynamic_range_db`. The envelope is recovered as
/// 10^(level/255·range/20), up to a factor.
///
/// # Errors
/// The maps have different sizes.
pub fn speckle(
    image: &[u8],
    segmentation: &[u8],
    size: [usize; 2],
    dynamic_range_db: f64,
) -> Result<Vec<ClassSpeckle>, QualityError> {
    check_sizes(size, &[("image", image), ("segmentation", segmentation)])?;
    let [width, height] = size;
    let mut sums = vec![[0u64; 3]; 256];
    for (&level, &class) in image.iter().zip(segmentation) {
        let [count, sum, squares] = &mut sums[usize::from(class)];
        *count += 1;
        *sum += u64::from(level);
        *squares += u64::from(level).pow(2);
    }
    let envelope: [f64; 256] =
        std::array::from_fn(|level| 10f64.powf((level as f64 / 255.0 - 1.0) * dynamic_range_db / 20.0));
    let mut ratios = vec![Vec::new(); 256];
    for top in (0..(height + 1).saturating_sub(PATCH)).step_by(PATCH) {
        for left in (0..(width + 1).saturating_sub(PATCH)).step_by(PATCH) {
            let class = segmentation[top * width + left];
            let rows = (top..top + PATCH).map(|row| row * width + left..row * width + left + PATCH);
            if class == 0 || rows.clone().any(|row| segmentation[row].iter().any(|&other| other != class)) {
                continue;
            }
            if let Some(ratio) = snr(rows.flat_map(|row| &image[row]).copied(), &envelope) {
                ratios[usize::from(class)].push(ratio);
            }
        }
    }
    let class = |(class, ([count, sum, squares], ratios)): (u8, ([u64; 3], Vec<f64>))| {
        let mean = sum as f64 / count as f64;
        ClassSpeckle {
            class,
            pixels: count as usize,
            grey_mean: mean,
            grey_deviation: (squares as f64 / count as f64 - mean * mean).max(0.0).sqrt(),
            envelope_snr: median(&ratios),
            patches: ratios.len(),
        }
    };
    let all = (0..=255).zip(sums.into_iter().zip(ratios));
    Ok(all.filter(|(number, (sums, _))| *number > 0 && sums[0] > 0).map(class).collect())
}

/// Mean over standard deviation of a patch's envelope; `None` if the patch is clipped or constant.
fn snr(levels: impl Iterator<Item = u8>, envelope: &[f64; 256]) -> Option<f64> {
    let (mut sum, mut squares, mut clipped) = (0.0, 0.0, 0.0);
    for level in levels {
        let amplitude = envelope[usize::from(level)];
        sum += amplitude;
        squares += amplitude * amplitude;
        clipped += f64::from(u8::from(level == 0 || level == 255));
    }
    let count = (PATCH * PATCH) as f64;
    let mean = sum / count;
    let variance = squares / count - mean * mean;
    (clipped <= CLIPPED_MAX * count && variance > 1e-9 * mean * mean).then(|| mean / variance.sqrt())
}

#[cfg(test)]
mod tests {
    use super::*;

    /// Log-compressed Rayleigh amplitudes, from a hash.
    fn rayleigh(n: u32) -> Vec<u8> {
        let level = |i: u32| {
            let mut h = i.wrapping_mul(0x9E37_79B9) ^ 0x85EB_CA6B;
            h = (h ^ (h >> 16)).wrapping_mul(0x7FEB_352D);
            h = (h ^ (h >> 15)).wrapping_mul(0x846C_A68B);
            let uniform = (f64::from(h ^ (h >> 16)) + 0.5) / 2f64.powi(32);
            let db = 20.0 * (0.1 * (-2.0 * uniform.ln()).sqrt()).log10();
            ((1.0 + db / 60.0) * 255.0).round().clamp(0.0, 255.0) as u8
        };
        (0..n).map(level).collect()
    }

    #[test]
    fn rayleigh_amplitudes_have_the_ratio_of_full_speckle() {
        let image = rayleigh(128 * 128);
        let found = speckle(&image, &[3; 128 * 128], [128, 128], 60.0).unwrap();
        let [class] = found[..] else { panic!("{found:?}") };
        assert_eq!((class.class, class.pixels, class.patches), (3, 128 * 128, 16));
        let full = (std::f64::consts::PI / (4.0 - std::f64::consts::PI)).sqrt();
        assert!((class.envelope_snr.unwrap() - full).abs() < 0.03, "{class:?}");
        // The standard deviation of log-compressed Rayleigh amplitudes is 5.57 dB; here 60 dB are 255 grey levels.
        assert!((class.grey_deviation - 5.57 / 60.0 * 255.0).abs() < 1.0, "{class:?}");
    }

    #[test]
    fn constant_clipped_small_and_mixed_ones_have_no_ratio() {
        for level in [0, 90, 255] {
            let found = speckle(&[level; 4096], &[1; 4096], [64, 64], 60.0).unwrap();
            assert_eq!((found[0].envelope_snr, found[0].grey_mean, found[0].grey_deviation), (None, level.into(), 0.0));
        }
        let small = speckle(&rayleigh(100), &[1; 100], [10, 10], 60.0).unwrap();
        assert_eq!((small[0].envelope_snr, small[0].patches), (None, 0));
        let stripes: Vec<u8> = (0..1024).map(|i| 1 + (i % 2) as u8).collect();
        assert_eq!(speckle(&rayleigh(1024), &stripes, [32, 32], 60.0).unwrap().len(), 2);
        assert_eq!(speckle(&rayleigh(1024), &[0; 1024], [32, 32], 60.0).unwrap(), []);
        assert!(speckle(&[0; 5], &[0; 6], [3, 2], 60.0).is_err());
    }
}
