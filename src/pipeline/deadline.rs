//! Chooses between the raw, the generated and a held generated picture of each frame, by deadline and with hysteresis
//! against flicker.

use std::time::Duration;

use crate::pose::Pose;
use crate::presented::FrameSource;
use crate::settings::ChoiceSettings;

/// Upper limit of `frames_required`.
const FRAMES_REQUIRED_MAX: u32 = 256;

/// Whether the poses `held` and `pose` are so close that a picture taken at `held` may be shown for `pose`.
pub(super) fn near(settings: &ChoiceSettings, held: &Pose, pose: &Pose) -> bool {
    held.position_mm.distance(pose.position_mm) <= settings.hold_mm
        && held.orientation.angle_between(pose.orientation).to_degrees() <= settings.hold_deg
}

/// Chooses the picture of each frame. It has no clock: its owner reports which pictures were ready.
#[derive(Debug)]
pub(super) struct DeadlineChooser {
    settings: ChoiceSettings,
    /// Whether generated pictures are currently shown.
    generated: bool,
    /// Number of consecutive frames whose own generated picture was ready before the deadline.
    in_time: u32,
    last_in_time: Option<u64>,
    /// Number of consecutive frames for which a held picture (the last generated one) could have been shown.
    near: u32,
    /// Number of consecutive frames that must be in time before generated pictures are shown. Doubled if raw frames
    /// return soon after a switch to generated pictures.
    frames_required: u32,
    /// Number of frames since the last switch to or from generated pictures.
    since_change: u32,
}

impl DeadlineChooser {
    /// A chooser that shows raw frames until enough consecutive generated pictures were in time.
    pub(super) fn new(settings: ChoiceSettings) -> Self {
        let frames_required = settings.steady_frames.clamp(1, FRAMES_REQUIRED_MAX);
        Self { settings, generated: false, in_time: 0, last_in_time: None, near: 0, frames_required, since_change: 0 }
    }

    /// Whether to wait for the frame's own generated picture: generated pictures are shown, or may be shown from this
    /// frame on.
    pub(super) fn waits(&self) -> bool {
        self.generated || self.in_time >= self.frames_required
    }

    /// Reports that the generated picture of frame `number` was ready at the time `ready`. It is in time if `ready`
    /// is not after `deadline`.
    pub(super) fn ready(&mut self, number: u64, ready: Duration, deadline: Duration) {
        if ready > deadline {
            self.in_time = 0;
            return;
        }
        let follows = self.last_in_time.is_some_and(|last| last.wrapping_add(1) == number);
        self.in_time = if follows { self.in_time.saturating_add(1) } else { 1 };
        self.last_in_time = Some(number);
    }

    /// Chooses the next frame's picture. `own_ready`: the frame's own generated picture is ready. `held_near`: the last
    /// generated picture is close enough in pose to be shown again.
    pub(super) fn choose(&mut self, own_ready: bool, held_near: bool) -> FrameSource {
        self.near = if held_near { self.near.saturating_add(1) } else { 0 };
        self.since_change = self.since_change.saturating_add(1);
        if self.generated && !own_ready && !held_near {
            // A switch back soon after the switch to generated pictures: the generator is at its limit.
            self.frames_required = match self.since_change {
                soon if soon <= 4 * self.frames_required => (2 * self.frames_required).min(FRAMES_REQUIRED_MAX),
                _ => self.settings.steady_frames.clamp(1, FRAMES_REQUIRED_MAX),
            };
            (self.generated, self.in_time, self.near, self.since_change) = (false, 0, 0, 0);
        } else if !self.generated && self.in_time.max(self.near) >= self.frames_required && (own_ready || held_near) {
            (self.generated, self.since_change) = (true, 0);
        }
        match (self.generated, own_ready) {
            (false, _) => FrameSource::Raw,
            (true, true) => FrameSource::Generated,
            (true, false) => FrameSource::HeldGenerated,
        }
    }

