//! Poses to measure at.

use std::path::Path;
use std::time::Duration;

use anyhow::anyhow;
use glam::{DQuat, DVec3};
use insonify::pose::{Pose, TimedPose, interpolate};
use insonify::station::Station;
use insonify::tracker::{Transport, recording};

use super::super::{Failure, input, session};

/// Longest gap of a recording within which poses are interpolated, ns.
const GAP_NS: u64 = 500_000_000;

/// Source of poses.
pub(in crate::commands) struct Poses {
    all: Vec<TimedPose>,
    /// Description of the poses.
    pub(super) what: &'static str,
}

/// A pose to measure at, and those of the frames before it.
#[derive(Debug, Clone, PartialEq)]
pub(in crate::commands) struct Track {
    /// The pose.
    pub(in crate::commands) at: Pose,
    /// Poses of the frames before, the oldest first; shorter where the recording begins or has a gap.
    pub(in crate::commands) before: Vec<Pose>,
}

/// Poses of `file`, else of the station's recording, with the station's calibration; else the station's own pose.
pub(in crate::commands) fn of_station(station: &Station, file: Option<&Path>) -> Result<Poses, Failure> {
    let own = match &station.tracker.transport {
        Transport::Recording { path, .. } => Some(path.as_path()),
        _ => None,
    };
    if let Some(path) = file.or(own) {
        return of_recording(path, station);
    }
    let pose = input::pose(None, station, "--recording FILE, a recorded tracker")?;
    let standing = TimedPose { host_time_ns: 0, device_time_us: 0, pose };
    Ok(Poses { all: vec![standing], what: "the station's own, turned about the beam" })
}

/// Poses of the recording `path`, with the station's calibration.
pub(super) fn of_recording(path: &Path, station: &Station) -> Result<Poses, Failure> {
    let calibration = station.pose_settings()?.calibration;
    let (timed, _) = recording::poses(path)?;
    let in_scene = |timed: TimedPose| TimedPose { pose: calibration.scene_from_probe(timed.pose), ..timed };
    let all: Vec<TimedPose> = timed.into_iter().map(in_scene).collect();
    if all.is_empty() {
        return Err(Failure::Input(anyhow!("{} holds no pose", path.display())));
    }
    Ok(Poses { all, what: "spread over the recording" })
}

impl Poses {
    /// `count` poses spread evenly over the recording; a single one is turned about its beam in even steps.
    pub(in crate::commands) fn spread(&self, count: usize) -> Vec<Pose> {
        if let [TimedPose { pose, .. }] = self.all[..] {
            let turned = |i: usize| {
                let angle = std::f64::consts::PI * i as f64 / count as f64;
                Pose { orientation: pose.orientation * DQuat::from_axis_angle(DVec3::Z, angle), ..pose }
            };
            return (0..count).map(turned).collect();
        }
        session::evenly(count.min(self.all.len()), self.all.len()).map(|i| self.all[i].pose).collect()
    }

    /// Poses of a probe that moves as in `hand` about these: of `count` moments of it, the way that led to each.
    pub(super) fn moved_like(&self, hand: &Self, count: usize, frames: u32, period: Duration) -> Vec<Track> {
        if self.moves() {
            return self.tracks(count, frames, period);
        }
        let at = self.spread(count);
        let along = |(at, track): (Pose, Track)| {
            let from_hand = at * track.at.inverse();
            Track { at, before: track.before.into_iter().map(|before| from_hand * before).collect() }
        };
        at.into_iter().zip(hand.tracks(count, frames, period)).map(along).collect()
    }

    /// Whether the probe moves.
    pub(super) fn moves(&self) -> bool {
        self.all.len() > 1
    }

    /// [`Poses::spread`], each with the poses of `frames` frames before it, `period` apart.
    pub(in crate::commands) fn tracks(&self, count: usize, frames: u32, period: Duration) -> Vec<Track> {
        if !self.moves() {
            return self.spread(count).into_iter().map(|at| Track { at, before: Vec::new() }).collect();
        }
        let period_ns = u64::try_from(period.as_nanos()).unwrap_or(u64::MAX);
        let track = |index: usize| {
            let TimedPose { host_time_ns, pose, .. } = self.all[index];
            let earlier = |frames| host_time_ns.checked_sub(period_ns.saturating_mul(u64::from(frames)));
            let known = (1..=frames).map_while(|frames| interpolate(&self.all, earlier(frames)?, GAP_NS));
            let mut before: Vec<Pose> = known.collect();
            before.reverse();
            Track { at: pose, before }
        };
        session::evenly(count.min(self.all.len()), self.all.len()).map(track).collect()
    }
}

#[cfg(test)]
mod tests {
    use super::*;

    #[test]
    fn poses_are_spread_or_turned() {
        let at = |x: f64| Pose { position_mm: DVec3::new(x, 0.0, 0.0), orientation: DQuat::IDENTITY };
        let timed =
            |ms: u32| TimedPose { host_time_ns: 1_000_000 * u64::from(ms), device_time_us: 0, pose: at(f64::from(ms)) };
        let many = Poses { all: (0..100).map(timed).collect(), what: "" };
        let xs: Vec<f64> = many.spread(2).iter().map(|p| p.position_mm.x).collect();
        assert_eq!(xs, [25.0, 75.0]);
        assert_eq!(many.spread(200).len(), 100);
        let tracks = many.tracks(2, 3, Duration::from_millis(10));
        let xs = |track: &Track| track.before.iter().map(|p| p.position_mm.x).collect::<Vec<_>>();
        assert_eq!((tracks[0].at, xs(&tracks[0])), (at(25.0), vec![5.0, 15.0]), "the recording begins at 0");
        assert_eq!((tracks[1].at, xs(&tracks[1])), (at(75.0), vec![45.0, 55.0, 65.0]));
        let standing = Poses { all: vec![timed(1)], what: "" };
        assert!(!standing.moves() && standing.tracks(2, 3, Duration::from_millis(10))[1].before.is_empty());
        let one = standing.spread(2);
        assert_eq!(one[0], at(1.0));
        assert!((one[1].transform_vector(DVec3::X) - DVec3::Y).length() < 1e-12 && one[1].position_mm.x == 1.0);
    }
}
