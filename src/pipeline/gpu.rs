//! The renderer on a graphics device, as the pipeline uses it.

use std::sync::Arc;

use super::parts::{FrameRenderer, ImageShape, RenderFault, RendererFactory};
use crate::anatomy::{Bvh, Scene};
use crate::pose::Pose;
use crate::render::{Climbed, Frame, Gpu, GpuError, GpuOptions, RenderError, RenderSettings, Renderer, ShaderSet};
use crate::transducer::Probe;

/// A renderer that can be configured anew.
pub struct GpuRenderer {
    renderer: Renderer,
}

/// Opens devices and makes renderers of one scene.
pub struct GpuFactory {
    options: GpuOptions,
    scene: Arc<Scene>,
    bvh: Arc<Bvh>,
}

impl GpuFactory {
    /// For `scene`, on devices of `options`.
    ///
    /// # Errors
    /// A scene that can't be traced.
    pub fn new(options: GpuOptions, scene: Arc<Scene>) -> Result<Self, RenderError> {
        Ok(Self { options, bvh: Arc::new(Bvh::build(&scene)?), scene })
    }

    /// A renderer on an open device.
    ///
    /// # Errors
    /// As [`Renderer::new`].
    pub fn build_on(&self, gpu: &Gpu, probe: &Probe, settings: &RenderSettings) -> Result<GpuRenderer, RenderError> {
        let (bvh, shaders) = (self.bvh.clone(), ShaderSet::default());
        Ok(GpuRenderer { renderer: Renderer::with_shaders(gpu, &self.scene, bvh, probe, settings, &shaders)? })
    }
}

impl GpuRenderer {
    /// As [`Renderer::choose_quality`].
    ///
    /// # Errors
    /// As [`Renderer::choose_quality`].
    pub fn choose_quality(
        &mut self,
        probe: &Probe,
        settings: &RenderSettings,
        poses: &[Pose],
        budget_ms: f64,
    ) -> Result<Climbed, RenderError> {
        self.renderer.choose_quality(probe, settings, poses, budget_ms)
    }
}

impl RendererFactory for GpuFactory {
    fn build(&mut self, probe: &Probe, settings: &RenderSettings) -> Result<Box<dyn FrameRenderer>, RenderFault> {
        let gpu = Gpu::new(&self.options).map_err(|e| RenderFault::Lost(e.to_string()))?;
        Ok(Box::new(self.build_on(&gpu, probe, settings).map_err(fault)?))
    }
}

impl FrameRenderer for GpuRenderer {
    fn shape(&self) -> ImageShape {
        let sector = self.renderer.sector();
        ImageShape { width: sector.width, height: sector.height, pixel_mm: sector.pixel_mm }
    }

    fn submit(&mut self, pose: &Pose) -> Result<(), RenderFault> {
        self.renderer.submit(pose).map_err(fault)
    }

    fn receive(&mut self, frame: &mut Frame) -> Result<(), RenderFault> {
        self.renderer.receive(frame).map_err(fault)
    }

    fn reconfigure(&mut self, probe: &Probe, settings: &RenderSettings) -> Result<(), RenderFault> {
        // Whether there are maps is chosen for each frame.
        let settings = RenderSettings { maps: self.renderer.settings().maps, ..*settings };
        self.renderer.reconfigure(probe, &settings).map_err(fault)
    }

    fn on_processors(&self) -> bool {
        self.renderer.on_host()
    }

    fn set_time_s(&mut self, time_s: f64) {
        self.renderer.set_time_s(time_s);
    }

    fn set_maps(&mut self, wanted: bool) {
        self.renderer.set_maps(wanted);
    }
}

/// What of an error another device may mend.
fn fault(error: RenderError) -> RenderFault {
    match error {
        RenderError::Gpu(GpuError::Limit { .. } | GpuError::Memory { .. })
        | RenderError::Probe(_)
        | RenderError::Settings(_) => RenderFault::Refused(error.to_string()),
        _ => RenderFault::Lost(error.to_string()),
    }
}
