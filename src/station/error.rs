//! Errors in station files.

use std::path::{Path, PathBuf};

use thiserror::Error;

use super::accepts::Accepts;
use crate::anatomy::planes::PlanesError;
use crate::anatomy::{BvhError, SceneError, TissueError};
use crate::exam::needle::ExerciseError;
use crate::files::FileError;
use crate::phantom::CacheError;
use crate::pose::needle_mount::NeedleError;
use crate::pose::{CalibrationError, PoseError};
use crate::recording::RecordingError;

/// Error in a station file. Keys are written with their table: `probe.depth_mm`.
#[derive(Debug, Error)]
#[non_exhaustive]
pub enum StationError {
    /// The file could not be read.
    #[error(transparent)]
    File(#[from] FileError),
    /// An error with its file.
    #[error("station file {path}: {source}")]
    InFile {
        /// File.
        path: PathBuf,
        /// Error in the file.
        source: Box<StationError>,
    },
    /// The text is not TOML.
    #[error("not valid TOML: {reason}")]
    Syntax {
        /// The parser's message with line and column.
        reason: String,
    },
    /// A table is unknown.
    #[error("unknown table `[{table}]`{suggestion}; tables are {known}")]
    UnknownTable {
        /// Name of the table.
        table: String,
        /// Nearest known table, ready to print, or empty.
        suggestion: String,
        /// All tables.
        known: String,
    },
    /// A key of a table is unknown.
    #[error("unknown key `{key}` in `[{table}]`{suggestion}; its keys are {known}")]
    UnknownKey {
        /// Name of the table.
        table: String,
        /// Name of the key.
        key: String,
        /// Nearest known key, ready to print, or empty.
        suggestion: String,
        /// All keys of the table.
        known: String,
    },
    /// A value has the wrong type, a number is outside its range, or a word is unknown.
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
        /// What the key is needed for.
        needed: String,
    },
    /// A key does not apply in combination with another.
    #[error("`{key}` does not apply: {reason}")]
    NotApplicable {
        /// Key with its table.
        key: String,
        /// Reason, and which key applies.
        reason: String,
    },
    /// A key does not accept its text.
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
    /// A new tissue lacks some of the required physical properties.
    #[error("`[tissues.{tissue}]` is not a built-in tissue{suggestion}, so it must give {missing}, too")]
    IncompleteTissue {
        /// Name of the tissue.
        tissue: String,
        /// Nearest built-in tissue, ready to print, or empty.
        suggestion: String,
        /// Keys that are missing.
        missing: String,
    },
    /// The scene can't be read.
    #[error(transparent)]
    Scene(#[from] SceneError),
    /// The scene has no skin.
    #[error(transparent)]
    Skin(#[from] BvhError),
    /// The generated scene can't be built or cached.
    #[error(transparent)]
    Phantom(#[from] CacheError),
    /// The standard planes can't be used.
    #[error(transparent)]
    Planes(#[from] PlanesError),
    /// The exercise names a surface that the scene lacks.
    #[error(transparent)]
    Exercise(#[from] ExerciseError),
    /// The tissue table can't be used.
    #[error(transparent)]
    Tissue(#[from] TissueError),
    /// The station has no pose.
    #[error("no pose: give a recording, or a [pose] with position_mm and quaternion in {station}")]
    NoPose {
        /// Station file.
        station: PathBuf,
    },
    /// The recording has no poses.
    #[error("{path} holds no pose")]
    NoRecordedPose {
        /// Recording.
        path: PathBuf,
    },
    /// The recording can't be read.
    #[error(transparent)]
    Recording(#[from] RecordingError),
    /// The values of `[pose]` are no pose.
    #[error("[pose]: {0}")]
    Pose(#[from] PoseError),
    /// The values of `[needle]` are no pose.
    #[error("[needle]: {0}")]
    NeedlePose(PoseError),
    /// Nothing says how the sensor of a tracked needle is mounted.
    #[error(
        "`[needle]` is tracked, but {}; `insonify calibrate pivot --of needle` and `insonify calibrate spin --of needle`, each with `--tracker STATION.toml`, write it",
        no_mount(calibration.as_deref())
    )]
    NeedleMount {
        /// The calibration file; `None` if the station names none.
        calibration: Option<PathBuf>,
    },
    /// The needle is calibrated in part.
    #[error("the table `[needle]` of the calibration file: {0}")]
    NeedleCalibration(NeedleError),
    /// The values of `sensor_from_probe` are no pose.
    #[error("[calibration] sensor_from_probe: {0}")]
    SensorFromProbe(PoseError),
    /// The calibration file can't be used.
    #[error(transparent)]
    Calibration(#[from] CalibrationError),
}

/// Missing part of the calibration of a needle.
fn no_mount(calibration: Option<&Path>) -> String {
    match calibration {
        Some(path) => {
            format!(
                "the calibration file {} has no table `[needle]`, which says how its sensor is mounted",
                path.display()
            )
        }
        None => "`[calibration] path` names no file whose table `[needle]` says how its sensor is mounted".to_owned(),
    }
}
