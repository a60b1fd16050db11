//! Errors of data sets.

use std::path::PathBuf;

use thiserror::Error;

use crate::exam::ExamError;
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
    #[error("cannot read {path}: {source}")]
    Io {
        /// File or directory.
        path: PathBuf,
        /// Cause.
        source: std::io::Error,
    },
    /// An invalid `dataset.json`.
    #[error("{path} is no data set's header: {source}")]
    Header {
        /// File.
        path: PathBuf,
        /// Cause.
        source: serde_json::Error,
    },
    /// A data set of another format version.
    #[error("{path} has format {found}; this version of insonify reads {expected}")]
    Format {
        /// File.
        path: PathBuf,
        /// Its format.
        found: u32,
        /// Supported format.
        expected: u32,
    },
    /// An invalid row in a manifest.
    #[error("{path}, line {line}: {reason}")]
    Row {
        /// Manifest.
        path: PathBuf,
        /// Line, from 1.
        line: usize,
        /// Description of the fault.
        reason: String,
    },
    /// An array that does not hold what its row says.
    #[error("{path}: {reason}")]
    Array {
        /// File.
        path: PathBuf,
        /// Description of the fault.
        reason: String,
    },
    /// An array that has changed since it was made.
    #[error(
        "{path} is damaged: its SHA-256 is another than when it was made. Remove it, and run the command that made the data set again"
    )]
    Damaged {
        /// File.
        path: PathBuf,
    },
    /// A request that cannot be planned.
    #[error("{0}")]
    Plan(String),
    /// A quality or a look outside its range.
    #[error(transparent)]
    Settings(#[from] SettingsError),
    /// Stations with too many tissues.
    #[error("the stations have {count} tissues; a data set holds 255")]
    Tissues {
        /// Number of different tissues.
        count: usize,
    },
    /// A station without a source of poses.
    #[error("{station}: the scene has no standard planes, and the station no [pose] to wander about")]
    NoPose {
        /// Station file.
        station: PathBuf,
    },
    /// A directory of another data set.
    #[error("{directory} holds another data set ({difference}): write to another directory, or remove it")]
    OtherDataset {
        /// Directory.
        directory: PathBuf,
        /// First different key, with both values.
        difference: String,
    },
    /// Tuples that another run is writing.
    #[error("{manifest} is being written by another run: wait for it")]
    Busy {
        /// Manifest.
        manifest: PathBuf,
    },
    /// A tuple that comes out differently on this machine.
    #[error(
        "{directory}: tuple {index} is another frame here: another version, driver or device made this data set. Write to another directory, or remove it"
    )]
    OtherMachine {
        /// Directory.
        directory: PathBuf,
        /// Index of the tuple.
        index: usize,
    },
    /// A data set for the high quality that was made with another value.
    #[error("{directory}: {key} is {found} there, {wanted} is wanted here")]
    OtherTarget {
        /// Directory.
        directory: PathBuf,
        /// Key in its header.
        key: &'static str,
        /// Its value.
        found: String,
        /// Value of this data set.
        wanted: String,
    },
    /// A data set for the high quality that lacks it.
    #[error("{directory}: {reason}")]
    Target {
        /// Directory.
        directory: PathBuf,
        /// Description of the fault.
        reason: String,
    },
    /// A data set without tuples.
    #[error("{directory} holds no tuple yet")]
    Empty {
        /// Directory.
        directory: PathBuf,
    },
    /// A row of a station that the header lacks.
    #[error("{path} knows no station `{file}`")]
    UnknownStation {
        /// Header.
        path: PathBuf,
        /// Station file of the row.
        file: PathBuf,
    },
    /// A scene that has changed since the data set was made.
    #[error("{path} is another scene than the data set was made of")]
    OtherScene {
        /// Scene file.
        path: PathBuf,
    },
    /// A tissue that the header lacks.
    #[error("the data set has no class `{tissue}`; its classes are {known}")]
    UnknownTissue {
        /// Tissue of the scene.
        tissue: String,
        /// All classes.
        known: String,
    },
    /// A phantom outside its range.
    #[error("tuple {index}: {source}")]
    Phantom {
        /// Index of the tuple.
        index: usize,
        /// Cause.
        source: ParametersError,
    },
    /// A tissue number of a frame without a class.
    #[error("tissue number {number} has no class")]
    Number {
        /// Number in the segmentation.
        number: u8,
    },
    /// A station or a scene that cannot be loaded.
    #[error(transparent)]
    Station(#[from] StationError),
    /// A session that cannot be made.
    #[error(transparent)]
    Exam(#[from] ExamError),
    /// A frame that cannot be rendered.
    #[error(transparent)]
    Render(#[from] RenderError),
    /// A file that cannot be written.
    #[error(transparent)]
    Sink(#[from] SinkError),
}
