//! Calibration of tracker, probe, stylus and needle, and its file.
//!
//! A calibration file is TOML. Only the version is required; every table is optional, and an unknown key is an error.
//! Lengths are in mm; a quaternion is `[qw, qx, qy, qz]` of norm 1.
//!
//! ```toml
//! version = 1
//!
//! [scene_from_tracker]               # from `insonify calibrate landmarks`
//! position_mm = [10.0, 0.0, -5.0]    # the tracker's origin in the scene
//! quaternion = [1.0, 0.0, 0.0, 0.0]  # turns tracker axes into scene axes
//! rms_mm = 0.6                       # RMS residual of the fit, for information
//!
//! [sensor_from_probe]                # from `insonify calibrate probe`
//! position_mm = [0.0, 0.0, 42.0]     # the centre of the probe's face in the sensor's frame
//! quaternion = [1.0, 0.0, 0.0, 0.0]  # turns probe axes into sensor axes
//!
//! [stylus]                           # from `insonify calibrate pivot`
//! tip_mm = [0.0, 0.0, 120.0]         # the tip in the frame of the stylus' sensor
//! rms_mm = 0.2
//!
//! [needle]                           # `insonify calibrate pivot --of needle` and `insonify calibrate spin --of needle`
//! tip_mm = [0.0, 0.0, 95.0]          # the tip in the frame of the needle's sensor
//! rms_mm = 0.3
//! axis = [0.0, 0.0, 1.0]             # along the shaft from hub to tip, sensor's frame, of length 1
//! axis_deg = 0.05                    # standard error of the axis, for information
//! points_to_tip = false              # true: `axis` points to the tip; else the tip decides between `axis` and its opposite
//! bevel = [1.0, 0.0, 0.0]            # where the bevel's facet faces, across the shaft; may be missing
//! ```

use std::path::{Path, PathBuf};

use glam::{DQuat, DVec3};
use serde::{Deserialize, Serialize};
use thiserror::Error;

use super::needle_mount::{NeedleCalibration, NeedleError, NeedleMount, out_of_range};
use super::{POSITION_LIMIT_MM, Pose, PoseError};
use crate::files::{self, FileError, FileKind};

#[cfg(test)]
mod tests;

/// Version of the file format; other versions are refused.
pub(crate) const CALIBRATION_VERSION: u32 = 1;

/// Errors in calibrations and their files.
#[derive(Debug, Error)]
pub enum CalibrationError {
    /// The file could not be read.
    #[error(transparent)]
    File(#[from] FileError),
    /// The calibration file that a station names does not exist.
    #[error(
        "cannot read the calibration file {path}: there is no such file. `[calibration] path` of the station names it; `insonify calibrate landmarks --tracker STATION.toml` (the tracker in the scene) and `insonify calibrate probe --tracker STATION.toml` (the sensor on the probe) write it; without the key, the tracker's frame is the scene's"
    )]
    Missing {
        /// Path of the file.
        path: PathBuf,
    },
    /// The content of the file is invalid.
    #[error("calibration file {path}: {source}")]
    InFile {
        /// Path of the file.
        path: PathBuf,
        /// Fault of the content.
        source: Box<CalibrationError>,
    },
    /// Not TOML, an unknown key, or a value of the wrong type.
    #[error("{reason}")]
    Syntax {
        /// The parser's message with line and column.
        reason: String,
    },
    /// Another version of the format.
    #[error("`version` is {found}; this program reads version {CALIBRATION_VERSION}")]
    Version {
        /// Version found.
        found: i64,
    },
    /// A transform that is not a valid pose.
    #[error("[{table}]: {source}")]
    Pose {
        /// Name of the table with the transform in the file.
        table: &'static str,
        /// Fault of the pose.
        source: PoseError,
    },
    /// A value of a stylus or a needle outside its range.
    #[error("`{key}` is {fault}")]
    Tool {
        /// Key with its table.
        key: &'static str,
        /// Value found, and what would be right.
        fault: String,
    },
    /// The same transform in the station file and in the calibration file.
    #[error("`sensor_from_probe` is given twice: in the station file and in {path}; remove one of them")]
    Twice {
        /// The calibration file.
        path: PathBuf,
    },
}

/// Calibrated transforms; `None` for transforms that are not calibrated.
#[derive(Debug, Clone, Copy, PartialEq, Default)]
pub struct Calibration {
    /// Pose of the tracker in the scene; if `None`, tracker and scene share one frame.
    pub scene_from_tracker: Option<Fitted<Pose>>,
    /// Mounting of the sensor on the probe; if `None`, both share one frame.
    pub sensor_from_probe: Option<Fitted<Pose>>,
    /// Tip of the stylus in the frame of the stylus' sensor, mm.
    pub stylus_tip_mm: Option<Fitted<DVec3>>,
    /// Mounting of the sensor on the needle, as far as it is calibrated; [`needle_mount`](Self::needle_mount) gives the
    /// complete one.
    pub needle: Option<NeedleCalibration>,
}

