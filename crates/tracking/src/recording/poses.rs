//! Poses of a recording.

use std::io::Read;
use std::path::Path;
use std::time::Duration;

use insonify_core::pose::{Calibration, Measurement, Reading, TimedPose};

use super::in_order::keep_in_order;
use super::{
    DecodedRecording, IMPORTED, Item, RecordingError, RecordingInfo, RecordingReader, RecordingSummary, SessionPose,
    Timing,
};
use crate::tracker::{DecodeError, Settings};

/// Poses of the recording at `path`, ascending in host time, decoded by the recording's protocol.
///
/// All records of one message have its host time. The intact parts of a damaged recording are used; the summary reports
/// the rest.
///
/// # Errors
/// The file cannot be read, is not a recording, or holds no complete pose.
pub fn poses(path: &Path) -> Result<(Vec<TimedPose>, RecordingSummary), RecordingError> {
    poses_of(RecordingReader::open(path)?, path)
}

/// [`poses`] of an open recording; errors name it `path`.
///
/// # Errors
/// The source cannot be read, or has no complete pose.
pub fn poses_of<R: Read>(
    reader: RecordingReader<R>,
    path: &Path,
) -> Result<(Vec<TimedPose>, RecordingSummary), RecordingError> {
    let (poses, summary) = read_all(reader)?;
    if poses.is_empty() {
        return Err(no_pose(path, &summary));
    }
    Ok((poses, summary))
}

/// Measurements of a recording, ascending in host time.
#[derive(Debug, Clone, PartialEq)]
pub struct RecordedMeasurements {
    /// Measurements of the probe's sensor.
    pub probe: Vec<Measurement>,
    /// Measurements of the needle's sensor; empty without a tracked needle.
    pub needle: Vec<Measurement>,
    /// Content of the recording.
    pub summary: RecordingSummary,
}

/// All measurements of the recording at `path`. They include rates and orientations, which only an estimator turns into
/// poses. `settings` have the range and axis map of a puck (3D mouse), and the needle's sensor if the recording names
/// none.
///
/// # Errors
/// The file cannot be read, is not a recording, or has no measurement with the probe's sensor in view.
pub fn measurements(path: &Path, settings: &Settings) -> Result<RecordedMeasurements, RecordingError> {
    let mut decoded = DecodedRecording::with_settings(RecordingReader::open(path)?, settings);
    let (mut probe, mut needle) = (Vec::new(), Vec::new());
    while let Some(item) = decoded.next_item()? {
        match item {
            Item::Measurement(measurement) => probe.push(measurement),
            Item::NeedleMeasurement(measurement) => needle.push(measurement),
            Item::Event(_) | Item::Pose(_) | Item::NeedlePose(_) => {}
        }
    }
    let mut summary = decoded.finish();
    order(&mut probe, &mut summary, |measurement| measurement.host_time_ns);
    summary.time_reversals += keep_in_order(&mut needle, |measurement| measurement.host_time_ns);
    if probe.iter().all(|measurement| measurement.reading == Reading::OutOfView) {
        return Err(no_pose(path, &summary));
    }
    Ok(RecordedMeasurements { probe, needle, summary })
}

impl RecordingInfo {
    /// Whether the poses are `scene_from_probe` already, because the recording was imported.
    pub fn is_in_scene(&self) -> bool {
        self.device.starts_with(IMPORTED)
    }

    /// Calibration that converts the poses of this recording, at `path`, to the scene: `of_station`, or an empty
    /// calibration if the poses are in the scene frame already. Logs a note if `of_station` is ignored.
    pub fn calibration(&self, path: &Path, of_station: Calibration) -> Calibration {
        if !self.is_in_scene() {
            return of_station;
        }
        if of_station.scene_from_tracker.is_some() || of_station.sensor_from_probe.is_some() {
            tracing::warn!(
                "{}: it was {}, so its poses are the probe's in the scene: the station's calibration is not applied to them",
                path.display(),
                self.device
            );
        }
        Calibration::default()
    }
}

/// [`RecordingInfo::calibration`] of the recording at `path` with this summary.
pub fn calibration_for(path: &Path, summary: &RecordingSummary, of_station: Calibration) -> Calibration {
    summary.info.calibration(path, of_station)
}

/// Removes items with implausible times. Stores their number and the duration of the remaining items in `summary`.
fn order<T>(items: &mut Vec<T>, summary: &mut RecordingSummary, time_ns: impl Fn(&T) -> u64) {
    summary.time_reversals = keep_in_order(items, &time_ns);
    span(items.iter().map(time_ns), summary);
}

/// Stores the duration from the first to the last of `times_ns`, which ascend.
fn span(mut times_ns: impl DoubleEndedIterator<Item = u64>, summary: &mut RecordingSummary) {
    let Some(first) = times_ns.next() else { return };
    summary.duration = Duration::from_nanos(times_ns.next_back().unwrap_or(first) - first);
}

fn no_pose(path: &Path, summary: &RecordingSummary) -> RecordingError {
    let damage = summary.damage.truncated.clone().or_else(|| summary.damage.damaged_first.first().cloned());
    let reason = summary
        .advice()
        .or(damage)
        .or_else(|| summary.decode_errors_first.first().map(DecodeError::to_string))
        .unwrap_or_else(|| match summary.records {
            0 => "it has no message of tracker bytes".to_owned(),
            n => format!("none of its {n} records has one"),
        });
    RecordingError::NoPose { path: path.to_owned(), reason }
}

