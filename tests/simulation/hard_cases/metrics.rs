//! Hard cases of image metrics: constant, black and saturated images, empty histogram bins, singular covariances.

use insonify::quality::{Gaussian, Pair, frechet_distance, frechet_distance_of, pkl, psnr_db, speckle, ssim};
use nalgebra::{Cholesky, DMatrix, DVector};

use super::common::row;
use insonify::random::SplitMix64;

const SIDE: usize = 64;

/// Images by name, each [SIDE × SIDE].
fn images() -> Vec<(&'static str, Vec<u8>)> {
    let of = |level: &dyn Fn(usize) -> u8| (0..SIDE * SIDE).map(level).collect();
    vec![
        ("black", of(&|_| 0)),
        ("white", of(&|_| 255)),
        ("constant", of(&|_| 100)),
        ("one white pixel", of(&|i| if i == 777 { 255 } else { 0 })),
        ("checks", of(&|i| if (i + i / SIDE).is_multiple_of(2) { 0 } else { 255 })),
        ("ramp", of(&|i| (4 * (i % SIDE)) as u8)),
    ]
}

/// Σ p·ln(p/q) of two histograms by the textbook formula.
fn naive_divergence(a: &[u8], b: &[u8]) -> f64 {
    let histogram = |image: &[u8]| {
        let mut bins = [0.0; 50];
        image.iter().for_each(|&v| bins[(usize::from(v) * 50 / 255).min(49)] += 1.0 / image.len() as f64);
        bins
    };
    histogram(a).iter().zip(&histogram(b)).map(|(p, q): (&f64, &f64)| p * (p / q).ln()).sum()
}

/// Structural similarity of two whole images, without the constants that keep its denominators from 0.
fn naive_similarity(a: &[u8], b: &[u8]) -> f64 {
    let n = a.len() as f64;
    let mean = |v: &[u8]| v.iter().map(|&x| f64::from(x)).sum::<f64>() / n;
    let (ma, mb) = (mean(a), mean(b));
    let product = |x: &[u8], mx: f64, y: &[u8], my: f64| {
        x.iter().zip(y).map(|(&x, &y)| (f64::from(x) - mx) * (f64::from(y) - my)).sum::<f64>() / n
    };
    let (aa, bb, ab) = (product(a, ma, a, ma), product(b, mb, b, mb), product(a, ma, b, mb));
    2.0 * ma * mb * 2.0 * ab / ((ma * ma + mb * mb) * (aa + bb))
}

#[test]
fn every_metric_is_finite_for_every_flat_image() {
    let images = images();
    let (mut divergences, mut similarities, mut pairs) = (0, 0, 0);
    let half: Vec<u8> = (0..SIDE * SIDE).map(|i| u8::from(i % SIDE < SIDE / 2)).collect();
    for (a_name, a) in &images {
        for (b_name, b) in &images {
            for mask in [None, Some(half.as_slice())] {
                let what = format!("{a_name} against {b_name}");
                let pair = Pair::new([SIDE, SIDE], a, b, mask).unwrap();
                let (psnr, similarity, divergence) = (psnr_db(&pair), ssim(&pair), pkl(&pair).unwrap());
                assert!((-1.0..=1.0 + 1e-12).contains(&similarity), "{what}: {similarity}");
                assert!(divergence.is_finite() && divergence >= -1e-12, "{what}: {divergence}");
                assert!(psnr >= 0.0, "{what}: {psnr}");
                if a_name == b_name {
                    assert!(psnr == f64::INFINITY && (similarity - 1.0).abs() < 1e-12, "{what}");
                    assert!(divergence.abs() < 1e-12, "{what}");
                }
                assert_eq!(similarity.to_bits(), ssim(&pair).to_bits(), "{what}: another value on repeat");
            }
            divergences += usize::from(!naive_divergence(a, b).is_finite());
            similarities += usize::from(!naive_similarity(a, b).is_finite());
            pairs += 1;
        }
        for class in speckle::speckle(a, &vec![1; SIDE * SIDE], [SIDE, SIDE], 60.0).unwrap() {
            assert!(class.grey_mean.is_finite() && class.grey_deviation.is_finite(), "{a_name}: {class:?}");
            assert!(class.envelope_snr.is_none_or(f64::is_finite), "{a_name}: {class:?}");
        }
    }
    assert!(divergences > pairs / 2 && similarities > 3, "{divergences} {similarities} of {pairs}");
    row(
        "pKL of images with empty bins",
        format!("Σp·ln(p/q) is infinite or NaN for {divergences} of {pairs} pairs"),
        "half a pixel is added to every bin",
        "finite; 0 for equal images".to_owned(),
    );
    row(
        "SSIM of constant images",
        format!("0/0 for {similarities} of {pairs} pairs"),
        "the constants of Wang et al.",
        "1 for equal images".to_owned(),
    );
}

#[test]
fn singular_covariances_have_a_distance() {
    let mut random = SplitMix64::new(8);
    // Fewer vectors than dimensions, constant ones, and ones that differ by one part in 10⁹.
    let noise: Vec<Vec<f64>> = (0..5).map(|_| (0..40).map(|_| random.between(-1.0, 1.0)).collect()).collect();
    let constant = vec![vec![0.25; 40]; 5];
    let nearly: Vec<Vec<f64>> = (0..5).map(|i| vec![1.0 + 1e-9 * f64::from(i); 40]).collect();
    let sets = [&noise, &constant, &nearly];
    let no_root = sets.iter().filter(|s| Cholesky::new(Gaussian::of(s).unwrap().covariance).is_none()).count();
    let mut worst = 0.0_f64;
    for a in sets {
        for b in sets {
            let distance = frechet_distance_of(a, b).unwrap();
            assert!(distance.is_finite() && distance >= 0.0, "{distance}");
            if a == b {
                worst = worst.max(distance);
            }
        }
    }
    assert!(no_root > 0 && worst < 1e-9, "{no_root} {worst}");
    let zero = Gaussian { mean: DVector::zeros(3), covariance: DMatrix::zeros(3, 3) };
    assert_eq!(frechet_distance(&zero, &zero), Ok(0.0));
    row(
        "Fréchet distance of singular covariances",
        format!("{no_root} of 3 have no Cholesky root"),
        "singular values of the product of symmetric roots, eigenvalues below 0 as 0",
        format!("{worst:.0e} between equal sets"),
    );
}
