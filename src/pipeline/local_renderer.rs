//! The renderer on this machine, as the pipeline uses it.

use std::sync::Arc;

use super::parts::{FrameRenderer, ImageShape, RenderFault, RendererFactory};
use crate::anatomy::{Bvh, Scene};
use crate::pose::Pose;
use crate::render::{Backend, BackendError, Frame, RenderError, RenderSettings, Renderer};
use crate::transducer::Probe;

/// Makes renderers of one scene on one backend, which it opens again after a loss.
pub struct LocalRendererFactory {
    backend: Backend,
    scene: Arc<Scene>,
    bvh: Arc<Bvh>,
}

impl LocalRendererFactory {
    /// A factory of renderers of `scene`.
    ///
    /// # Errors
    /// A scene that can't be traced.
    pub fn new(backend: Backend, scene: Arc<Scene>) -> Result<Self, RenderError> {
        Ok(Self { backend, bvh: Arc::new(Bvh::build(&scene)?), scene })
    }

    /// A renderer on the open backend.
    ///
    /// # Errors
    /// As [`Renderer::new`].
    pub fn build_renderer(&self, probe: &Probe, settings: &RenderSettings) -> Result<Renderer, RenderError> {
        Renderer::with_bvh(&self.backend, &self.scene, self.bvh.clone(), probe, settings)
    }
}

impl RendererFactory for LocalRendererFactory {
    fn build(&mut self, probe: &Probe, settings: &RenderSettings) -> Result<Box<dyn FrameRenderer>, RenderFault> {
        self.backend = self.backend.reopen().map_err(|e| RenderFault::Lost(e.to_string()))?;
        Ok(Box::new(self.build_renderer(probe, settings).map_err(fault)?))
    }
}

/// `Renderer::…` names its own functions, which take precedence over those of the trait.
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
        // Whether there are maps is chosen for each frame.
        let settings = RenderSettings { maps: self.settings().maps, ..*settings };
        Renderer::reconfigure(self, probe, &settings).map_err(fault)
    }

    fn on_processors(&self) -> bool {
        self.on_host()
    }

    fn set_time_s(&mut self, time_s: f64) {
        Renderer::set_time_s(self, time_s);
    }

    fn set_maps(&mut self, wanted: bool) {
        Renderer::set_maps(self, wanted);
    }
}

/// Sorts an error by whether another device may mend it.
fn fault(error: RenderError) -> RenderFault {
    match error {
        RenderError::Backend(BackendError::Limit { .. } | BackendError::Memory { .. }) | RenderError::Settings(_) => {
            RenderFault::Refused(error.to_string())
        }
        _ => RenderFault::Lost(error.to_string()),
    }
}
