//! Choice of threads or lanes for `trace` on a device: requested, or measured once per adapter and driver.

use std::sync::{Arc, OnceLock};
use std::time::{Duration, Instant};

use glam::DVec3;
use insonify_core::files::cache_directory;
use insonify_core::pose::Pose;
use insonify_core::settings::Effect;

use super::buffers::SceneBuffers;
use super::configuration::DeviceConfiguration;
use super::gpu::Gpu;
use super::passes::{Pass, Pipelines};
use super::snapshot;
use super::trace_dispatch::TraceDispatch;
use crate::configuration::FrameInputs;
use crate::constants::PATH_LANES;
use crate::error::BackendError;
use crate::frame::Contents;
use crate::trace_by::TraceBy;
use crate::trace_cache;
use crate::trace_times::{TraceChoice, TraceTimes};

/// Time after which no further round of measurements begins.
const MEASURED_WITHIN: Duration = Duration::from_millis(200);
/// Most rounds of measurements at each pose.
const ROUNDS: usize = 3;
/// Dispatches timed together.
const DISPATCHES: u32 = 2;
/// Numbers of paths that are measured: a low-quality frame, and a high-quality frame.
const MEASURED_PATHS: [u32; 2] = [256, 24_832];
/// Least fraction of paths that must have the same number of segments by threads and by lanes.
const ALIKE: f64 = 0.99;

/// Reason why lanes can't share a path; `None` if they can. `sizes` are the least and greatest size of a subgroup.
fn unfit(has_subgroups: bool, sizes: [u32; 2]) -> Option<String> {
    if !has_subgroups {
        return Some("it has no subgroup operations".to_owned());
    }
    let whole = sizes.iter().all(|size| size.is_multiple_of(PATH_LANES)) && sizes[0] >= PATH_LANES;
    (!whole).then(|| format!("its subgroups have {} to {} lanes, a path takes {PATH_LANES}", sizes[0], sizes[1]))
}

impl Gpu {
    /// Reason why lanes of this device can't share a path; `None` if they can.
    fn lanes_unfit(&self) -> Option<String> {
        unfit(self.device.features().contains(wgpu::Features::SUBGROUP), self.subgroup_sizes())
    }

    /// Whether `trace` can run by lanes.
    pub(crate) fn has_trace_by_lanes(&self) -> bool {
        self.lanes_unfit().is_none()
    }

    /// Sets how the device runs `trace`.
    ///
    /// # Errors
    /// Lanes are asked for, but the device's subgroups don't fit.
    pub(crate) fn tracing_by(mut self, by: TraceBy) -> Result<Self, BackendError> {
        if let Some(reason) = self.lanes_unfit().filter(|_| by == TraceBy::Lanes) {
            return Err(BackendError::NoLanes { adapter: self.adapter_name(), reason });
        }
        self.trace = Arc::new(OnceLock::from(TraceChoice::from(by)));
        Ok(self)
    }

    /// How the device runs `trace`, in words; `None` before the first renderer.
    pub(crate) fn trace(&self) -> Option<String> {
        self.trace.get().map(TraceChoice::to_string)
    }

    /// How to run `trace` for a batch of `paths` paths.
    pub(super) fn trace_by(&self, paths: u32) -> TraceBy {
        self.trace.get().copied().unwrap_or_default().of(paths)
    }

    /// Chooses how to run `trace`, unless that was done before. On a GPU whose subgroups fit, both ways are measured
    /// once in the scene, and the cache directory keeps the times.
    pub(super) fn choose_trace(&self, scene: &SceneBuffers, pipelines: &mut Pipelines, inputs: FrameInputs<'_>) {
        self.trace.get_or_init(|| {
            if self.is_software() || !self.has_trace_by_lanes() {
                return TraceChoice::default();
            }
            let measured = || match measure(self, scene, pipelines, inputs) {
                Ok(times) => times,
                Err(error) => {
                    tracing::warn!("trace by lanes was not measured: {error}");
                    None
                }
            };
            let key = [&self.adapter_name()[..], &self.driver()];
            let times = trace_cache::known_or_measured(&cache_directory(), key, measured);
            times.map_or_else(TraceChoice::default, |times| times.choice())
        });
    }
}

