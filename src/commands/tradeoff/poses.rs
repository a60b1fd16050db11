//! Poses to measure at.

use std::path::Path;

use anyhow::anyhow;
use glam::{DQuat, DVec3};
use insonify::pose::Pose;
use insonify::station::Station;
use insonify::tracker::{Transport, recording};

use super::super::{Failure, input, session};

/// Source of poses.
pub(in crate::commands) struct Poses {
    all: Vec<Pose>,
    /// Description of the poses.
    pub(super) what: &'static str,
}

/// Poses of `file`, else of the station's recording, with the station's calibration; else the station's own pose.
pub(in crate::commands) fn of_station(station: &Station, file: Option<&Path>) -> Result<Poses, Failure> {
    let own = match &station.tracker.transport {
        Transport::Recording { path, .. } => Some(path.as_path()),
        _ => None,
    };
    if let Some(path) = file.or(own) {
        let calibration = station.pose_settings()?.calibration;
        let (timed, _) = recording::poses(path)?;
        let all: Vec<Pose> = timed.iter().map(|t| calibration.scene_from_probe(t.pose)).collect();
        if all.is_empty() {
            return Err(Failure::Input(anyhow!("{} holds no pose", path.display())));
        }
        return Ok(Poses { all, what: "spread over the recording" });
    }
    let pose = input::pose(None, station, "--recording FILE, a recorded tracker")?;
    Ok(Poses { all: vec![pose], what: "the station's own, turned about the beam" })
}

impl Poses {
    /// `count` poses spread evenly over the recording; a single one is turned about its beam in even steps.
    pub(in crate::commands) fn spread(&self, count: usize) -> Vec<Pose> {
        if let [pose] = self.all[..] {
            let turned = |i: usize| {
                let angle = std::f64::consts::PI * i as f64 / count as f64;
                Pose { orientation: pose.orientation * DQuat::from_axis_angle(DVec3::Z, angle), ..pose }
            };
            return (0..count).map(turned).collect();
        }
        session::evenly(count.min(self.all.len()), self.all.len()).map(|i| self.all[i]).collect()
    }
}

#[cfg(test)]
mod tests {
    use super::*;

    #[test]
    fn poses_are_spread_or_turned() {
        let at = |x: f64| Pose { position_mm: DVec3::new(x, 0.0, 0.0), orientation: DQuat::IDENTITY };
        let many = Poses { all: (0..100).map(|i| at(f64::from(i))).collect(), what: "" };
        let xs: Vec<f64> = many.spread(2).iter().map(|p| p.position_mm.x).collect();
        assert_eq!(xs, [25.0, 75.0]);
        assert_eq!(many.spread(200).len(), 100);
        let one = Poses { all: vec![at(1.0)], what: "" }.spread(2);
        assert_eq!(one[0], at(1.0));
        assert!((one[1].transform_vector(DVec3::X) - DVec3::Y).length() < 1e-12 && one[1].position_mm.x == 1.0);
    }
}
