//! Errors of measurements.

use std::path::PathBuf;

use thiserror::Error;

use super::ErrorTableError;
use crate::dataset::DatasetError;
use crate::files::{FileError, GreyError};
use crate::generator::{GeneratorError, RuntimeError};
use crate::quality::QualityError;
use crate::render::RenderError;
use crate::selftest::SelfTestError;
use crate::sink::SinkError;
use crate::station::StationError;

/// Error in measuring times or picture errors, or in choosing settings by them.
#[derive(Debug, Error)]
#[non_exhaustive]
pub enum MeasuringError {
    /// A stored result that cannot be read.
    #[error(transparent)]
    Read(FileError),
    /// A stored result whose content is damaged.
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
    /// A fault in the shipped table of errors.
    #[error(transparent)]
    Table(#[from] ErrorTableError),
    /// A table that can't be written as text.
    #[error("the table of errors can't be written: {0}")]
    Text(toml::ser::Error),
    /// A recording in which the probe never moves at one of the speeds.
    #[error("{path}: at no moment is the probe {speed} ({limits})")]
    NoMotion {
        /// The recording, or the station that names it.
        path: PathBuf,
        /// Name of the missing speed.
        speed: &'static str,
        /// Limits between the speeds, in words.
        limits: String,
    },
    /// An error in comparing one image.
    #[error("{name}: {source}")]
    Image {
        /// File name of the image.
        name: String,
        /// Cause.
        source: Box<MeasuringError>,
    },
    /// A folder of images that cannot be read.
    #[error(transparent)]
    Folder(FileError),
    /// A folder of masks given for two single images.
    #[error("the mask {0} is a folder; two images have one mask")]
    MaskFolder(PathBuf),
    /// An image compared with a folder.
    #[error("{0} is no folder; give two images or two folders")]
    NoFolder(PathBuf),
    /// A folder without images.
    #[error("{0} holds no .png")]
    NoImages(PathBuf),
    /// Images without a partner of the same name.
    #[error("images go by their names, and some have no partner: {}", unpaired.join(", "))]
    Unpaired {
        /// One text for each such image.
        unpaired: Vec<String>,
    },
    /// Images of different sizes.
    #[error("{path} is {} x {}, {first} is {} x {}", size[0], size[1], expected[0], expected[1])]
    Size {
        /// File of the reference or mask.
        path: PathBuf,
        /// Width and height of the reference or mask, pixels.
        size: [u32; 2],
        /// File of the image.
        first: PathBuf,
        /// Width and height of the image, pixels.
        expected: [u32; 2],
    },
    /// A data set whose first class is not `outside`.
    #[error("the first class of {0} is not `outside`")]
    Classes(PathBuf),
    /// A requested split of a data set that holds no tuples.
    #[error("{directory} has no tuple of the split {split} yet: {train} for training, {test} for the test")]
    NoTuple {
        /// Directory of the data set.
        directory: PathBuf,
        /// Requested split.
        split: &'static str,
        /// Number of training tuples.
        train: usize,
        /// Number of test tuples.
        test: usize,
    },
    /// A high quality rendered again whose size differs from the data set's.
    #[error("tuple {index} has {expected} pixels, and {station} renders {found}")]
    Pixels {
        /// Index of the tuple.
        index: usize,
        /// Pixels of the tuple.
        expected: usize,
        /// Station file of the tuple.
        station: String,
        /// Pixels of the new frame.
        found: usize,
    },
    /// A request to render the high quality again zero times.
    #[error("the high quality is to be rendered again {0} times; it must be once at least")]
    Renders(u32),
    /// No values to summarise; the text names what is missing.
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
