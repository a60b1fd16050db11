//! What a tracker says at one time.

use glam::{DQuat, DVec3};

use super::Pose;

/// What a sensor measured.
#[derive(Debug, Clone, Copy, PartialEq)]
pub enum Reading {
    /// Position and orientation of the sensor in the tracker's frame.
    Pose(Pose),
    /// Orientation alone, of a device that knows no position: a unit quaternion that turns sensor axes into the
    /// tracker's.
    Orientation(DQuat),
    /// How far a puck is pushed and turned: −1..=1 on each axis, to be integrated over time.
    Rates {
        /// Along x, y, z.
        translation: DVec3,
        /// About x, y, z.
        rotation: DVec3,
    },
    /// The device is there and says that it doesn't see the sensor.
    OutOfView,
}

/// A [`Reading`] and when it was made.
#[derive(Debug, Clone, Copy, PartialEq)]
pub struct Measurement {
    /// When its first byte reached the host, ns since 1970 (UTC).
    pub host_time_ns: u64,
    /// Clock of the tracker, µs from its own origin, where it has one.
    pub device_time_us: Option<u64>,
    /// Counter of the tracker, where it has one; it wraps at 2³².
    pub sequence: Option<u32>,
    /// What was measured.
    pub reading: Reading,
}
