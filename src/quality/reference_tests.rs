//! Comparison with values from NumPy, SciPy and scikit-image in `tests/data/quality`, which
//! `tests/python/quality_reference.py` writes.

use std::path::PathBuf;

use serde::Deserialize;

use super::ssim::SsimMap;
use super::{Pair, frechet_distance, frechet_distance_of, pkl, psnr_db, ssim};
use crate::quality::Gaussian;

/// Largest relative difference that is accepted.
const TOLERANCE: f64 = 1e-9;

#[derive(Deserialize)]
struct File<T> {
    cases: Vec<T>,
}

#[derive(Deserialize)]
struct Images {
    name: String,
    image: String,
    reference: String,
    mask: String,
    ssim_inner: f64,
    #[serde(flatten)]
    values: Values,
    masked: Values,
}

#[derive(Debug, Deserialize)]
struct Values {
    psnr_db: f64,
    ssim: f64,
    pkl: f64,
}

#[derive(Deserialize)]
struct Features {
    name: String,
    a: Vec<Vec<f64>>,
    b: Vec<Vec<f64>>,
    distance: f64,
}

fn path(file: &str) -> PathBuf {
    PathBuf::from(env!("CARGO_MANIFEST_DIR")).join("tests/data/quality").join(file)
}

fn cases<T: for<'de> Deserialize<'de>>(file: &str) -> Vec<T> {
    serde_json::from_slice::<File<T>>(&std::fs::read(path(file)).unwrap()).unwrap().cases
}

fn grey(file: &str) -> ([usize; 2], Vec<u8>) {
    let image = image::open(path(file)).unwrap().into_luma8();
    ([image.width() as usize, image.height() as usize], image.into_raw())
}

#[track_caller]
fn close(what: &str, found: f64, expected: f64, tolerance: f64) {
    let difference = (found - expected).abs();
    assert!(difference <= tolerance * expected.abs().max(1e-3), "{what}: {found} is not {expected}");
}

#[test]
fn images_have_the_reference_values() {
    let all = cases::<Images>("images.json");
    assert!(all.len() >= 6);
    for case in all {
        let (size, image) = grey(&case.image);
        let (_, reference) = grey(&case.reference);
        let (_, mask) = grey(&case.mask);
        for (mask, expected) in [(None, &case.values), (Some(&mask[..]), &case.masked)] {
            let pair = Pair::new(size, &image, &reference, mask).unwrap();
            let name = format!("{}, mask {}", case.name, mask.is_some());
            close(&format!("PSNR of {name}"), psnr_db(&pair), expected.psnr_db, TOLERANCE);
            close(&format!("SSIM of {name}"), ssim(&pair), expected.ssim, TOLERANCE);
            close(&format!("pKL of {name}"), pkl(&pair).unwrap(), expected.pkl, TOLERANCE);
        }
        // scikit-image excludes 5 pixels at each edge from the mean.
        let [width, height] = size;
        let inner = |i: usize| (5..width - 5).contains(&(i % width)) && (5..height - 5).contains(&(i / width));
        let inner: Vec<u8> = (0..image.len()).map(|i| u8::from(inner(i))).collect();
        let pair = Pair::new(size, &image, &reference, Some(&inner)).unwrap();
        close(&format!("inner SSIM of {}", case.name), SsimMap::new(&pair).mean(&pair), case.ssim_inner, TOLERANCE);
    }
}

#[test]
fn feature_sets_have_the_reference_distances() {
    let all = cases::<Features>("frechet.json");
    assert!(all.len() >= 3);
    for Features { name, a, b, distance } in all {
        // SciPy's eigenvalues of the singular product are accurate only to the square root of the precision.
        let tolerance = 1e-7;
        close(&name, frechet_distance_of(&a, &b).unwrap(), distance, tolerance);
        let [a, b] = [&a, &b].map(|set| Gaussian::of(set).unwrap());
        close(&name, frechet_distance(&a, &b).unwrap(), distance, tolerance);
    }
}
