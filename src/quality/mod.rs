//! Image quality metrics: PSNR, SSIM, pKL and the Fréchet distance of the paper's table, speckle statistics and missed
//! structures.
//!
//! Images are 8-bit grey levels, compared in f64. Every metric of two images takes a [`Pair`]: the image, its
//! reference, and an optional mask of the sector.
//!
//! [`qa_phantom`] measures images of the QA phantom instead, without a reference.
//!
//! | metric | better | masked |
//! |---|---|---|
//! | [`psnr_db`] | higher | mean square over the pixels inside |
//! | [`ssim`](fn@ssim) | higher | windows see the whole images; the map is averaged over the pixels inside |
//! | [`pkl`](fn@pkl) | lower | patches with at least half of their pixels inside, by these pixels alone |
//! | [`level_difference`] | lower | as pKL |
//! | [`seen_error`] | lower | as pKL, and blocks with at least half of their pixels inside |
//! | [`frechet_distance`] | lower | never: extractors take rectangles |
//! | [`speckle`](mod@speckle) | nearer to the reference's | by the segmentation, which is 0 outside |
//! | [`structures`](mod@structures) | lower | by the segmentation, which is 0 outside |
//! | [`regions`] | nearer to the reference's | by tissue, and behind bone |
//! | [`steadiness`] | nearer to the target's | pixels inside in both frames |

mod crop_places;
mod error;
mod features;
mod frechet;
mod level;
pub mod levels;
mod pair;
mod pixel_counts;
mod pkl;
mod psnr;
pub mod qa_phantom;
#[cfg(test)]
mod reference_tests;
pub mod regions;
mod scores;
mod seen;
pub mod speckle;
mod ssim;
pub mod steadiness;
pub mod structures;

pub(crate) use crop_places::crop_places;
pub use crop_places::{CROP_COUNT, CROP_INSIDE, CROP_SIDE, cut};
pub use error::QualityError;
pub use features::{CROP, FeatureExtractor, crops};
pub use frechet::{Gaussian, frechet_distance, frechet_distance_of};
pub use level::level_difference;
pub use pair::{PATCH, Pair};
pub use pkl::pkl;
pub use psnr::psnr_db;
pub(crate) use regions::RegionSum;
pub use regions::{RegionError, Scanlines};
pub(crate) use scores::infinite_is_null;
pub use scores::{Scores, Spread, Summary};
pub use seen::{SeenError, seen_error};
pub use speckle::ClassSpeckle;
pub use ssim::ssim;
pub use steadiness::Steadiness;
pub use structures::ClassStructure;
