//! Errors of measurements.

use std::path::PathBuf;

use thiserror::Error;

use super::ErrorTableError;
use crate::dataset::DatasetError;
use crate::files::GreyError;
use crate::generator::{GeneratorError, RuntimeError};
use crate::quality::QualityError;
use crate::render::RenderError;
use crate::selftest::SelfTestError;
use crate::sink::SinkError;
use crate::station::StationError;

/// Error in measuring times or errors, or in choosing by them.
#[derive(Debug, Error)]
#[non_exhaustive]
pub enum MeasuringError {
    /// A stored result that cannot be read.
    #[error("cannot read {path}: {source}")]
    Read {
        /// File or folder.
        path: PathBuf,
        /// Cause.
        source: std::io::Error,
    },
    /// A stored result that is none.
    #[error("{path} is damaged: measure again without what is stored ({source})")]
    Damaged {
        /// File.
        path: PathBuf,
        /// Cause.
        source: serde_json::Error,
    },
    /// A figure that cannot be drawn.
    #[error("the figure can't be drawn: {0}")]
    Figure(String),
    /// The shipped table of errors.
    #[error(transparent)]
    Table(#[from] ErrorTableError),
    /// A table that can't be written as text.
    #[error("the table of errors can't be written: {0}")]
    Text(toml::ser::Error),
    /// A recording in which the probe does not move at each speed.
    #[error("{path}: at no moment is the probe {speed} ({limits})")]
    NoMotion {
        /// Recording, or the station that names it.
        path: PathBuf,
        /// Missing speed.
        speed: &'static str,
        /// Limits of the speeds.
        limits: String,
    },
    /// An error with the image that it is about.
    #[error("{name}: {source}")]
    Image {
        /// File name of the image.
        name: String,
        /// Cause.
        source: Box<MeasuringError>,
    },
    /// A folder of images that cannot be read.
    #[error("cannot read {path}: {source}")]
    Folder {
        /// Folder.
        path: PathBuf,
        /// Cause.
        source: std::io::Error,
    },
    /// A folder of masks for two images.
    #[error("the mask {0} is a folder; two images have one mask")]
    MaskFolder(PathBuf),
    /// An image and a folder.
    #[error("{0} is no folder; give two images or two folders")]
    NoFolder(PathBuf),
    /// A folder without images.
    #[error("{0} holds no .png")]
    NoImages(PathBuf),
    /// Images without a partner of the same name.
    #[error("images go by their names, and some have no partner: {}", unpaired.join(", "))]
    Unpaired {
        /// A text for each.
        unpaired: Vec<String>,
    },
    /// Images of different sizes.
    #[error("{path} is {} x {}, {first} is {} x {}", size[0], size[1], expected[0], expected[1])]
    Size {
        /// Reference or mask.
        path: PathBuf,
        /// Its width and height, pixels.
        size: [u32; 2],
        /// Image.
        first: PathBuf,
        /// Width and height of the image, pixels.
        expected: [u32; 2],
    },
    /// A data set whose numbers have no meaning.
    #[error("the first class of {0} is not `outside`")]
    Classes(PathBuf),
    /// A split without tuples.
    #[error("{directory} has no tuple of the split {split} yet: {train} for training, {test} for the test")]
    NoTuple {
        /// Directory.
        directory: PathBuf,
        /// Requested split.
        split: &'static str,
        /// Training tuples.
        train: usize,
        /// Test tuples.
        test: usize,
    },
    /// A high quality of another size than the data set's.
    #[error("tuple {index} has {expected} pixels, and {station} renders {found}")]
    Pixels {
        /// Index of the tuple.
        index: usize,
        /// Its pixels.
        expected: usize,
        /// Station file of the tuple.
        station: String,
        /// Pixels of the frame.
        found: usize,
    },
    /// Too few renders.
    #[error("the high quality is to be rendered again {0} times; it must be once at least")]
    Renders(u32),
    /// Nothing to summarise.
    #[error("there is no {0}")]
    Nothing(&'static str),
    /// An image that cannot be used.
    #[error(transparent)]
    Grey(#[from] GreyError),
    /// A station without poses, or a recording that cannot be read.
    #[error(transparent)]
    Station(#[from] StationError),
    /// A data set that cannot be read or rendered.
    #[error(transparent)]
    Dataset(#[from] DatasetError),
    /// A model is needed, and ONNX Runtime is missing.
    #[error(transparent)]
    Runtime(#[from] RuntimeError),
    /// A model that cannot be loaded or run.
    #[error(transparent)]
    Generator(#[from] GeneratorError),
    /// Images that cannot be compared.
    #[error(transparent)]
    Quality(#[from] QualityError),
    /// A frame that cannot be rendered.
    #[error(transparent)]
    Render(#[from] RenderError),
    /// The comparison with theory failed.
    #[error(transparent)]
    SelfTest(#[from] SelfTestError),
    /// A file that cannot be written.
    #[error(transparent)]
    Sink(#[from] SinkError),
}
