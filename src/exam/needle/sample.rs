//! Poses of probe and needle at one moment.

use crate::needle::Needle;
use crate::pose::Pose;

/// Poses of both tools at one moment of a session.
#[derive(Debug, Clone, Copy, PartialEq)]
pub struct Sample {
    /// Time since the session's start, which is also the time of a moving scene, s.
    pub time_s: f64,
    /// `scene_from_probe`; `None` while the probe is not tracked.
    pub probe: Option<Pose>,
    /// The needle; `None` while it is not tracked.
    pub needle: Option<Needle>,
}
