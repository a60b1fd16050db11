//! Poses at which measurements are made: from a station's recording, or the station's own pose.

use std::path::Path;
use std::time::Duration;

use glam::{DQuat, DVec3};

use super::{Station, StationError};
use crate::pose::{Pose, ProbeSpeed, Speed, TimedPose, interpolate};
use crate::recording;
use crate::statistics::evenly;

/// Longest gap of a recording within which poses are interpolated, ns.
const GAP_NS: u64 = 500_000_000;

/// Poses for measurements.
#[derive(Debug, Clone, PartialEq)]
pub struct Poses {
    all: Vec<TimedPose>,
    /// Origin of the poses, for messages.
    pub what: &'static str,
}

/// A pose for a measurement, and the poses of the frames before it.
#[derive(Debug, Clone, PartialEq)]
pub struct Track {
    /// Pose of the measured frame.
    pub at: Pose,
    /// Poses of the frames before, the oldest first. There are fewer after the start of the recording or a gap.
    pub before: Vec<Pose>,
}

impl Track {
    /// The same track, moved rigidly so that it ends at `at`.
    fn moved_to(self, at: Pose) -> Self {
        let from_own = at * self.at.inverse();
        Self { at, before: self.before.into_iter().map(|before| from_own * before).collect() }
    }
}

impl Poses {
    /// Poses of `file`, or else of the station's recording, both with the station's calibration. Without either, the
    /// station's own pose.
    ///
    /// # Errors
    /// Errors of [`Poses::of_recording`]; or the station has neither a recording nor a pose.
    pub fn of_station(station: &Station, file: Option<&Path>) -> Result<Self, StationError> {
        if let Some(path) = file.or(station.recording()) {
            return Self::of_recording(path, station);
        }
        let pose = station.default_pose.ok_or_else(|| StationError::NoPose { station: station.path.clone() })?;
        let standing = TimedPose { host_time_ns: 0, device_time_us: 0, pose };
        Ok(Self { all: vec![standing], what: "the station's own, turned about the beam" })
    }

    /// Poses of the recording `path`, with the station's calibration.
    ///
    /// # Errors
    /// A recording or a calibration that cannot be read, or a recording without a pose.
    pub fn of_recording(path: &Path, station: &Station) -> Result<Self, StationError> {
        let calibration = station.pose_settings()?.calibration;
        let (timed, summary) = recording::poses(path)?;
        let calibration = recording::calibration_for(path, &summary, calibration);
        let in_scene = |timed: TimedPose| TimedPose { pose: calibration.scene_from_probe(timed.pose), ..timed };
        let all: Vec<TimedPose> = timed.into_iter().map(in_scene).collect();
        if all.is_empty() {
            return Err(StationError::NoRecordedPose { path: path.to_owned() });
        }
        Ok(Self { all, what: "spread over the recording" })
    }

    /// `count` poses, spread evenly over the recording. If there is only one pose, it is turned about its beam in
    /// even steps.
    pub fn spread(&self, count: usize) -> Vec<Pose> {
        if let [TimedPose { pose, .. }] = self.all[..] {
            let turned = |i: usize| {
                let angle = std::f64::consts::PI * i as f64 / count as f64;
                Pose { orientation: pose.orientation * DQuat::from_axis_angle(DVec3::Z, angle), ..pose }
            };
            return (0..count).map(turned).collect();
        }
        evenly(count.min(self.all.len()), self.all.len()).map(|i| self.all[i].pose).collect()
    }

    /// Up to `count` poses for each speed class of the probe, each with the `frames` poses before it, `period` apart.
    /// The poses are moments of this recording at that speed. If it has a single pose, moments of the recording `hand`
    /// are used, moved to poses around that pose.
    ///
    /// # Errors
    /// The probe never moves at one of the speeds.
    pub fn at_speeds(
        &self,
        hand: &Self,
        count: usize,
        frames: u32,
        period: Duration,
    ) -> Result<Vec<(ProbeSpeed, Track)>, ProbeSpeed> {
        let moving = if self.moves() { self } else { hand };
        let all = moving.moments(frames, period);
        let at = self.spread(count);
        let mut found = Vec::new();
        for speed in ProbeSpeed::ALL {
            let paths: Vec<&Track> = all.iter().filter(|(other, _)| *other == speed).map(|(_, track)| track).collect();
            if paths.is_empty() {
                return Err(speed);
            }
            for (nth, index) in evenly(count.min(paths.len()), paths.len()).enumerate() {
                let own = paths[index].clone();
                found.push((speed, if self.moves() { own } else { own.moved_to(at[nth]) }));
            }
        }
        Ok(found)
    }

