//! Buffers, passes and read-back slots of one configuration on the device.

use std::sync::Arc;

use super::buffers::{Buffers, SceneBuffers};
use super::gpu::Gpu;
use super::passes::{Constants, Pass, Pipelines};
use super::readback::{Shape, Slot, takes};
use crate::render::configuration::{Configuration, FrameInputs};
use crate::render::error::BackendError;
use crate::render::frame::{Contents, FRAMES_IN_FLIGHT};
use crate::settings::Effect;

/// Buffers and passes of one configuration.
#[derive(Debug)]
pub(super) struct DeviceConfiguration {
    pub(super) buffers: Buffers,
    pub(super) path_passes: Vec<Pass>,
    pub(super) image_passes: Vec<Pass>,
    /// Last of `image_passes` for frames without maps.
    scan_convert_image: Pass,
    pub(super) slots: [Arc<Slot>; FRAMES_IN_FLIGHT],
}

impl DeviceConfiguration {
    /// Makes whatever differs from `previous`, and shares the rest with it. `previous` is unchanged until
    /// [`Buffers::fill`].
    ///
    /// # Errors
    /// Sizes beyond the device's limits or memory, or a pass that it refuses.
    pub(super) fn new(
        gpu: &Gpu,
        scene: &SceneBuffers,
        pipelines: &mut Pipelines,
        inputs: FrameInputs<'_>,
        previous: Option<&Self>,
    ) -> Result<Self, BackendError> {
        let Configuration { settings, effects, params, tables, batches, .. } = inputs.configuration;
        let on = effects.effects();
        let buffers = Buffers::new(gpu, tables, params, batches, settings.lines, previous.map(|p| &p.buffers))?;

        let mut pass = |name, groups, constants: Constants<'_>| {
            Pass::new(gpu, pipelines, (scene, &buffers), name, groups, constants)
        };
        let path_groups = [params.paths(batches.layers_per_batch).div_ceil(64), 1, 1];
        let samples_by = |run: u32| [params.row_samples.div_ceil(64 * run), params.scanlines, 1];
        let pixels = [params.sector_words.div_ceil(128), 1, 1];
        let flag = |on: bool| f64::from(u8::from(on));
        let keep = [("KEEP_LINES", flag(settings.lines))];
        let trace = [
            ("MOVING", flag(inputs.media.moving && on.has(Effect::Motion))),
            ("REFRACTION", flag(on.has(Effect::Refraction))),
            ("INTERFACE_ECHOES", flag(on.has(Effect::InterfaceEchoes))),
            ("ROUGHNESS", flag(on.has(Effect::Roughness))),
            ("REFLECTIONS", flag(on.has(Effect::Reflections))),
        ];
        let mut path_passes = vec![pass("locate", path_groups, &[])?, pass("trace", path_groups, &trace)?];
        if on.has(Effect::Scatterers) {
            let march = [("ELEVATIONAL_SPECKLE", flag(on.has(Effect::ElevationalSpeckle)))];
            path_passes.push(pass("march", samples_by(8), &march)?);
        }
        if on.has(Effect::InterfaceEchoes) {
            path_passes.push(pass("echo", [params.scanlines.div_ceil(16), 1, 1], &[])?);
        }
        let image_passes = vec![
            pass("lateral", [params.row_samples.div_ceil(256), params.scanlines.div_ceil(4), 1], &[])?,
            pass("detect", samples_by(8), &keep)?,
            pass("section", [params.map_rays.div_ceil(32), 1, 1], &[])?,
            pass("percentile", [1, 1, 1], &[])?,
            pass("scan_convert", pixels, &[("MAPS", 1.0)])?,
        ];
        let scan_convert_image = pass("scan_convert", pixels, &[("MAPS", 0.0)])?;

        let of_paths = (0..batches.batches).flat_map(|_| &path_passes);
        let shape = Shape {
            width: params.image.width,
            height: params.image.height,
            row_words: params.row_words,
            lines: if settings.lines { params.scanlines } else { 0 },
            samples: params.samples,
            row_samples: params.row_samples,
            passes: of_paths.chain(&image_passes).map(|pass| pass.name).collect(),
        };
        let slots = match previous {
            Some(previous) if *previous.slots[0].shape() == shape => previous.slots.clone(),
            _ => [Arc::new(Slot::new(gpu, &shape)?), Arc::new(Slot::new(gpu, &shape)?)],
        };
        Ok(Self { buffers, path_passes, image_passes, scan_convert_image, slots })
    }

    /// Passes of a frame after the path passes, in order.
    pub(super) fn image_passes(&self, contents: Contents) -> impl Iterator<Item = &Pass> {
        let taken = self.image_passes.iter().filter(move |pass| takes(contents, pass.name));
        taken.map(move |pass| {
            let image_alone = !contents.maps && pass.name == self.scan_convert_image.name;
            if image_alone { &self.scan_convert_image } else { pass }
        })
    }
}