/// Like [`poses_of`], but the recording may have no poses.
///
/// # Errors
/// The source cannot be read.
pub fn read_all<R: Read>(reader: RecordingReader<R>) -> Result<(Vec<TimedPose>, RecordingSummary), RecordingError> {
    read_tools(reader).map(|RecordedTools { probe, summary, .. }| (probe.measured, summary))
}

/// Poses of one tool in a recording, ascending in host time.
#[derive(Debug, Clone, PartialEq, Default)]
pub struct ToolPoses {
    /// Poses measured by the tool's sensor, in the tracker's frame.
    pub measured: Vec<TimedPose>,
    /// Poses of the tool in the scene, as the session used them.
    pub used: Vec<SessionPose>,
}

impl ToolPoses {
    /// Whether the recording has no pose of the tool.
    pub fn is_empty(&self) -> bool {
        self.measured.is_empty() && self.used.is_empty()
    }

    /// Adds the pose of a measurement, if it has one.
    fn push(&mut self, measurement: &Measurement) {
        let Measurement { host_time_ns, device_time_us, reading, .. } = *measurement;
        if let Reading::Pose(pose) = reading {
            let device_time_us = device_time_us.unwrap_or(host_time_ns / 1000);
            self.measured.push(TimedPose { host_time_ns, device_time_us, pose });
        }
    }
}

/// Poses of a recording, each tool's apart.
#[derive(Debug, Clone, PartialEq, Default)]
pub struct RecordedTools {
    /// Poses of the probe.
    pub probe: ToolPoses,
    /// Poses of the needle; empty without a tracked needle.
    pub needle: ToolPoses,
    /// Content of the recording.
    pub summary: RecordingSummary,
}

/// Like [`read_all`], but also returns the poses of the needle, and the poses that the session used.
///
/// # Errors
/// The source cannot be read.
pub fn read_tools<R: Read>(reader: RecordingReader<R>) -> Result<RecordedTools, RecordingError> {
    let mut decoded = DecodedRecording::new(reader);
    let (mut probe, mut needle, mut times_ns) = (ToolPoses::default(), ToolPoses::default(), Vec::new());
    while let Some(item) = decoded.next_item()? {
        match item {
            Item::Measurement(measurement) => {
                times_ns.push(measurement.host_time_ns);
                probe.push(&measurement);
            }
            Item::NeedleMeasurement(measurement) => needle.push(&measurement),
            Item::Pose(pose) => probe.used.push(pose),
            Item::NeedlePose(pose) => needle.used.push(pose),
            Item::Event(_) => {}
        }
    }
    let mut summary = decoded.finish();
    order(&mut probe.measured, &mut summary, |pose| pose.host_time_ns);
    summary.time_reversals += keep_in_order(&mut needle.measured, |pose| pose.host_time_ns);
    // A puck's rates and orientations are not poses, but they count for the duration of the recording.
    keep_in_order(&mut times_ns, |time_ns| *time_ns);
    span(times_ns.iter().copied(), &mut summary);
    let measured = &probe.measured;
    summary.timing = if measured.is_empty() { Timing::of_times(&times_ns) } else { Timing::of(measured) };
    for tool in [&mut probe, &mut needle] {
        tool.used.sort_by_key(|pose| pose.host_time_ns);
    }
    Ok(RecordedTools { probe, needle, summary })
}

#[cfg(test)]
mod tests {
    use insonify_core::pose::{Fitted, Pose};

    use super::super::RecordingWriter;
    use super::*;
    use crate::tracker::Protocol;

    #[test]
    fn a_stations_calibration_applies_to_recorded_poses_and_not_to_imported_ones() {
        let sensor_from_probe = Some(Fitted::known(Pose::IDENTITY));
        let of_station = Calibration { sensor_from_probe, ..Calibration::default() };
        for (device, expected) in [("simulated hand", of_station), ("imported from a.csv", Calibration::default())] {
            let info = RecordingInfo { device: device.to_owned(), ..RecordingInfo::default() };
            assert_eq!(info.calibration(Path::new("a.mcap"), of_station), expected, "{device}");
        }
    }

    #[test]
    fn a_puck_has_the_range_and_the_axes_of_its_station() {
        let dir = tempfile::tempdir().unwrap();
        let path = dir.path().join("a.mcap");
        let info = RecordingInfo { protocol: Protocol::SpaceMouse, start_time_ns: 1, ..RecordingInfo::default() };
        let mut writer = RecordingWriter::create(&path, &info).unwrap();
        writer.raw(1, &[1, 10, 0, 20, 0, 30, 0, 0, 0, 0, 0, 0, 0]).unwrap();
        writer.finish().unwrap();
        let translation = |settings: &Settings| {
            let measurements = measurements(&path, settings).unwrap().probe;
            let Reading::Rates { translation, .. } = measurements[0].reading else { panic!("{measurements:?}") };
            translation
        };
        let usual = translation(&Settings::default());
        assert!(usual.length() > 0.0);
        let mut settings = Settings { axis_map: "y, x, -z, rx, ry, rz".parse().unwrap(), ..Settings::default() };
        settings.device.puck_range *= 2.0;
        let expected = glam::DVec3::new(usual.y, usual.x, -usual.z) / 2.0;
        assert!(translation(&settings).distance(expected) < 1e-12, "{usual}, {}", translation(&settings));
    }
}