    /// All poses with `frames` poses before them, each with the class of the mean speed along this track.
    fn moments(&self, frames: u32, period: Duration) -> Vec<(ProbeSpeed, Track)> {
        let whole = (0..self.all.len()).filter_map(|index| {
            let track = self.track(index, frames, period);
            let first = track.before.first().filter(|_| track.before.len() == frames as usize)?;
            let speed = Speed::between(first, &track.at, f64::from(frames) * period.as_secs_f64());
            Some((speed.class(1.0), track))
        });
        whole.collect()
    }

    /// Whether the poses differ, so that the probe moves.
    pub fn moves(&self) -> bool {
        self.all.len() > 1
    }

    /// The poses of [`Poses::spread`], each with up to `frames` poses before it, `period` apart.
    pub fn tracks(&self, count: usize, frames: u32, period: Duration) -> Vec<Track> {
        if !self.moves() {
            return self.spread(count).into_iter().map(|at| Track { at, before: Vec::new() }).collect();
        }
        let indices = evenly(count.min(self.all.len()), self.all.len());
        indices.map(|index| self.track(index, frames, period)).collect()
    }

    fn track(&self, index: usize, frames: u32, period: Duration) -> Track {
        let period_ns = u64::try_from(period.as_nanos()).unwrap_or(u64::MAX);
        let TimedPose { host_time_ns, pose, .. } = self.all[index];
        let earlier = |frames| host_time_ns.checked_sub(period_ns.saturating_mul(u64::from(frames)));
        let known = (1..=frames).map_while(|frames| interpolate(&self.all, earlier(frames)?, GAP_NS));
        let mut before: Vec<Pose> = known.collect();
        before.reverse();
        Track { at: pose, before }
    }
}

#[cfg(test)]
mod tests {
    use super::*;

    #[test]
    fn each_speed_gets_poses_with_their_real_paths() {
        // One second at rest, one at 10 mm/s and one at 50 mm/s, with 100 poses per second.
        let x = |ms: f64| 0.01 * (ms.min(2000.0) - 1000.0).max(0.0) + 0.05 * (ms - 2000.0).max(0.0);
        let at = |x: f64| Pose { position_mm: DVec3::X * x, orientation: DQuat::IDENTITY };
        let timed = |nth: u32| {
            let ms = 10.0 * f64::from(nth);
            TimedPose { host_time_ns: 10_000_000 * u64::from(nth), device_time_us: 0, pose: at(x(ms)) }
        };
        let hand = Poses { all: (0..300).map(timed).collect(), what: "" };
        let period = Duration::from_millis(20);
        let found = hand.at_speeds(&hand, 4, 8, period).unwrap();
        let speeds: Vec<ProbeSpeed> = found.iter().map(|(speed, _)| *speed).collect();
        assert_eq!(speeds, ProbeSpeed::ALL.map(|speed| [speed; 4]).concat());
        // Paths of eight frames of 20 ms: 0 mm at rest, at most 1.6 mm in slow motion, at most 8 mm in fast motion.
        let path_mm = |(_, track): &(ProbeSpeed, Track)| track.at.position_mm.x - track.before[0].position_mm.x;
        assert!(found.iter().all(|(_, track)| track.before.len() == 8));
        assert!(found[..4].iter().all(|f| path_mm(f) < 0.48));
        assert!(found[8..].iter().all(|f| (2.4..=8.01).contains(&path_mm(f))));
        // A standing probe moves as the hand does, but about its own poses.
        let standing = Poses { all: vec![timed(50)], what: "" };
        let moved = standing.at_speeds(&hand, 4, 8, period).unwrap();
        let (_, fast) = &moved[8];
        assert_eq!(fast.at, standing.spread(4)[0]);
        let length = |track: &Track| track.at.position_mm.distance(track.before[0].position_mm);
        assert!((length(fast) - path_mm(&found[8])).abs() < 1e-9);
        let still = Poses { all: (0..100).map(timed).collect(), what: "" };
        assert_eq!(still.at_speeds(&still, 4, 8, period), Err(ProbeSpeed::Slow));
    }

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
