//! Header of a data set, and the rows of its manifest, one per tuple.

use serde::{Deserialize, Serialize};

use crate::phantom::PhantomOptions;
use crate::pose::Pose;
use crate::settings::LookSettings;
use crate::transducer::{Probe, Sector};

/// Content of `dataset.json`: properties common to all tuples. Equal headers give equal tuples.
#[derive(Debug, Clone, PartialEq, Serialize, Deserialize)]
pub struct Header {
    /// Version of the directory's layout, [`FORMAT`](super::FORMAT).
    pub format: u32,
    /// Version of insonify that made the data set.
    pub insonify: String,
    /// Seed of the plan.
    pub seed: u64,
    /// Number of planned tuples in all shards.
    pub frames: usize,
    /// Tissue name of each class index in the segmentation. Class 0 is `outside`, the area outside the sector.
    pub classes: Vec<String>,
    /// Names of a tuple's planes, [`PLANES`](super::PLANES).
    pub planes: Vec<String>,
    /// Exponent applied to the attenuation, [`ATTENUATION_POWER`](super::ATTENUATION_POWER).
    pub attenuation_power: f32,
    /// Rays and layers of the first low quality.
    pub lq: [u32; 2],
    /// Rays and layers of further low qualities. Successive tuples take all low qualities in turn.
    #[serde(default, skip_serializing_if = "Vec::is_empty")]
    pub lq_more: Vec<[u32; 2]>,
    /// Rays and layers of the high quality.
    pub hq: [u32; 2],
    /// Steering angles and compounding of low and high quality.
    #[serde(default)]
    pub look: CompoundingRow,
    /// Number of phantoms per station with a phantom scene; 0 keeps the station's own phantom.
    pub phantoms: usize,
    /// Number of tuples per exam (simulated session).
    pub frames_per_exam: usize,
    /// Share of test tuples.
    pub test_share: f64,
    /// Stations of the data set; their files are in `stations/`.
    pub stations: Vec<StationRow>,
}

impl Header {
    /// Rays and layers of the low quality of the tuple `index`.
    pub(crate) fn lq_of(&self, index: usize) -> [u32; 2] {
        match index % (1 + self.lq_more.len()) {
            0 => self.lq,
            nth => self.lq_more.get(nth - 1).copied().unwrap_or(self.lq),
        }
    }
}

/// A station of a data set.
#[derive(Debug, Clone, PartialEq, Serialize, Deserialize)]
pub struct StationRow {
    /// Path of the station file in the data set's directory.
    pub file: String,
    /// Directory to which relative paths in the station file refer.
    pub directory: String,
    /// SHA-256 of the scene file; `None` for a generated phantom.
    #[serde(default, skip_serializing_if = "Option::is_none")]
    pub scene_sha256: Option<String>,
    /// Geometry of the scanlines in the station's pictures, for generators in beam coordinates; `None` in data sets of
    /// older versions.
    #[serde(default, skip_serializing_if = "Option::is_none")]
    pub scan: Option<ScanRow>,
}

impl StationRow {
    /// Whether both stations have the same station file and scene file.
    pub(crate) fn same_files(&self, other: &Self) -> bool {
        let files = |station: &Self| [Some(station.file.clone()), station.scene_sha256.clone()];
        files(self) == files(other)
    }
}

/// Geometry of the scanlines in a picture.
#[derive(Debug, Clone, Copy, PartialEq, Serialize, Deserialize)]
pub struct ScanRow {
    /// Radius of the probe's face, mm; 0 for a phased array, `None` for a linear one.
    #[serde(default, skip_serializing_if = "Option::is_none")]
    pub radius_mm: Option<f64>,
    /// Half of the lateral extent of the scanlines: radians, or mm for a linear array.
    pub half_extent: f64,
    /// Depth of the picture from the face, mm.
    pub depth_mm: f64,
    /// Side of a square pixel, mm.
    pub pixel_mm: f64,
    /// Lateral and depth coordinates (x, z) of the upper left corner in the probe's frame, mm.
    pub corner_mm: [f64; 2],
}