/// Measures both ways with few and with many paths, from three sides through the middle of the scene. `None` if the
/// ways find different paths, since lanes must then be wrong.
///
/// # Errors
/// A device that fails, or refuses a pass.
fn measure(
    gpu: &Gpu,
    scene: &SceneBuffers,
    pipelines: &mut Pipelines,
    inputs: FrameInputs<'_>,
) -> Result<Option<TraceTimes>, BackendError> {
    let configuration = inputs.configuration;
    let device = DeviceConfiguration::new(gpu, scene, pipelines, inputs, None, 1)?;
    let bends = configuration.effects.effects().has(Effect::Refraction);
    device.buffers.fill(gpu, &configuration.tables, bends, None);
    let [locate, ..] = device.frames.of(Contents { image: true, maps: false }) else { return Ok(None) };
    let paths = device.batches.params(0, &configuration.params).paths();
    let mut passes = Vec::new();
    for measured in MEASURED_PATHS {
        for by in [TraceBy::Path, TraceBy::Lanes] {
            // To fill up the number of paths, the same paths are traced several times; all copies write the same
            // values.
            let copies = (measured / paths.max(1)).max(1);
            let trace = TraceDispatch::new(gpu, inputs, by, measured.min(paths), copies);
            let TraceDispatch { shader, groups, constants } = &trace;
            let (buffers, bound) = (&device.buffers, TraceDispatch::buffers(scene, &device.buffers));
            passes.push(Pass::of_frame(gpu, pipelines, buffers, *shader, *groups, constants, &bound)?);
        }
    }
    let run = |pass: &Pass, times: u32| -> Result<f64, BackendError> {
        let mut encoder = gpu.device.create_command_encoder(&wgpu::CommandEncoderDescriptor::default());
        encoder.clear_buffer(&device.buffers.segment_counts, 0, None);
        for _ in 0..times {
            pass.record(&mut encoder.begin_compute_pass(&wgpu::ComputePassDescriptor::default()), 0);
        }
        let started = Instant::now();
        gpu.wait(gpu.queue.submit([encoder.finish()]), true)?;
        Ok(started.elapsed().as_secs_f64() * 1e3 / f64::from(times))
    };
    let mut sums_ms = [0.0; 4];
    let mut began = None;
    for (axis, lateral) in [(DVec3::Z, DVec3::X), (DVec3::X, DVec3::Y), (DVec3::Y, DVec3::Z)] {
        let from_mm = inputs.bvh.centre_mm - 0.5 * configuration.probe.depth_mm * axis;
        let mut params = device.batches.params(0, &configuration.params);
        params.set_pose(&Pose::looking(from_mm, axis, lateral), inputs.bvh, &configuration.probe);
        gpu.queue.write_buffer(&device.buffers.params, 0, bytemuck::bytes_of(&params));
        // The first run compiles, too.
        run(&locate.pass, 1)?;
        let began = *began.get_or_insert_with(Instant::now);
        let mut counts: Vec<Vec<u32>> = Vec::new();
        let mut least_ms = [0.0; 4];
        for (pass, least_ms) in passes.iter().zip(&mut least_ms) {
            *least_ms = run(pass, 1)?;
            counts.push(snapshot::read(gpu, &device.buffers.segment_counts)?);
        }
        let mut pairs = counts.chunks(2).zip(MEASURED_PATHS);
        if !pairs.all(|(ways, measured)| alike(&ways[0], &ways[1], measured.min(paths) as usize)) {
            tracing::warn!("{}: trace by lanes finds other paths, and is not used", gpu.adapter_name());
            return Ok(None);
        }
        for _ in 0..ROUNDS {
            // A device too slow for any round is judged by its first dispatches.
            if began.elapsed() > MEASURED_WITHIN {
                break;
            }
            for (pass, least_ms) in passes.iter().zip(&mut least_ms) {
                *least_ms = least_ms.min(run(pass, DISPATCHES)?);
            }
        }
        sums_ms.iter_mut().zip(least_ms).for_each(|(sum, ms)| *sum += ms);
        if began.elapsed() > MEASURED_WITHIN {
            break;
        }
    }
    let [a, b, c, d] = sums_ms;
    Ok(Some(TraceTimes { few_ms: [a, b], many_ms: [c, d] }))
}

