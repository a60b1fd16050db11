//! Poses of a recorded session, for scoring.

use std::path::Path;

use super::ReplayError;
use crate::pipeline::replayed::ReplayedControls;
use crate::pose::{self, Calibration, TimedPose, TrackingState};
use crate::recording::{RecordedTools, RecordingReader, RecordingSummary, ToolPoses, calibration_for, read_tools};
use crate::settings::LiveSettings;
use crate::station::Station;

/// Poses of a recorded session as they were on the screen.
#[derive(Debug)]
pub struct RecordedExam {
    /// `scene_from_probe` at each time; held while the picture was frozen.
    pub poses: Vec<TimedPose>,
    /// `scene_from_needle` at each time at which it was known; held while the picture was frozen. Empty without a
    /// tracked needle.
    pub needle: Vec<TimedPose>,
    /// Image depth at each pose, mm.
    pub depths_mm: Vec<f64>,
    /// Whether the picture was frozen at each pose.
    pub frozen: Vec<bool>,
    /// Source of the poses: `session`, or `tracker` with the station's calibration.
    pub source: &'static str,
    /// Content of the recording.
    pub summary: RecordingSummary,
    /// Reasons why settings of the session were refused.
    pub refused: Vec<String>,
}

impl RecordedExam {
    /// Reads the poses shown in the session at `path`. If it has none, the tracker's poses are used with the
    /// station's calibration. Damaged parts of the recording are logged.
    ///
    /// # Errors
    /// A recording or calibration that can't be read, or no pose.
    pub fn read(path: &Path, station: &Station) -> Result<Self, ReplayError> {
        let RecordedTools { probe, needle, summary } = read_tools(RecordingReader::open(path)?)?;
        summary.warn_of_damage(path);
        let source = if probe.used.is_empty() { "tracker" } else { "session" };
        let in_scene = |tool: &ToolPoses, settings: pose::Settings| {
            let calibration = calibration_for(path, &summary, settings.calibration);
            poses_in_scene(tool, &calibration)
        };
        let mut poses = in_scene(&probe, station.pose_settings()?);
        // Poses of the session need no calibration of the needle.
        let mut needle = if needle.is_empty() {
            Vec::new()
        } else if needle.used.is_empty() {
            station.needle_settings()?.map_or_else(Vec::new, |needed| in_scene(&needle, needed.settings))
        } else {
            in_scene(&needle, station.pose_settings()?)
        };
        if poses.is_empty() {
            return Err(ReplayError::NoPose { path: path.to_owned() });
        }
        let begin = LiveSettings { probe: station.probe, render: station.settings, frozen: false, generator: false };
        shown(&mut needle, &mut ReplayedControls::new(begin, &summary.events));
        let mut controls = ReplayedControls::new(begin, &summary.events);
        let refused = controls.refused().to_vec();
        let (depths_mm, frozen) = shown(&mut poses, &mut controls);
        Ok(Self { poses, needle, depths_mm, frozen, source, summary, refused })
    }
}

/// Poses of a tool in the scene: those of the session that were shown, or else the measured ones by `calibration`.
fn poses_in_scene(tool: &ToolPoses, calibration: &Calibration) -> Vec<TimedPose> {
    if tool.used.is_empty() {
        let in_scene = |timed: &TimedPose| TimedPose { pose: calibration.scene_from_probe(timed.pose), ..*timed };
        return tool.measured.iter().map(in_scene).collect();
    }
    let shown = tool.used.iter().filter(|used| is_scored(used.state));
    let timed = |host_time_ns: u64, pose| TimedPose { host_time_ns, device_time_us: host_time_ns / 1000, pose };
    shown.map(|used| timed(used.host_time_ns, used.pose)).collect()
}

/// Whether a pose of a session counts in its score. A stale one doesn't.
pub(in crate::pipeline) fn is_scored(state: TrackingState) -> bool {
    state <= TrackingState::Stuck
}

/// Holds the pose while the picture is frozen. Returns, for each pose, the image depth, mm, and whether the picture was
/// frozen.
fn shown(poses: &mut [TimedPose], controls: &mut ReplayedControls) -> (Vec<f64>, Vec<bool>) {
    let mut last = None;
    let mut each = |timed: &mut TimedPose| {
        let live = controls.at(timed.host_time_ns);
        if live.frozen {
            timed.pose = last.unwrap_or(timed.pose);
        }
        last = Some(timed.pose);
        (live.probe.depth_mm, live.frozen)
    };
    poses.iter_mut().map(&mut each).unzip()
}

#[cfg(test)]
mod tests {
    use crate::recording::Event;
    use crate::settings::Probe;

    use super::*;

    #[test]
    fn the_picture_on_the_screen_counts() {
        let pose = |i: u64| {
            let pose = crate::pose::Pose::from_components([i as f64, 0.0, 0.0, 1.0, 0.0, 0.0, 0.0]).unwrap();
            TimedPose { host_time_ns: 1000 + 10 * i, device_time_us: 0, pose }
        };
        let mut poses: Vec<TimedPose> = (0..5).map(pose).collect();
        let event = |time_ns, name: &str, value: serde_json::Value| Event::new(time_ns, name).with(value);
        let events = [
            event(1010, "depth_mm", 90.0.into()),
            event(1020, "frozen", true.into()),
            event(1040, "frozen", false.into()),
        ];
        let mut controls = ReplayedControls::new(LiveSettings::default(), &events);
        assert_eq!(controls.refused(), [] as [String; 0]);
        let (depths, frozen) = shown(&mut poses, &mut controls);
        assert_eq!(depths, [Probe::default().depth_mm, 90.0, 90.0, 90.0, 90.0]);
        assert_eq!(frozen, [false, false, true, true, false]);
        let xs: Vec<f64> = poses.iter().map(|p| p.pose.position_mm.x).collect();
        assert_eq!(xs, [0.0, 1.0, 1.0, 1.0, 4.0]);
    }
}
