//! Evaluation of images and of generators: PSNR, SSIM, pKL and Fréchet distances, tables and sheets.
//!
//! [`compare`] scores image files against references. [`Evaluation`] scores low quality and generators on the tuples of
//! a data set: on random crops, on the full field of view, by tissue, and behind bone. [`steadiness`] measures how much
//! generated frames flicker as the probe slides.
//!
//! Without the feature `generator`, only [`compare`] without a feature extractor and [`steadiness`] without generators
//! work.
//!
//! ```no_run
//! use std::path::{Path, PathBuf};
//!
//! use insonify::dataset::Dataset;
//! use insonify::measuring::evaluation::{Evaluation, Models, Settings};
//!
//! # fn main() -> Result<(), Box<dyn std::error::Error>> {
//! let dataset = Dataset::open(Path::new("data"))?;
//! let models = Models { generators: vec![PathBuf::from("msa.onnx")], ..Models::default() };
//! let report = Evaluation::new(&dataset, &models, Settings::default())?.run(None, &|_| ())?;
//! println!("{}", report.markdown());
//! # Ok(())
//! # }
//! ```

mod dataset;
mod images;
mod judge;
mod models;
mod repeat;
mod scan;
mod sheets;
mod steadiness;
mod tables;
mod trained_for;

pub use dataset::{DatasetReport, Evaluation, Settings};
pub use images::{ImagesReport, NamedScores, compare};
pub use judge::{Distance, ImageScores, RowReport, TissueRow};
pub use models::{FeatureModel, Models};
pub use repeat::Repeat;
pub use steadiness::{Slide, SteadinessReport, SteadinessRow, steadiness};
