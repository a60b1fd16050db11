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
        /// Path of the header.
        path: PathBuf,
        /// Cause.
        source: serde_json::Error,
    },
    /// The data set has an unsupported format version.
    #[error("{path} has format {found}; this version of insonify reads {expected}")]
    Format {
        /// Path of the header.
        path: PathBuf,
        /// Format version of the data set.
        found: u32,
        /// Format version that this program reads.
        expected: u32,
    },
    /// A row of a manifest is invalid.
    #[error("{path}, line {line}: {reason}")]
    Row {
        /// Path of the manifest.
        path: PathBuf,
        /// Number of the line, from 1.
        line: usize,
        /// Description of the fault.
        reason: String,
    },
    /// An array file does not contain what its row states.
    #[error("{path}: {reason}")]
    Array {
        /// Path of the array.
        path: PathBuf,
        /// Description of the fault.
        reason: String,
    },
    /// An array file has changed since it was made.
    #[error(
        "{path} is damaged: its SHA-256 is another than when it was made. Remove it, and run the command that made the data set again"
    )]
    Damaged {
        /// Path of the array.
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
        /// Path of the station file.
        station: PathBuf,
    },
    /// The directory already holds another data set.
    #[error("{directory} holds another data set ({difference}): write to another directory, or remove it")]
    OtherDataset {
        /// The directory.
        directory: PathBuf,
        /// Description of the first difference: key and both values.
        difference: String,
    },
    /// Another run is writing the same tuples.
    #[error("{manifest} is being written by another run: wait for it")]
    Busy {
        /// Path of the manifest being written.
        manifest: PathBuf,
    },
    /// This machine renders a tuple differently than the data set has it.
    #[error(
        "{directory}: tuple {index} is another frame here: another version, driver or device made this data set. Write to another directory, or remove it"
    )]
    OtherMachine {
        /// Directory of the data set.
        directory: PathBuf,
        /// Index of the tuple.
        index: usize,
    },
    /// The data set whose high quality is to be copied was made with another value of a key.
    #[error("{directory}: {key} is {found} there, {wanted} is wanted here")]
    OtherTarget {
        /// Directory of that data set.
        directory: PathBuf,
        /// Key in the header of that data set.
        key: &'static str,
        /// Value in the header of that data set.
        found: String,
        /// Value required here.
        wanted: String,
    },
    /// The data set whose high quality is to be copied doesn't have it.
    #[error("{directory}: {reason}")]
    Target {
        /// Directory of that data set.
        directory: PathBuf,
        /// Description of the fault.
        reason: String,
    },
    /// The data set has no tuples yet.
    #[error("{directory} holds no tuple yet")]
    Empty {
        /// Directory of the data set.
        directory: PathBuf,
    },
    /// A row names a station that the header lacks.
    #[error("{path} knows no station `{file}`")]
    UnknownStation {
        /// Path of the header.
        path: PathBuf,
        /// Station file that the row names.
        file: PathBuf,
    },
    /// A scene file has changed since the data set was made.
    #[error("{path} is another scene than the data set was made of")]
    OtherScene {
        /// Path of the scene file.
        path: PathBuf,
    },
    /// The data set has no class for a tissue.
    #[error("the data set has no class `{tissue}`; its classes are {known}")]
    UnknownTissue {
        /// Name of the tissue.
        tissue: String,
        /// Names of all classes, separated by commas.
        known: String,
    },
    /// The phantom parameters in a row are outside their ranges.
    #[error("tuple {index}: {source}")]
    Phantom {
        /// Index of the tuple.
        index: usize,
        /// Cause.
        source: ParametersError,
    },
    /// A tissue number in a frame has no class.
    #[error("tissue number {number} has no class")]
    Number {
        /// The tissue number.
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
