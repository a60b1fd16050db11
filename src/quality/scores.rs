//! The paper's table: metrics of each image, with mean and percentile over all images.

use serde::{Deserialize, Serialize};

use super::{Pair, SeenError, pkl, psnr_db, seen_error, ssim};
use crate::statistics::{mean, percentile};

/// Metrics of one image against its reference.
#[derive(Debug, Clone, Copy, PartialEq, Serialize, Deserialize)]
pub struct Scores {
    /// PSNR, dB; infinite for identical images, for which JSON has `null`.
    #[serde(with = "infinite_is_null")]
    pub psnr_db: f64,
    /// SSIM, at most 1.
    pub ssim: f64,
    /// pKL, nats; `None` if the image is smaller than a patch, or the mask leaves no patch.
    pub pkl: Option<f64>,
    /// Error that an eye sees, grey levels; `None` where pKL is.
    pub seen: Option<SeenError>,
}

impl Scores {
    /// Metrics of a pair.
    pub fn of(pair: &Pair<'_>) -> Self {
        // pKL and the seen error fail only if there is no patch to compare.
        Self { pkl: pkl(pair).ok(), seen: seen_error(pair).ok(), psnr_db: psnr_db(pair), ssim: ssim(pair) }
    }
}

/// A metric over all images.
#[derive(Debug, Clone, Copy, PartialEq, Serialize, Deserialize)]
pub struct Spread {
    /// Mean over the images.
    #[serde(with = "infinite_is_null")]
    pub mean: f64,
    /// Percentile on the bad side: the 5th if higher is better, otherwise the 95th.
    #[serde(with = "infinite_is_null")]
    pub percentile: f64,
}

/// All metrics over all images.
#[derive(Debug, Clone, Copy, PartialEq, Serialize, Deserialize)]
pub struct Summary {
    /// Number of images.
    pub images: usize,
    /// Number of images identical to their references. Their PSNR is infinite. The mean excludes it, unless all
    /// images are identical; in the percentile it ranks highest.
    pub identical: usize,
    /// PSNR, dB: mean and 5th percentile.
    pub psnr_db: Spread,
    /// SSIM: mean and 5th percentile.
    pub ssim: Spread,
    /// Number of images without pKL and seen error.
    pub without_pkl: usize,
    /// pKL of the other images, nats: mean and 95th percentile; `None` if there are none.
    pub pkl: Option<Spread>,
    /// Means of the seen error and of its parts over the same images, grey levels; `None` if there are none.
    pub seen: Option<SeenError>,
}

impl Summary {
    /// Summary of the metrics of all images; `None` without images.
    pub fn of(scores: &[Scores]) -> Option<Self> {
        let spread = |of: fn(&Scores) -> Option<f64>, part| {
            let values: Vec<f64> = scores.iter().filter_map(of).collect();
            let finite = values.iter().copied().filter(|v| v.is_finite());
            Some(Spread { mean: mean(finite).unwrap_or(f64::INFINITY), percentile: percentile(&values, part)? })
        };
        let part = |of: fn(&SeenError) -> f64| mean(scores.iter().filter_map(|s| s.seen.as_ref()).map(of));
        let seen = || {
            Some(SeenError { whole: part(|s| s.whole)?, levels: part(|s| s.levels)?, texture: part(|s| s.texture)? })
        };
        Some(Self {
            images: scores.len(),
            identical: scores.iter().filter(|s| s.psnr_db.is_infinite()).count(),
            psnr_db: spread(|s| Some(s.psnr_db), 0.05)?,
            ssim: spread(|s| Some(s.ssim), 0.05)?,
            without_pkl: scores.iter().filter(|s| s.pkl.is_none()).count(),
            pkl: spread(|s| s.pkl, 0.95),
            seen: seen(),
        })
    }
}

/// Serialises infinity as `null`, because JSON has no infinity.
pub(crate) mod infinite_is_null {
    use serde::{Deserialize, Deserializer, Serialize, Serializer};

    pub(crate) fn serialize<S: Serializer>(value: &f64, to: S) -> Result<S::Ok, S::Error> {
        value.is_finite().then_some(*value).serialize(to)
    }

    pub(crate) fn deserialize<'de, D: Deserializer<'de>>(from: D) -> Result<f64, D::Error> {
        Ok(Option::deserialize(from)?.unwrap_or(f64::INFINITY))
    }
}

#[cfg(test)]
mod tests {
    use super::*;

    #[test]
    fn identical_images_are_counted_and_left_out_of_the_mean() {
        let of = |psnr_db| Scores { psnr_db, ssim: 0.5, pkl: Some(0.25), seen: None };
        let some = Summary::of(&[of(20.0), of(30.0), of(f64::INFINITY)]).unwrap();
        assert_eq!((some.images, some.identical), (3, 1));
        assert_eq!(some.psnr_db, Spread { mean: 25.0, percentile: 21.0 });
        let all = Summary::of(&[of(f64::INFINITY); 2]).unwrap();
        assert_eq!(all.psnr_db, Spread { mean: f64::INFINITY, percentile: f64::INFINITY });
        assert_eq!(Summary::of(&[]), None);
        let json = serde_json::to_string(&all).unwrap();
        assert!(json.contains(r#""psnr_db":{"mean":null"#), "{json}");
        assert_eq!(serde_json::from_str::<Summary>(&json).unwrap(), all);
    }

    #[test]
    fn an_image_without_a_patch_has_neither_pkl_nor_seen_error() {
        let small = Scores::of(&Pair::new([20, 10], &[8; 200], &[7; 200], None).unwrap());
        assert!(
            (small.psnr_db - 20.0 * 255f64.log10()).abs() < 1e-12
                && small.ssim > 0.9
                && small.pkl.is_none()
                && small.seen.is_none()
        );
        let seen = Some(SeenError { whole: 5.0, levels: 3.0, texture: 4.0 });
        let large = Scores { pkl: Some(0.25), seen, ..small };
        let summary = Summary::of(&[small, large]).unwrap();
        assert_eq!((summary.images, summary.without_pkl), (2, 1));
        assert_eq!(summary.pkl, Some(Spread { mean: 0.25, percentile: 0.25 }));
        assert_eq!(summary.seen, seen);
        let without = Summary::of(&[small]).unwrap();
        assert_eq!((without.pkl, without.seen), (None, None));
    }

    #[test]
    fn the_percentile_is_on_the_bad_side() {
        let scores: Vec<Scores> =
            (0..=100).map(f64::from).map(|i| Scores { psnr_db: i, ssim: i, pkl: Some(i), seen: None }).collect();
        let Summary { psnr_db, ssim, pkl, .. } = Summary::of(&scores).unwrap();
        assert_eq!([psnr_db.percentile, ssim.percentile, pkl.unwrap().percentile].map(|v| v.round()), [5.0, 5.0, 95.0]);
    }
}
