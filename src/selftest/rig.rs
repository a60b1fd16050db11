//! Renderer of a self-test, and the checks common to all frames.

use super::Check;
use super::bench::{linear, small};
use crate::anatomy::{Bvh, Scene};
use crate::pose::Pose;
use crate::render::{Frame, RenderError, RenderSettings, Renderer, Snapshot};
use crate::transducer::{Probe, Sector};

/// Function that creates a renderer of a scene.
pub(super) type NewRenderer<'a> = dyn Fn(&Scene, Bvh, &Probe, &RenderSettings) -> Result<Renderer, RenderError> + 'a;

/// Renderer of all specimens, with counts of faults in its frames.
pub(super) struct Rig {
    renderer: Renderer,
    frame: Frame,
    frames: u32,
    not_finite: u64,
    lost: u64,
}

impl Rig {
    pub(super) fn new(scene: &Scene, new: &NewRenderer<'_>) -> Result<Self, RenderError> {
        let (probe, settings) = (linear(8, 0.5, 64, 50.0), small(1, 1));
        let renderer = new(scene, Bvh::build(scene)?, &probe, &settings)?;
        Ok(Self { renderer, frame: Frame::default(), frames: 0, not_finite: 0, lost: 0 })
    }

    /// Renders a frame and counts its faults.
    pub(super) fn frame(
        &mut self,
        probe: &Probe,
        settings: &RenderSettings,
        pose: &Pose,
    ) -> Result<&Frame, RenderError> {
        self.renderer.reconfigure(probe, settings)?;
        self.renderer.render(pose, &mut self.frame)?;
        self.frames += 1;
        let reals = self.frame.lines.iter().flatten().chain(&self.frame.attenuation);
        self.not_finite += reals.filter(|v| !v.is_finite()).count() as u64;
        self.lost += u64::from(self.frame.overflows);
        Ok(&self.frame)
    }

    /// Sets the scene time; each time has other receiver noise.
    pub(super) fn set_time_s(&mut self, time_s: f64) {
        self.renderer.set_time_s(time_s);
    }

    /// Renders a frame, and returns all inputs and outputs of its passes.
    pub(super) fn snapshot(
        &mut self,
        probe: &Probe,
        settings: &RenderSettings,
        pose: &Pose,
    ) -> Result<Snapshot, RenderError> {
        self.renderer.reconfigure(probe, settings)?;
        self.renderer.snapshot(pose)
    }

    /// Geometry of the sector in the image.
    pub(super) fn sector(&self) -> Sector {
        *self.renderer.sector()
    }

    /// Checks that no frame so far had invalid values or lost paths.
    pub(super) fn checks(&self) -> [Check; 2] {
        [("values that are not finite", self.not_finite), ("paths or crossings lost", self.lost)].map(
            |(what, count)| Check::zero("Soundness", format!("{what}, in {} frames", self.frames), count as f64, 0.0),
        )
    }
}
