//! Structural similarity (Wang, Bovik, Sheikh, Simoncelli 2004), as MATLAB's `ssim` computes it by default.

use rayon::prelude::*;

use super::Pair;

/// Standard deviation of the window, pixels.
const SIGMA: f64 = 1.5;
/// Half width of the window, ⌈3σ⌉ pixels: the window is 11 × 11.
const HALF: usize = 5;
const TAPS: usize = 2 * HALF + 1;
/// Constants (K₁·L)² and (K₂·L)² with K₁ = 0.01, K₂ = 0.03 and L = 255. The third constant is half of the second.
const C1: f64 = 0.01 * 255.0 * 0.01 * 255.0;
const C2: f64 = 0.03 * 255.0 * 0.03 * 255.0;

/// SSIM at every pixel.
#[derive(Debug, Clone, PartialEq)]
pub(crate) struct SsimMap {
    /// Local similarity [height × width], at most 1.
    pub values: Vec<f64>,
}

/// Mean SSIM over the pixels inside the mask, at most 1.
///
/// It equals MATLAB's `ssim` on `uint8`: Gaussian window of 11 × 11 pixels with σ 1.5, weighted (biased) variances, K
/// 0.01 and 0.03, range 255, exponents 1. Pixels at the edges are replicated beyond them (`imgaussfilt` with
/// `'replicate'`), so the map has the images' size. scikit-image's `structural_similarity` with
/// `gaussian_weights=True, sigma=1.5, use_sample_covariance=False` has the same map except near the edges, and its
/// mean excludes 5 pixels at each edge.
///
/// With a mask, the windows still cover the whole images, and only the mean is restricted to the pixels inside. Near
/// the sector's rim, the windows include the black outside, which is equal in both images.
pub fn ssim(pair: &Pair<'_>) -> f64 {
    SsimMap::new(pair).mean(pair)
}

impl SsimMap {
    /// SSIM map of a pair. The pair's mask is ignored.
    pub(crate) fn new(pair: &Pair<'_>) -> Self {
        let (width, height) = (pair.width, pair.height);
        let window = window();
        // Weighted means of x, y, x², y² and xy along rows.
        let mut rows = vec![[0.0f64; 5]; width * height];
        rows.par_chunks_exact_mut(width).enumerate().for_each_init(
            || vec![[0.0f64; 5]; width + 2 * HALF],
            |padded, (row, means)| {
                for (column, padded) in padded.iter_mut().enumerate() {
                    let index = row * width + column.saturating_sub(HALF).min(width - 1);
                    let [x, y] = [pair.image, pair.reference].map(|map| f64::from(map[index]));
                    *padded = [x, y, x * x, y * y, x * y];
                }
                for (mean, taps) in means.iter_mut().zip(padded.windows(TAPS)) {
                    *mean = weighted(&window, taps.iter());
                }
            },
        );
        let mut values = vec![0.0; width * height];
        values.par_chunks_exact_mut(width).enumerate().for_each(|(row, values)| {
            let from = |tap: usize| (row + tap).saturating_sub(HALF).min(height - 1) * width;
            for (column, value) in values.iter_mut().enumerate() {
                let taps: [&[f64; 5]; TAPS] = std::array::from_fn(|tap| &rows[from(tap) + column]);
                *value = similarity(weighted(&window, taps.into_iter()));
            }
        });
        Self { values }
    }

    /// Mean over the pixels inside the mask of `pair`.
    pub(crate) fn mean(&self, pair: &Pair<'_>) -> f64 {
        let inside = self.values.iter().enumerate().filter(|(index, _)| pair.inside(*index));
        let (sum, count) = inside.fold((0.0, 0usize), |(sum, count), (_, value)| (sum + value, count + 1));
        sum / count.max(1) as f64
    }
}

fn weighted<'a>(window: &[f64; TAPS], taps: impl Iterator<Item = &'a [f64; 5]>) -> [f64; 5] {
    let mut sums = [0.0; 5];
    for (weight, tap) in window.iter().zip(taps) {
        for (sum, value) in sums.iter_mut().zip(tap) {
            *sum += weight * value;
        }
    }
    sums
}

fn similarity([x, y, xx, yy, xy]: [f64; 5]) -> f64 {
    let (variance_x, variance_y, covariance) = (xx - x * x, yy - y * y, xy - x * y);
    (2.0 * x * y + C1) * (2.0 * covariance + C2) / ((x * x + y * y + C1) * (variance_x + variance_y + C2))
}

fn window() -> [f64; TAPS] {
    let weights: [f64; TAPS] = std::array::from_fn(|tap| (-0.5 * ((tap as f64 - HALF as f64) / SIGMA).powi(2)).exp());
    let sum: f64 = weights.iter().sum();
    weights.map(|weight| weight / sum)
}

#[cfg(test)]
mod tests {
    use super::*;

    fn of(size: [usize; 2], a: &[u8], b: &[u8]) -> f64 {
        ssim(&Pair::new(size, a, b, None).unwrap())
    }

    #[test]
    fn identical_images_are_1_whatever_they_are() {
        let noise: Vec<u8> = (0..40 * 30u32).map(|i| (i.wrapping_mul(2_654_435_761) >> 24) as u8).collect();
        for image in [vec![0; 1200], vec![255; 1200], vec![93; 1200], noise] {
            assert!((of([40, 30], &image, &image) - 1.0).abs() < 1e-9);
        }
    }

    #[test]
    fn constant_images_differ_by_their_luminance_alone() {
        let expected = |a: f64, b: f64| (2.0 * a * b + C1) / (a * a + b * b + C1);
        for (a, b) in [(0u8, 255u8), (10, 20), (255, 254)] {
            let found = of([13, 12], &[a; 156], &[b; 156]);
            assert!((found - expected(a.into(), b.into())).abs() < 1e-9, "{a} {b}: {found}");
        }
    }

    #[test]
    fn images_smaller_than_the_window_have_a_value() {
        let expected = (2.0 * 3.0 * 5.0 + C1) / (9.0 + 25.0 + C1);
        assert!((of([1, 1], &[3], &[5]) - expected).abs() < 1e-12);
        assert!((of([2, 3], &[1, 2, 3, 4, 5, 6], &[1, 2, 3, 4, 5, 6]) - 1.0).abs() < 1e-9);
    }

    #[test]
    fn the_mask_chooses_what_is_averaged() {
        let (width, height) = (40, 20);
        let a: Vec<u8> = (0..width * height).map(|i| (i % 7 * 30) as u8).collect();
        let b: Vec<u8> = a.iter().enumerate().map(|(i, &v)| if i % width < 20 { v } else { 255 - v }).collect();
        let mask = |from: usize, to: usize| -> Vec<u8> {
            (0..width * height).map(|i| u8::from((from..to).contains(&(i % width)))).collect()
        };
        let of = |mask: &[u8]| ssim(&Pair::new([width, height], &a, &b, Some(mask)).unwrap());
        assert!((of(&mask(0, 15)) - 1.0).abs() < 1e-9);
        assert!(of(&mask(25, 40)) < 0.0);
    }
}