/// A value with the residual of its fit.
#[derive(Debug, Clone, Copy, PartialEq)]
pub struct Fitted<T> {
    /// The fitted or known value.
    pub value: T,
    /// RMS residual of the fit, mm; `None` if the value was not fitted.
    pub rms_mm: Option<f64>,
}

impl<T> Fitted<T> {
    /// A given value that was not fitted.
    pub fn known(value: T) -> Self {
        Self { value, rms_mm: None }
    }
}

impl Calibration {
    /// `scene_from_probe` for a measured `tracker_from_sensor`.
    pub fn scene_from_probe(&self, tracker_from_sensor: Pose) -> Pose {
        let value = |fitted: Option<Fitted<Pose>>| fitted.map_or(Pose::IDENTITY, |f| f.value);
        value(self.scene_from_tracker) * tracker_from_sensor * value(self.sensor_from_probe)
    }

    /// `tracker_from_sensor` that the tracker would measure at this pose; the inverse of
    /// [`scene_from_probe`](Self::scene_from_probe).
    pub fn tracker_from_sensor(&self, scene_from_probe: Pose) -> Pose {
        let inverse = |fitted: Option<Fitted<Pose>>| fitted.map_or(Pose::IDENTITY, |f| f.value.inverse());
        inverse(self.scene_from_tracker) * scene_from_probe * inverse(self.sensor_from_probe)
    }

    /// Mounting of the sensor on the needle.
    ///
    /// # Errors
    /// The tip or the axis is unknown; the error names the command that finds it. Or the axis may point either way.
    pub fn needle_mount(&self) -> Result<NeedleMount, NeedleError> {
        self.needle.unwrap_or_default().mount()
    }

    /// `scene_from_needle` for a measured `tracker_from_sensor` of the needle's sensor.
    pub fn scene_from_needle(&self, tracker_from_sensor: Pose, mount: &NeedleMount) -> Pose {
        let scene_from_tracker = self.scene_from_tracker.map_or(Pose::IDENTITY, |fitted| fitted.value);
        scene_from_tracker * tracker_from_sensor * mount.sensor_from_needle()
    }

    /// Reads the calibration file at `path`.
    ///
    /// # Errors
    /// The file cannot be read, or an error of [`parse`](Self::parse). Each error names the file.
    pub fn load(path: &Path) -> Result<Self, CalibrationError> {
        let text = files::read_text(path, FileKind::Calibration).map_err(|source| match source.kind() {
            std::io::ErrorKind::NotFound => CalibrationError::Missing { path: path.to_owned() },
            _ => FileError::at("read the calibration file", path)(source).into(),
        })?;
        Self::parse(&text)
            .map_err(|source| CalibrationError::InFile { path: path.to_owned(), source: Box::new(source) })
    }

    /// Combines the values of several files: a later file overrides earlier ones, and missing files are skipped.
    ///
    /// # Errors
    /// As [`Calibration::load`].
    pub fn of_files<'a>(paths: impl IntoIterator<Item = &'a Path>) -> Result<Self, CalibrationError> {
        paths.into_iter().filter(|path| path.exists()).try_fold(Self::default(), |before, path| {
            let Self { scene_from_tracker, sensor_from_probe, stylus_tip_mm, needle } = Self::load(path)?;
            Ok(Self {
                scene_from_tracker: scene_from_tracker.or(before.scene_from_tracker),
                sensor_from_probe: sensor_from_probe.or(before.sensor_from_probe),
                stylus_tip_mm: stylus_tip_mm.or(before.stylus_tip_mm),
                needle: needle.or(before.needle),
            })
        })
    }

    /// Parses the text of a calibration file.
    ///
    /// # Errors
    /// The text is not TOML, has another version, an unknown key or a value of the wrong type. A transform is not a
    /// pose, a tip is out of range, or a direction has not the length 1.
    pub fn parse(text: &str) -> Result<Self, CalibrationError> {
        let syntax = |e: toml::de::Error| CalibrationError::Syntax { reason: files::toml_reason(text, &e) };
        // The version is checked first: the values of another version may be valid there.
        let Version { version } = toml::from_str(text).map_err(syntax)?;
        if version != i64::from(CALIBRATION_VERSION) {
            return Err(CalibrationError::Version { found: version });
        }
        let file: File = toml::from_str(text).map_err(syntax)?;
        let tool = |(key, fault)| CalibrationError::Tool { key, fault };
        let pose = |table, transform: Option<Transform>| transform.map(|t| t.pose(table)).transpose();
        Ok(Self {
            scene_from_tracker: pose("scene_from_tracker", file.scene_from_tracker)?,
            sensor_from_probe: pose("sensor_from_probe", file.sensor_from_probe)?,
            stylus_tip_mm: file.stylus.map(|stylus| stylus.tip()).transpose()?,
            needle: file.needle.map(NeedleCalibration::checked).transpose().map_err(tool)?,
        })
    }

    /// Text of the calibration file.
    pub fn to_toml(&self) -> String {
        let file = File {
            version: CALIBRATION_VERSION,
            scene_from_tracker: self.scene_from_tracker.map(Transform::of),
            sensor_from_probe: self.sensor_from_probe.map(Transform::of),
            stylus: self.stylus_tip_mm.map(|tip| Stylus { tip_mm: tip.value.to_array(), rms_mm: tip.rms_mm }),
            needle: self.needle.map(NeedleCalibration::rounded),
        };
        let head = "# Lengths in mm, quaternions [qw, qx, qy, qz]; written by `insonify calibrate`.\n";
        // Serialisation of numbers and tables with fixed names cannot fail.
        toml::to_string(&file).map(|body| format!("{head}{body}")).unwrap_or_default()
    }
}

