//! Readings and time-stamped measurements of a tracker.

use glam::{DQuat, DVec3};

use super::Pose;

/// Value measured by a sensor.
#[derive(Debug, Clone, Copy, PartialEq)]
pub enum Reading {
    /// Position and orientation of the sensor in the tracker's frame.
    Pose(Pose),
    /// Orientation of a device that measures no position: a unit quaternion that turns sensor axes into the tracker's.
    Orientation(DQuat),
    /// Deflection of a puck (a SpaceMouse), −1..=1 on each axis, to be integrated over time.
    Rates {
        /// Deflection along x, y, z.
        translation: DVec3,
        /// Deflection about x, y, z.
        rotation: DVec3,
    },
    /// Report of a connected device that the sensor is out of view.
    OutOfView,
}

/// A [`Reading`] with its times.
#[derive(Debug, Clone, Copy, PartialEq)]
pub struct Measurement {
    /// Arrival of the measurement's first byte at the host, ns since 1970 (UTC).
    pub host_time_ns: u64,
    /// Clock of the tracker, µs from its own origin; `None` if it has none.
    pub device_time_us: Option<u64>,
    /// Counter of the tracker, which wraps at 2³²; `None` if it has none.
    pub sequence: Option<u32>,
    /// Value measured.
    pub reading: Reading,
}
