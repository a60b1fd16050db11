//! The tracked needle in the scene: its pose, and the way of its tip.
//!
//! Frame of the needle: origin at the tip, z along the shaft from the hub to the tip, x to the side that the bevel's
//! facet faces.

mod estimate;
mod tip_watch;

use glam::DVec3;

use crate::pose::Pose;

pub use estimate::NeedleEstimate;
pub use tip_watch::{GAP_S, REPEAT_MM, TipEvent, TipEventKind, TipWatch};

/// The needle at one moment.
#[derive(Debug, Clone, Copy, PartialEq)]
pub struct Needle {
    /// Pose of the needle's frame in the scene.
    pub scene_from_needle: Pose,
    /// Whether the turn about the shaft is known. A sensor of five degrees of freedom doesn't measure it.
    pub bevel_known: bool,
}

impl Needle {
    /// Position of the tip in the scene, mm.
    pub fn tip_mm(&self) -> DVec3 {
        self.scene_from_needle.position_mm
    }

    /// Unit vector along the shaft from the hub to the tip, in the scene.
    pub fn direction(&self) -> DVec3 {
        self.scene_from_needle.transform_vector(DVec3::Z)
    }
}
