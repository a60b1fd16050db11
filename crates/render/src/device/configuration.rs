//! Buffers, dispatches and read-back slots of one configuration on the device.

use std::sync::Arc;

use super::buffers::{Buffers, SceneBuffers};
use super::dispatches::Frames;
use super::gpu::Gpu;
use super::passes::Pipelines;
use super::readback::{Shape, Slot};
use crate::batch_plan::{BatchPlan, SEGMENT_BYTES_LEAST};
use crate::configuration::{Configuration, FrameInputs};
use crate::error::BackendError;
use crate::frame::{Contents, FRAMES_IN_FLIGHT};

/// Buffers and dispatches of one configuration.
#[derive(Debug)]
pub(super) struct DeviceConfiguration {
    pub(super) batches: BatchPlan,
    pub(super) buffers: Buffers,
    pub(super) frames: Frames,
    pub(super) slots: Vec<Arc<Slot>>,
}

impl DeviceConfiguration {
    /// Buffers and passes whose dispatches make `frames` frames. Equal parts are shared with `previous`, which is
    /// unchanged until [`Buffers::fill`].
    ///
    /// # Errors
    /// Sizes beyond the device's limits or memory, or a pass that the device refuses.
    pub(super) fn new(
        gpu: &Gpu,
        scene: &SceneBuffers,
        pipelines: &mut Pipelines,
        inputs: FrameInputs<'_>,
        previous: Option<&Self>,
        frames: u32,
    ) -> Result<Self, BackendError> {
        let Configuration { settings, params, .. } = inputs.configuration;
        let segment_bytes_max = pipelines.segment_bytes_max(gpu);
        let (batches, buffers) = planned(gpu, segment_bytes_max, inputs.configuration, previous, frames)?;
        let dispatches = Frames::new(gpu, pipelines, scene, &buffers, batches, inputs)?;
        let most = dispatches.of(Contents { image: true, maps: true }).len();
        let slots = slots(gpu, &Shape::of(params, settings.lines, most), previous, frames)?;
        Ok(Self { batches, buffers, frames: dispatches, slots })
    }
}

/// Plans the batches of a configuration and makes its buffers. If memory is short for few large batches, it makes
/// batches of the least size.
fn planned(
    gpu: &Gpu,
    segment_bytes_max: u64,
    Configuration { settings, params, tables, .. }: &Configuration,
    previous: Option<&DeviceConfiguration>,
    frames: u32,
) -> Result<(BatchPlan, Buffers), BackendError> {
    let made = |bytes_max: u64| {
        let batches = BatchPlan::within(bytes_max, params);
        let previous = previous.map(|p| &p.buffers);
        let buffers = Buffers::new(gpu, tables, params, &batches, settings.lines, previous, frames)?;
        Ok((batches, buffers))
    };
    match made(segment_bytes_max) {
        Err(BackendError::Memory { .. }) if segment_bytes_max > SEGMENT_BYTES_LEAST => made(SEGMENT_BYTES_LEAST),
        made => made,
    }
}

/// Makes read-back slots of a shape; slots of `previous` are reused if their shape is the same.
fn slots(
    gpu: &Gpu,
    shape: &Shape,
    previous: Option<&DeviceConfiguration>,
    frames: u32,
) -> Result<Vec<Arc<Slot>>, BackendError> {
    let count = FRAMES_IN_FLIGHT * frames as usize;
    match previous {
        Some(previous) if previous.slots.len() == count && previous.slots[0].shape() == shape => {
            Ok(previous.slots.clone())
        }
        _ => (0..count).map(|_| Slot::new(gpu, shape).map(Arc::new)).collect(),
    }
}

#[cfg(test)]
mod tests {
    use glam::Vec3;
    use insonify_core::anatomy::analytic::{self, Part};
    use insonify_core::anatomy::{Bvh, TissueTable};
    use insonify_core::settings::{Choice, Effect, Quality, RenderSettings};
    use insonify_core::transducer::Probe;

    use super::*;
    use crate::batch_plan::PATH_BYTES;
    use crate::configuration::Media;
    use crate::device::ShaderSet;