impl ScanRow {
    /// Geometry of the scanlines of `probe` in pictures of `width` × `height` pixels. Numbers are rounded to 1e-9, so
    /// that every JSON reader recovers them exactly.
    pub fn new(probe: &Probe, width: u32, height: u32) -> Self {
        let sector = Sector::fit(probe, width, height);
        let short = |value: f64| (1e9 * value).round() / 1e9;
        Self {
            radius_mm: probe.face_radius_mm().map(short),
            half_extent: short(probe.half_extent()),
            depth_mm: short(probe.depth_mm),
            pixel_mm: short(sector.pixel_mm),
            corner_mm: sector.corner_mm.to_array().map(short),
        }
    }
}

/// Split of a data set into training and test. The two splits share no exam and no phantom.
#[derive(Debug, Clone, Copy, PartialEq, Eq, Hash, Serialize, Deserialize)]
#[serde(rename_all = "lowercase")]
pub enum Split {
    /// Training split.
    Train,
    /// Test split.
    Test,
}

/// Row of a tuple: its files, and everything needed to render it again.
#[derive(Debug, Clone, PartialEq, Serialize, Deserialize)]
pub struct Row {
    /// Index of the tuple in the plan, from 0.
    pub index: usize,
    /// Split of the tuple: training or test.
    pub split: Split,
    /// Path of the station file in the data set's directory.
    pub station: String,
    /// Options of the phantom; `None` for another scene.
    #[serde(default, skip_serializing_if = "Option::is_none")]
    pub phantom: Option<PhantomOptions>,
    /// Exam from which the pose is taken.
    pub exam: ExamRow,
    /// Time in the exam's session and of the scene's motion, s.
    pub time_s: f64,
    /// Pose `scene_from_probe`.
    pub pose: PoseRow,
    /// Previous frames, which the low quality compounds; `None` if it has a single steering angle.
    #[serde(default, skip_serializing_if = "Option::is_none")]
    pub rolling: Option<RollingRow>,
    /// Settings that replace those of the station.
    pub settings: SettingsRow,
    /// Seed of the low-quality and of the high-quality frame.
    pub seed: u32,
    /// Rays and layers of the low quality.
    pub lq: [u32; 2],
    /// Rays and layers of the high quality.
    pub hq: [u32; 2],
    /// Steering angles and compounding of low and high quality.
    #[serde(default)]
    pub look: CompoundingRow,
    /// Width and height of the frames, pixels.
    pub size: [u32; 2],
    /// Path of the tuple's array in the data set's directory.
    pub file: String,
    /// Path of the sector's mask in the data set's directory.
    pub mask: String,
    /// SHA-256 of the tuple's array file.
    pub sha256: String,
}

/// An exam: a session of a simulated hand.
#[derive(Debug, Clone, PartialEq, Serialize, Deserialize)]
pub struct ExamRow {
    /// Number of the exam in the plan, from 0.
    pub number: usize,
    /// Seed of the session.
    pub seed: u64,
    /// Skill of the hand; `None` if the hand wanders about the station's pose.
    #[serde(default, skip_serializing_if = "Option::is_none")]
    pub skill: Option<String>,
}

/// Compounding of a tuple's frames. Later steps of post-processing come after the generator, so data sets don't contain
/// them.
#[derive(Debug, Clone, Copy, PartialEq, Serialize, Deserialize)]
pub struct CompoundingRow {
    /// Number of steering angles of the low quality: one from each of the last frames of a live session.
    pub lq_angles: u32,
    /// Number of steering angles of the high quality.
    pub hq_angles: u32,
    /// Angle between the outermost steering directions, degrees.
    pub span_deg: f64,
    /// Largest movement of the probe between the frames that a low-quality picture compounds, mm.
    #[serde(default = "reach_mm")]
    pub reach_mm: f64,
    /// Whether earlier frames of a low-quality picture are registered to the last pose.
    #[serde(default)]
    pub registration: bool,
}

fn reach_mm() -> f64 {
    LookSettings::default().reach_mm
}

impl Default for CompoundingRow {
    /// One steering angle for each quality.
    fn default() -> Self {
        let LookSettings { span_deg, reach_mm, registration, .. } = LookSettings::default();
        Self { lq_angles: 1, hq_angles: 1, span_deg, reach_mm, registration }
    }
}

