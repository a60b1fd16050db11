//! Renderer on this machine, for the pipeline.

use std::sync::Arc;
use std::time::Duration;

use super::parts::{FrameRenderer, ImageShape, RenderFault, RendererFactory};
use crate::anatomy::{Bvh, Scene};
use crate::exam::needle::{Exercise, NeedleWatch};
use crate::needle::{Needle, TipWatch};
use crate::pose::Pose;
use crate::render::{Backend, BackendError, ComputeDevice, Frame, RenderError, RenderSettings, Renderer};
use crate::transducer::Probe;

/// Factory of renderers for one scene on one backend. Reopens the backend after a loss.
pub struct LocalRendererFactory {
    backend: Backend,
    scene: Arc<Scene>,
    bvh: Arc<Bvh>,
}

impl LocalRendererFactory {
    /// A factory of renderers for `scene`.
    ///
    /// # Errors
    /// Fails if no BVH can be built for the scene.
    pub fn new(backend: Backend, scene: Arc<Scene>) -> Result<Self, RenderError> {
        Ok(Self { backend, bvh: Arc::new(Bvh::build(&scene)?), scene })
    }

    /// The same factory, except that a GPU that takes longer than `wait` for a frame counts as lost. Rendering on the
    /// processor has no limit.
    #[must_use]
    pub fn answering_within(self, wait: Duration) -> Self {
        let software = self.backend.is_software();
        Self { backend: if software { self.backend } else { self.backend.answering_within(wait) }, ..self }
    }

    /// A new watch of a needle's tip in the scene.
    pub(super) fn needle_watch(&self, exercise: Option<&Exercise>) -> NeedleWatch {
        NeedleWatch::new(TipWatch::with_bvh(&self.scene, self.bvh.clone()), &self.scene, exercise)
    }

    /// A renderer on the open backend.
    ///
    /// # Errors
    /// Errors of [`Renderer::new`].
    pub(crate) fn build_renderer(&self, probe: &Probe, settings: &RenderSettings) -> Result<Renderer, RenderError> {
        Renderer::with_bvh(&self.backend, &self.scene, self.bvh.clone(), probe, settings)
    }
}

impl RendererFactory for LocalRendererFactory {
    fn build(&mut self, probe: &Probe, settings: &RenderSettings) -> Result<Box<dyn FrameRenderer>, RenderFault> {
        self.backend = self.backend.reopen().map_err(|e| RenderFault::Lost(e.to_string()))?;
        Ok(Box::new(self.build_renderer(probe, settings).map_err(fault)?))
    }
}

/// Calls such as `Renderer::submit(self, …)` below reach the inherent functions, because these take precedence over
/// the trait's functions of the same name.
impl FrameRenderer for Renderer {
    fn shape(&self) -> ImageShape {
        let sector = self.sector();
        ImageShape { width: sector.width, height: sector.height, pixel_mm: sector.pixel_mm }
    }

    fn submit(&mut self, pose: &Pose) -> Result<(), RenderFault> {
        Renderer::submit(self, pose).map_err(fault)
    }

    fn receive(&mut self, frame: &mut Frame) -> Result<(), RenderFault> {
        Renderer::receive(self, frame).map_err(fault)
    }

    fn reconfigure(&mut self, probe: &Probe, settings: &RenderSettings) -> Result<(), RenderFault> {
        // Maps are switched on and off by `set_maps`, for each frame.
        let settings = RenderSettings { maps: self.settings().maps, ..*settings };
        Renderer::reconfigure(self, probe, &settings).map_err(fault)
    }

    fn renders_in_submit(&self) -> bool {
        self.on_host()
    }

    fn compute_device(&self) -> ComputeDevice {
        Renderer::compute_device(self)
    }

    fn set_time_s(&mut self, time_s: f64) {
        Renderer::set_time_s(self, time_s);
    }

    fn set_needle(&mut self, needle: Option<Needle>) {
        Renderer::set_needle(self, needle);
    }

    fn set_maps(&mut self, wanted: bool) {
        Renderer::set_maps(self, wanted);
    }

    fn skin_distance_mm(&self, pose: &Pose) -> Option<f64> {
        Renderer::skin_distance_mm(self, pose)
    }
}

/// Classifies an error: `Lost` if reopening the device may help, else `Refused`.
fn fault(error: RenderError) -> RenderFault {
    match error {
        RenderError::Backend(BackendError::Limit { .. } | BackendError::Memory { .. }) | RenderError::Settings(_) => {
            RenderFault::Refused(error.to_string())
        }
        _ => RenderFault::Lost(error.to_string()),
    }
}