    /// Resets to raw frames: the generator was switched off, or there is no picture.
    pub(super) fn reset(&mut self) {
        (self.generated, self.in_time, self.near, self.last_in_time) = (false, 0, 0, None);
    }
}

#[cfg(test)]
mod tests {
    use glam::{DQuat, DVec3};

    use super::FrameSource::{Generated, HeldGenerated, Raw};
    use super::*;

    const SETTINGS: ChoiceSettings = ChoiceSettings { hold_mm: 0.5, hold_deg: 0.5, steady_frames: 3 };
    const MS: Duration = Duration::from_millis(1);

    /// Choices for `frames` frames; frame n has its own picture in time if `ready(n)`.
    fn run(chooser: &mut DeadlineChooser, first: u64, ready: impl Fn(u64) -> bool, frames: u64) -> Vec<FrameSource> {
        (first..first + frames)
            .map(|n| {
                chooser.ready(n, if ready(n) { MS } else { MS * 3 }, MS * 2);
                chooser.choose(ready(n), false)
            })
            .collect()
    }

    #[test]
    fn a_steady_generator_is_shown_after_its_row_and_then_always() {
        let shown = run(&mut DeadlineChooser::new(SETTINGS), 0, |_| true, 100);
        assert_eq!(shown[..4], [Raw, Raw, Generated, Generated]);
        assert!(shown[2..].iter().all(|s| *s == Generated));
    }

    #[test]
    fn a_generator_in_time_for_every_other_frame_is_never_shown() {
        assert!(run(&mut DeadlineChooser::new(SETTINGS), 0, |n| n % 2 == 0, 1000).iter().all(|s| *s == Raw));
    }

    #[test]
    fn a_generator_at_its_limit_changes_the_picture_ever_more_rarely() {
        let shown = run(&mut DeadlineChooser::new(SETTINGS), 0, |n| n % 10 != 9, 2000);
        let changes: Vec<_> = (1..shown.len()).filter(|&i| shown[i] != shown[i - 1]).collect();
        assert!(changes.len() <= 6, "{changes:?}");
        assert!(changes.iter().all(|&i| i < 100), "{changes:?}");
        let pairs = shown.windows(3).filter(|w| w[0] == w[2] && w[0] != w[1]).count();
        assert_eq!(pairs, 0, "never back and forth within three frames");
    }

    #[test]
    fn one_miss_after_a_long_time_does_not_cost_more_than_a_row() {
        let mut chooser = DeadlineChooser::new(SETTINGS);
        run(&mut chooser, 0, |_| true, 1000);
        let shown = run(&mut chooser, 1000, |n| n != 1000, 5);
        assert_eq!(shown, [Raw, Raw, Raw, Generated, Generated]);
    }

    #[test]
    fn a_slow_generator_is_held_while_the_probe_rests_and_never_beyond() {
        let mut chooser = DeadlineChooser::new(SETTINGS);
        let mut frame = |near| {
            chooser.ready(0, MS * 9, MS);
            chooser.choose(false, near)
        };
        let shown: Vec<_> = [false, true, true, true, true, false, true].into_iter().map(&mut frame).collect();
        use Raw as R;
        assert_eq!(shown, [R, R, R, HeldGenerated, HeldGenerated, R, R]);
    }

    #[test]
    fn near_is_near_in_position_and_in_angle() {
        let pose = |x: f64, deg: f64| Pose {
            position_mm: DVec3::X * x,
            orientation: DQuat::from_rotation_y(deg.to_radians()),
        };
        let origin = pose(0.0, 0.0);
        assert!(near(&SETTINGS, &origin, &pose(0.4, 0.4)));
        assert!(!near(&SETTINGS, &origin, &pose(0.6, 0.0)));
        assert!(!near(&SETTINGS, &origin, &pose(0.0, 0.6)));
        let negated = Pose { orientation: -origin.orientation, ..origin };
        assert!(near(&SETTINGS, &origin, &negated), "q and -q are one rotation");
    }
}
