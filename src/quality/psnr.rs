//! Peak signal-to-noise ratio.

use super::Pair;

/// Peak signal-to-noise ratio of 8-bit images, dB: 10·log10(255²/MSE), over the pixels inside the mask. Infinite for
/// identical images.
///
/// Zhang et al. 2020 print 10·log10(255/MSE), which is a misprint. Their 25 to 29 dB would then need a mean square
/// error below 1 grey level², which two images with different speckle never have. With 255², the mean square error is
/// 80 to 190.
pub fn psnr_db(pair: &Pair<'_>) -> f64 {
    let (mut sum, mut count) = (0u64, 0u64);
    for (index, (a, b)) in pair.image.iter().zip(pair.reference).enumerate() {
        if pair.inside(index) {
            sum += u64::from(a.abs_diff(*b)).pow(2);
            count += 1;
        }
    }
    // A pair has at least one pixel inside, so a sum of 0 means identical images.
    if sum == 0 { f64::INFINITY } else { 10.0 * (255.0 * 255.0 * count as f64 / sum as f64).log10() }
}

#[cfg(test)]
mod tests {
    use super::*;

    #[test]
    fn black_against_white_is_0_db_and_equals_are_infinite() {
        let psnr = |a: &[u8], b: &[u8], mask| psnr_db(&Pair::new([2, 2], a, b, mask).unwrap());
        assert_eq!(psnr(&[0; 4], &[255; 4], None), 0.0);
        assert_eq!(psnr(&[255; 4], &[255; 4], None), f64::INFINITY);
        assert_eq!(psnr(&[0; 4], &[0; 4], None), f64::INFINITY);
        let one = 20.0 * 255f64.log10();
        assert!((psnr(&[7; 4], &[8; 4], None) - one).abs() < 1e-12);
        // Pixels outside the mask count neither in the sum nor in the number of pixels.
        assert!((psnr(&[7, 0, 0, 0], &[8, 255, 255, 255], Some(&[9, 0, 0, 0])) - one).abs() < 1e-12);
        assert_eq!(psnr(&[8, 0, 0, 0], &[8, 255, 255, 255], Some(&[9, 0, 0, 0])), f64::INFINITY);
    }
}
