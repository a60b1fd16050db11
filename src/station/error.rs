//! Errors in station files.

use std::path::PathBuf;

use thiserror::Error;

use super::accepts::Accepts;
use crate::anatomy::planes::PlanesError;
use crate::anatomy::{BvhError, SceneError, TissueError};
use crate::phantom::CacheError;
use crate::pose::{CalibrationError, PoseError};
use crate::recording::RecordingError;

/// Error in a station file. Keys are written with their table: `probe.depth_mm`.
#[derive(Debug, Error)]
#[non_exhaustive]
pub enum StationError {
    /// The file could not be read.
    #[error("cannot read the station file {path}: {source}")]
    Io {
        /// File.
        path: PathBuf,
        /// Cause.
        source: std::io::Error,
    },
    /// An error with its file.
    #[error("station file {path}: {source}")]
    InFile {
        /// File.
        path: PathBuf,
        /// Error in the file.
        source: Box<StationError>,
    },
    /// Not TOML.
    #[error("not valid TOML: {reason}")]
    Syntax {
        /// The parser's message with line and column.
        reason: String,
    },
    /// An unknown table.
    #[error("unknown table `[{table}]`{suggestion}; tables are {known}")]
    UnknownTable {
        /// Table found.
        table: String,
        /// Nearest known table, ready to print, or empty.
        suggestion: String,
        /// All tables.
        known: String,
    },
    /// An unknown key of a table.
    #[error("unknown key `{key}` in `[{table}]`{suggestion}; its keys are {known}")]
    UnknownKey {
        /// Table.
        table: String,
        /// Key found.
        key: String,
        /// Nearest known key, ready to print, or empty.
        suggestion: String,
        /// All keys of the table.
        known: String,
    },
    /// A value of the wrong type, a number outside its range, or an unknown word.
    #[error("`{key}` is {found}; it must be {accepts}{suggestion}")]
    Value {
        /// Key with its table.
        key: String,
        /// Value found, as TOML.
        found: String,
        /// Accepted values.
        accepts: Accepts,
        /// Nearest choice, ready to print, or empty.
        suggestion: String,
    },
    /// A required key is missing.
    #[error("`{key}` is missing: {needed}")]
    Missing {
        /// Key with its table.
        key: String,
        /// Purpose of the key.
        needed: String,
    },
    /// A key that does not apply in combination with another.
    #[error("`{key}` does not apply: {reason}")]
    NotApplicable {
        /// Key with its table.
        key: String,
        /// Reason, and which key applies.
        reason: String,
    },
    /// A text that its key does not accept.
    #[error("`{key}`: {reason}")]
    Text {
        /// Key with its table.
        key: String,
        /// Fault, and the valid form.
        reason: String,
    },
    /// The background is not a known tissue.
    #[error("`scene.background` names the unknown tissue `{tissue}`{suggestion}")]
    UnknownTissue {
        /// Name looked up.
        tissue: String,
        /// Nearest known name, ready to print, or empty.
        suggestion: String,
    },
    /// A new tissue without all of its physical properties.
    #[error("`[tissues.{tissue}]` is not a built-in tissue{suggestion}, so it must give {missing}, too")]
    IncompleteTissue {
        /// Tissue.
        tissue: String,
        /// Nearest built-in tissue, ready to print, or empty.
        suggestion: String,
        /// Keys not given.
        missing: String,
    },
    /// A scene that cannot be read.
    #[error(transparent)]
    Scene(#[from] SceneError),
    /// A scene without a skin.
    #[error(transparent)]
    Skin(#[from] BvhError),
    /// A generated scene that cannot be built or kept.
    #[error(transparent)]
    Phantom(#[from] CacheError),
    /// Standard planes that cannot be used.
    #[error(transparent)]
    Planes(#[from] PlanesError),
    /// A tissue table that cannot be used.
    #[error(transparent)]
    Tissue(#[from] TissueError),
    /// A station without a pose.
    #[error("no pose: give a recording, or a [pose] with position_mm and quaternion in {station}")]
    NoPose {
        /// Station file.
        station: PathBuf,
    },
    /// A recording without poses.
    #[error("{path} holds no pose")]
    NoRecordedPose {
        /// Recording.
        path: PathBuf,
    },
    /// A recording that cannot be read.
    #[error(transparent)]
    Recording(#[from] RecordingError),
    /// Not a pose.
    #[error("[pose]: {0}")]
    Pose(#[from] PoseError),
    /// A `sensor_from_probe` that is not a pose.
    #[error("[calibration] sensor_from_probe: {0}")]
    SensorFromProbe(PoseError),
    /// A calibration file that cannot be used.
    #[error(transparent)]
    Calibration(#[from] CalibrationError),
}
