//! Errors of data sets.

use std::path::PathBuf;

use thiserror::Error;

use crate::exam::ExamError;
use crate::files::FileError;
use crate::phantom::ParametersError;
use crate::render::RenderError;
use crate::settings::SettingsError;
use crate::sink::SinkError;
use crate::station::StationError;

/// Error in planning, making or reading a data set.
#[derive(Debug, Error)]
#[non_exhaustive]
pub enum DatasetError {
    /// Failed file access.
    #[error(transparent)]
    File(#[from] FileError),
    /// An invalid `dataset.json`.
    #[error("{path} is no data set's header: {source}")]
    Header {
        /// File.
        path: PathBuf,
        /// Cause.
        source: serde_json::Error,
    },
    /// The data set has an unsupported format version.
    #[error("{path} has format {found}; this version of insonify reads {expected}")]
    Format {
        /// File.
        path: PathBuf,
        /// Format version of the data set.
        found: u32,
        /// Format version that is supported.
        expected: u32,
    },
    /// A row of a manifest is invalid.
    #[error("{path}, line {line}: {reason}")]
    Row {
        /// Manifest.
        path: PathBuf,
        /// Line, from 1.
        line: usize,
        /// Description of the fault.
        reason: String,
    },
    /// An array does not hold what its row says.
    #[error("{path}: {reason}")]
    Array {
        /// File.
        path: PathBuf,
        /// Description of the fault.
        reason: String,
    },
    /// An array has changed since it was made.
    #[error(
        "{path} is damaged: its SHA-256 is another than when it was made. Remove it, and run the command that made the data set again"
    )]
    Damaged {
        /// File.
        path: PathBuf,
    },
    /// The request can't be planned.
    #[error("{0}")]
    Plan(String),
    /// A quality or a post-processing setting is outside its range.
    #[error(transparent)]
    Settings(#[from] SettingsError),
    /// The stations have more tissues than there are class numbers.
    #[error("the stations have {count} tissues; a data set holds 255")]
    Tissues {
        /// Number of different tissues.
        count: usize,
    },
    /// A station has no source of poses.
    #[error("{station}: the scene has no standard planes, and the station no [pose] to wander about")]
    NoPose {
        /// Station file.
        station: PathBuf,
    },
    /// The directory holds another data set.
    #[error("{directory} holds another data set ({difference}): write to another directory, or remove it")]
    OtherDataset {
        /// Directory.
        directory: PathBuf,
        /// First key with different values, and both values.
        difference: String,
    },
    /// Another run is writing these tuples.
    #[error("{manifest} is being written by another run: wait for it")]
    Busy {
        /// Manifest.
        manifest: PathBuf,
    },
    /// A tuple comes out differently on this machine.
    #[error(
        "{directory}: tuple {index} is another frame here: another version, driver or device made this data set. Write to another directory, or remove it"
    )]
    OtherMachine {
        /// Directory.
        directory: PathBuf,
        /// Index of the tuple.
        index: usize,
    },
    /// The data set whose high quality is to be reused was made with another value.
    #[error("{directory}: {key} is {found} there, {wanted} is wanted here")]
    OtherTarget {
        /// Directory.
        directory: PathBuf,
        /// Key in the header of that data set.
        key: &'static str,
        /// Value in the header of that data set.
        found: String,
        /// Value needed.
        wanted: String,
    },
    /// The data set whose high quality is to be reused lacks it.
    #[error("{directory}: {reason}")]
    Target {
        /// Directory.
        directory: PathBuf,
        /// Description of the fault.
        reason: String,
    },
    /// The data set has no tuples.
    #[error("{directory} holds no tuple yet")]
    Empty {
        /// Directory.
        directory: PathBuf,
    },
    /// A row names a station that the header lacks.
    #[error("{path} knows no station `{file}`")]
    UnknownStation {
        /// Header.
        path: PathBuf,
        /// Station file that the row names.
        file: PathBuf,
    },
    /// The scene has changed since the data set was made.
    #[error("{path} is another scene than the data set was made of")]
    OtherScene {
        /// Scene file.
        path: PathBuf,
    },
    /// The header lacks a tissue.
    #[error("the data set has no class `{tissue}`; its classes are {known}")]
    UnknownTissue {
        /// Name of the tissue.
        tissue: String,
        /// All classes.
        known: String,
    },
    /// The parameters of a phantom are outside their ranges.
    #[error("tuple {index}: {source}")]
    Phantom {
        /// Index of the tuple.
        index: usize,
        /// Cause.
        source: ParametersError,
    },
    /// A tissue number of a frame has no class.
    #[error("tissue number {number} has no class")]
    Number {
        /// Number in the segmentation.
        number: u8,
    },
    /// A station or a scene can't be loaded.
    #[error(transparent)]
    Station(#[from] StationError),
    /// A session can't be generated.
    #[error(transparent)]
    Exam(#[from] ExamError),
    /// A frame can't be rendered.
    #[error(transparent)]
    Render(#[from] RenderError),
    /// A file can't be written.
    #[error(transparent)]
    Sink(#[from] SinkError),
}
