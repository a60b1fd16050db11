//! Panels of a scene's picture: one projection each, joined into the finished picture.

use glam::DVec3;

use super::camera::Camera;

/// A colour picture.
#[derive(Debug, Clone, PartialEq)]
pub struct Picture {
    /// Width, pixels.
    pub width: u32,
    /// Height, pixels.
    pub height: u32,
    /// Red, green and blue levels [height × width × 3].
    pub rgb: Vec<u8>,
}

/// A projection without its annotations.
pub(super) struct Panel {
    pub(super) width: u32,
    pub(super) height: u32,
    pub(super) rgb: Vec<u8>,
    /// Tissues that are visible, one bit each.
    pub(super) seen: [u64; 4],
    pub(super) camera: Camera,
    pub(super) outline: Vec<DVec3>,
}