/// Whether nearly all of the first `paths` paths have equal numbers of segments in `one` and `other`.
fn alike(one: &[u32], other: &[u32], paths: usize) -> bool {
    let same = one.iter().zip(other).take(paths).filter(|(a, b)| a == b).count();
    same as f64 >= ALIKE * paths as f64
}

#[cfg(test)]
mod tests {
    use glam::Vec3;
    use insonify_core::anatomy::analytic::{self, Part};
    use insonify_core::anatomy::{Bvh, TissueTable};
    use insonify_core::settings::RenderSettings;
    use insonify_core::transducer::Probe;

    use super::*;
    use crate::configuration::{Configuration, Media};
    use crate::device::ShaderSet;

    #[test]
    fn subgroups_that_a_path_does_not_fit_are_refused_with_the_reason() {
        assert_eq!(unfit(true, [8, 8]), None);
        assert_eq!(unfit(true, [32, 64]), None);
        assert_eq!(unfit(false, [32, 32]).unwrap(), "it has no subgroup operations");
        assert_eq!(unfit(true, [4, 32]).unwrap(), "its subgroups have 4 to 32 lanes, a path takes 8");
        assert!(unfit(true, [0, 0]).is_some() && unfit(true, [12, 12]).is_some());
    }

    #[test]
    fn paths_with_other_segments_are_not_alike() {
        let counts: Vec<u32> = (0..400).map(|i| i % 7).collect();
        let mut other = counts.clone();
        assert!(alike(&counts, &other, 400) && !alike(&counts, &other[..300], 400));
        other.iter_mut().take(4).for_each(|count| *count += 1);
        assert!(alike(&counts, &other, 400));
        assert!(!alike(&counts, &other, 100), "paths beyond those that were traced don't count");
        other.iter_mut().take(5).for_each(|count| *count = 99);
        assert!(!alike(&counts, &other, 400));
    }

    /// Times of both ways on a software device, with `shaders` that a test may have changed.
    fn measured(shaders: &ShaderSet) -> Option<TraceTimes> {
        let gpu = Gpu::open(true).unwrap();
        let mesh = analytic::sphere(Vec3::ZERO, 40.0, 3);
        let parts = vec![Part { name: "liver", tissue: "liver", priority: 1, mesh }];
        let scene = analytic::scene(parts, &TissueTable::builtin().unwrap(), "gel").unwrap();
        let bvh = Bvh::build(&scene).unwrap();
        let media = Media::new(&scene, &bvh);
        let probe = Probe { scanlines: 32, samples: 512.into(), ..Probe::default() };
        let configuration = Configuration::new(&media, &probe, &RenderSettings::default(), None, &[]).unwrap();
        let inputs = FrameInputs { bvh: &bvh, media: &media, configuration: &configuration, angle: 0 };
        let scene = SceneBuffers::new(&gpu, &media.surface_words, &bvh).unwrap();
        let times = measure(&gpu, &scene, &mut Pipelines::new(shaders), inputs).unwrap();
        assert_eq!(gpu.trace(), None, "software is not measured by itself");
        gpu.choose_trace(&scene, &mut Pipelines::new(shaders), inputs);
        assert_eq!(gpu.trace().unwrap(), "path");
        times
    }

    #[test]
    fn both_ways_are_timed_if_they_find_the_same_paths() {
        if !Gpu::open(true).unwrap().is_software() {
            return;
        }
        let times = measured(&ShaderSet::default()).unwrap();
        for [path_ms, lanes_ms] in [times.few_ms, times.many_ms] {
            assert!(path_ms > 0.0 && lanes_ms > 0.0 && path_ms < 1e4 && lanes_ms < 1e4, "{times:?}");
        }
    }

    #[cfg(feature = "test-hooks")]
    #[test]
    fn lanes_that_find_other_paths_are_not_timed() {
        if !Gpu::open(true).unwrap().is_software() {
            return;
        }
        let mut shaders = ShaderSet::default();
        assert!(shaders.replace("trace", "var found = vote(there);", "var found = 0u;"));
        assert_eq!(measured(&shaders), None);
    }
}
