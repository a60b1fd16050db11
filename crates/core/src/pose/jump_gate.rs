//! Detection of poses that a hand cannot reach in time: tracker spikes, or a probe moved while hidden.

use super::Pose;
use super::transform::angle_between;

/// Shortest interval over which a speed is computed, s: between records of one message, noise would look like speed.
const LEAST_S: f64 = 0.01;

/// Verdict on a pose.
#[derive(Debug, Clone, Copy, PartialEq, Eq)]
pub enum Gate {
    /// Within a hand's reach of the last pose.
    Passed,
    /// Out of a hand's reach; the pose is held back until the next pose decides.
    Spike,
    /// Out of a hand's reach from the last pose, but near the pose that was held back: the jump is confirmed.
    Jumped,
}

/// Gate that rejects a pose too far from the last one, unless the next pose confirms it.
#[derive(Debug, Clone)]
pub struct JumpGate {
    max_speed_mm_s: f64,
    max_speed_rad_s: f64,
    /// Last pose that passed, with its time, s.
    last: Option<(Pose, f64)>,
    /// Pose that is held back, with its time, s.
    spike: Option<(Pose, f64)>,
}

impl JumpGate {
    /// Gate with these limits of a hand's translational and angular speed.
    pub fn new(max_speed_mm_s: f64, max_speed_deg_s: f64) -> Self {
        Self { max_speed_mm_s, max_speed_rad_s: max_speed_deg_s.to_radians(), last: None, spike: None }
    }

    /// Forgets all poses; the next one passes.
    pub(crate) fn reset(&mut self) {
        self.last = None;
        self.spike = None;
    }

    /// Judges the pose at `time_s`; times must rise.
    pub fn push(&mut self, pose: Pose, time_s: f64) -> Gate {
        let near = |from: &Option<(Pose, f64)>| from.is_some_and(|from| self.is_reachable(&from, &pose, time_s));
        let verdict = if self.last.is_none() || near(&self.last) {
            Gate::Passed
        } else if near(&self.spike) {
            Gate::Jumped
        } else {
            self.spike = Some((pose, time_s));
            return Gate::Spike;
        };
        self.last = Some((pose, time_s));
        self.spike = None;
        verdict
    }

    fn is_reachable(&self, (from, from_s): &(Pose, f64), to: &Pose, to_s: f64) -> bool {
        let dt_s = (to_s - from_s).max(LEAST_S);
        from.position_mm.distance(to.position_mm) <= self.max_speed_mm_s * dt_s
            && angle_between(from.orientation, to.orientation) <= self.max_speed_rad_s * dt_s
    }
}

#[cfg(test)]
mod tests {
    use glam::{DQuat, DVec3};

    use super::*;

    fn verdicts(xs: &[f64]) -> Vec<Gate> {
        let mut gate = JumpGate::new(3000.0, 2000.0);
        let pose = |x: f64| Pose { position_mm: DVec3::X * x, ..Pose::IDENTITY };
        xs.iter().enumerate().map(|(i, x)| gate.push(pose(*x), i as f64 / 60.0)).collect()
    }

    #[test]
    fn a_spike_is_held_back_and_a_jump_is_confirmed() {
        use Gate::{Jumped, Passed, Spike};
        assert_eq!(verdicts(&[0.0, 20.0, 500.0, 22.0, 24.0]), [Passed, Passed, Spike, Passed, Passed]);
        assert_eq!(verdicts(&[0.0, 300.0, 301.0, 302.0]), [Passed, Spike, Jumped, Passed]);
        assert_eq!(verdicts(&[0.0, 300.0, -300.0, 900.0, 901.0]), [Passed, Spike, Spike, Spike, Jumped]);
    }

    #[test]
    fn rotations_are_judged_too_and_slow_trackers_may_move_farther() {
        let mut gate = JumpGate::new(3000.0, 2000.0);
        let turned = |angle| Pose { orientation: DQuat::from_rotation_y(angle), ..Pose::IDENTITY };
        assert_eq!(gate.push(turned(0.0), 0.0), Gate::Passed);
        assert_eq!(gate.push(turned(3.0), 0.016), Gate::Spike);
        assert_eq!(gate.push(turned(3.0), 0.116), Gate::Passed, "180° in a tenth of a second are within 2000°/s");
    }
}