/// Source of a calibration: the table `[calibration]` of a station.
#[derive(Debug, Clone, PartialEq, Default)]
pub struct CalibrationSource {
    /// The calibration file; `None` if the station names none.
    pub path: Option<PathBuf>,
    /// Mounting of the sensor on the probe; `None` unless the station file states it.
    pub sensor_from_probe: Option<Pose>,
}

impl CalibrationSource {
    /// Reads the calibration file, if there is one, and adds the station's own mounting.
    ///
    /// # Errors
    /// An error of [`Calibration::load`], or `sensor_from_probe` is given in both places.
    pub fn load(&self) -> Result<Calibration, CalibrationError> {
        let mut calibration = self.path.as_deref().map(Calibration::load).transpose()?.unwrap_or_default();
        if let Some(pose) = self.sensor_from_probe {
            if let (Some(path), Some(_)) = (&self.path, calibration.sensor_from_probe) {
                return Err(CalibrationError::Twice { path: path.clone() });
            }
            calibration.sensor_from_probe = Some(Fitted::known(pose));
        }
        Ok(calibration)
    }
}

#[derive(Deserialize)]
struct Version {
    version: i64,
}

#[derive(Serialize, Deserialize)]
#[serde(deny_unknown_fields)]
struct File {
    version: u32,
    #[serde(skip_serializing_if = "Option::is_none")]
    scene_from_tracker: Option<Transform>,
    #[serde(skip_serializing_if = "Option::is_none")]
    sensor_from_probe: Option<Transform>,
    #[serde(skip_serializing_if = "Option::is_none")]
    stylus: Option<Stylus>,
    #[serde(skip_serializing_if = "Option::is_none")]
    needle: Option<NeedleCalibration>,
}

#[derive(Serialize, Deserialize)]
#[serde(deny_unknown_fields)]
struct Transform {
    position_mm: [f64; 3],
    quaternion: [f64; 4],
    #[serde(skip_serializing_if = "Option::is_none")]
    rms_mm: Option<f64>,
}

#[derive(Serialize, Deserialize)]
#[serde(deny_unknown_fields)]
struct Stylus {
    tip_mm: [f64; 3],
    #[serde(skip_serializing_if = "Option::is_none")]
    rms_mm: Option<f64>,
}

impl Transform {
    fn of(fitted: Fitted<Pose>) -> Self {
        let [x, y, z, qw, qx, qy, qz] = fitted.value.components();
        Self { position_mm: [x, y, z], quaternion: [qw, qx, qy, qz], rms_mm: fitted.rms_mm }
    }

    fn pose(self, table: &'static str) -> Result<Fitted<Pose>, CalibrationError> {
        let [qw, qx, qy, qz] = self.quaternion;
        let value = Pose::new(self.position_mm.into(), DQuat::from_xyzw(qx, qy, qz, qw))
            .map_err(|source| CalibrationError::Pose { table, source })?;
        Ok(Fitted { value, rms_mm: self.rms_mm })
    }
}

impl Stylus {
    fn tip(self) -> Result<Fitted<DVec3>, CalibrationError> {
        let tip = DVec3::from_array(self.tip_mm);
        if !tip.is_finite() || tip.abs().max_element() > POSITION_LIMIT_MM {
            return Err(CalibrationError::Tool { key: "stylus.tip_mm", fault: out_of_range(tip) });
        }
        Ok(Fitted { value: tip, rms_mm: self.rms_mm })
    }
}