impl CompoundingRow {
    /// Post-processing settings that compound the low (0) or the high quality (1).
    pub fn of(&self, quality: usize) -> LookSettings {
        let angles = if quality == 0 { self.lq_angles } else { self.hq_angles };
        let Self { span_deg, reach_mm, registration, .. } = *self;
        LookSettings { angles, span_deg, reach_mm, registration, ..LookSettings::default() }
    }
}

/// A pose of the probe in the scene.
#[derive(Debug, Clone, Copy, PartialEq, Serialize, Deserialize)]
pub struct PoseRow {
    /// Centre of the probe's face in the scene, mm.
    pub position_mm: [f64; 3],
    /// Unit quaternion [w, x, y, z] that turns probe axes into scene axes.
    pub quaternion: [f64; 4],
}

/// Previous frames of a live session, each of which contributes one steering angle to a compounded picture.
#[derive(Debug, Clone, PartialEq, Serialize, Deserialize)]
pub struct RollingRow {
    /// Frame rate of the live session, Hz.
    pub frame_rate_hz: f64,
    /// Poses of the frames, oldest first; fewer near the start of the session.
    pub poses: Vec<PoseRow>,
}

/// Settings that vary from exam to exam.
#[derive(Debug, Clone, Copy, PartialEq, Serialize, Deserialize)]
pub struct SettingsRow {
    /// Gain, dB.
    pub gain_db: f64,
    /// Dynamic range from black to white, dB.
    pub dynamic_range_db: f64,
    /// Depth of the transmit focus, mm.
    pub focus_mm: f64,
}

impl From<&Pose> for PoseRow {
    /// Rounds positions to 1 nm and quaternions to 1e-9, so that every JSON reader recovers them exactly.
    fn from(pose: &Pose) -> Self {
        let [x, y, z, w] = pose.orientation.to_array();
        let short = |digits: f64| move |value: f64| (value * digits).round() / digits;
        Self { position_mm: pose.position_mm.to_array().map(short(1e6)), quaternion: [w, x, y, z].map(short(1e9)) }
    }
}

impl From<&PoseRow> for Pose {
    fn from(row: &PoseRow) -> Self {
        let [w, x, y, z] = row.quaternion;
        let orientation = glam::DQuat::from_xyzw(x, y, z, w).normalize();
        Self { position_mm: row.position_mm.into(), orientation }
    }
}

#[cfg(test)]
mod tests {
    use super::*;
    use proptest::prelude::*;

    proptest! {
        #[test]
        fn a_pose_comes_back_from_json_bit_for_bit(
            position in proptest::array::uniform3(-2000.0f64..2000.0), turn in proptest::array::uniform3(-3.0f64..3.0),
        ) {
            let orientation = glam::DQuat::from_scaled_axis(turn.into());
            let pose = Pose { position_mm: position.into(), orientation };
            let row = PoseRow::from(&pose);
            let again: PoseRow = serde_json::from_str(&serde_json::to_string(&row).unwrap()).unwrap();
            prop_assert_eq!(again, row);
            let back = Pose::from(&row);
            prop_assert!(back.position_mm.distance(pose.position_mm) < 1e-6);
            prop_assert!(back.orientation.angle_between(pose.orientation) < 1e-7);
        }

        #[test]
        fn a_phantom_comes_back_from_json_bit_for_bit(seed: u64) {
            let options = PhantomOptions { scale: 1.0, parameters: crate::dataset::parameters(seed) };
            let again: PhantomOptions = serde_json::from_str(&serde_json::to_string(&options).unwrap()).unwrap();
            prop_assert_eq!(again, options);
        }
    }

    #[test]
    fn unknown_words_and_wrong_values_are_told() {
        let read = |key: &str, value: serde_json::Value| {
            let mut row = serde_json::to_value(PhantomOptions::default()).unwrap();
            row[key] = value;
            let options = serde_json::from_value::<PhantomOptions>(row).map_err(|e| e.to_string())?;
            options.parameters.validate().map_err(|e| e.to_string())
        };
        assert!(read("lie", "oblique".into()).unwrap_err().contains("oblique"));
        assert!(read("placenta", "low".into()).unwrap_err().contains("low"));
        assert!(read("weeks", 50.0.into()).unwrap_err().contains("16..=34"));
        assert_eq!(read("fat_mm", 20.0.into()), Ok(()));
    }
}