    const WHOLE: Contents = Contents { image: true, maps: true };
    const IMAGE: Contents = Contents { image: true, maps: false };
    const MAPS: Contents = Contents { image: false, maps: true };

    /// Names of the passes of a frame of two layers, each with its batch, for each of `contents`. A batch holds one
    /// layer or both.
    fn passes<const N: usize>(aperture: Choice, layers_per_batch: u64, contents: [Contents; N]) -> [String; N] {
        let gpu = Gpu::open(true).unwrap();
        let mesh = analytic::sphere(Vec3::ZERO, 40.0, 3);
        let parts = vec![Part { name: "liver", tissue: "liver", priority: 1, mesh }];
        let scene = analytic::scene(parts, &TissueTable::builtin().unwrap(), "gel").unwrap();
        let bvh = Bvh::build(&scene).unwrap();
        let media = Media::new(&scene, &bvh);
        let probe = Probe { scanlines: 32, samples: 512.into(), ..Probe::default() };
        let mut settings = RenderSettings { quality: Quality { rays: 4, layers: 2, seed: 0 }, ..Default::default() };
        let on = [Effect::Scatterers, Effect::InterfaceEchoes].map(|effect| (effect, Choice::On));
        for (effect, choice) in on.into_iter().chain([(Effect::Aperture, aperture), (Effect::Noise, Choice::On)]) {
            settings.effects = settings.effects.with(effect, choice);
        }
        let configuration = Configuration::new(&media, &probe, &settings, None, &[]).unwrap();
        let inputs = FrameInputs { bvh: &bvh, media: &media, configuration: &configuration, angle: 0 };
        let scene = SceneBuffers::new(&gpu, &media.surface_words, &bvh).unwrap();
        let mut shaders = ShaderSet::default();
        // In addition to its rays, each of the 32 scanlines has an axial path.
        shaders.segment_bytes_max = Some(32 * (1 + 4 * layers_per_batch) * PATH_BYTES);
        let device = DeviceConfiguration::new(&gpu, &scene, &mut Pipelines::new(&shaders), inputs, None, 1).unwrap();
        contents.map(|contents| {
            let passes = device.frames.of(contents).iter();
            passes.map(|d| format!("{} {}", d.pass.shader().pass(), d.batch)).collect::<Vec<_>>().join(", ")
        })
    }

    #[test]
    fn maps_stand_between_the_passes_of_paths() {
        let [whole, image, maps] = passes(Choice::Off, 2, [WHOLE, IMAGE, MAPS]);
        let last = "lateral 0, receive 0, detect 0, scan_convert 0";
        let first = "locate 0, trace 0, section 0, march 0, section 0, percentile 0, echo 0";
        assert_eq!(whole, format!("{first}, {last}"));
        assert_eq!(image, format!("locate 0, trace 0, march 0, echo 0, {last}"));
        assert_eq!(maps, "section 0, section 0, percentile 0, scan_convert 0");
    }

    #[test]
    fn batches_are_traced_again_if_the_aperture_needs_all_of_them_first() {
        let last = "lateral 1, receive 1, detect 1, scan_convert 1";
        let [image] = passes(Choice::Off, 1, [IMAGE]);
        let batches = [0, 1].map(|batch| format!("locate {batch}, trace {batch}, march {batch}, echo {batch}"));
        assert_eq!(image, format!("{}, {last}", batches.join(", ")));

        let gain = |batch| format!("propagate {batch}, beams {batch}, profiles {batch}, visibility {batch}");
        let [image] = passes(Choice::On, 2, [IMAGE]);
        let first = format!("locate 0, trace 0, transmission 0, transmission 0, {}", gain(0));
        let once = format!("{first}, march 0, echo 0, {}", last.replace('1', "0"));
        assert_eq!(image, once);
        let [image] = passes(Choice::On, 1, [IMAGE]);
        let first = "locate 0, trace 0, transmission 0, locate 1, trace 1, transmission 1, transmission 1";
        assert_eq!(image, format!("{first}, {}, {}, {last}", gain(1), batches.join(", ")));
    }
}
