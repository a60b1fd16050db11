//! Frame times of a station: by quality, with and without maps, of a moving scene, and throughput.

use std::sync::Arc;
use std::time::Instant;

use serde::Serialize;

use super::timed_needle;
use crate::anatomy::{Bvh, Scene};
use crate::pose::Pose;
use crate::render::{Backend, FRAMES_IN_FLIGHT, Frame, Job, Quality, RenderError, RenderSettings, Renderer, TraceBy};
use crate::report::TimeTable;
use crate::report::time_table::{StageTime, WHOLE_FRAME};
use crate::settings::ImageSettings;
use crate::station::Station;
use crate::transducer::Probe;

/// Uncounted frames before the measured ones. During them, a device raises its clock.
const WARM_UP: usize = 10;

/// Scene time from one frame to the next, s.
const FRAME_S: f64 = 0.05;

/// Frames of one kind, whose times are measured together.
#[derive(Debug, Clone, PartialEq)]
pub struct Workload {
    /// Name in tables.
    pub name: &'static str,
    /// Probe.
    pub probe: Probe,
    /// Settings.
    pub settings: RenderSettings,
    /// Whether the scene moves between frames.
    pub moves: bool,
    /// Order of submitting and receiving the frames.
    pub flow: Flow,
}

/// Order of submitting and receiving frames.
#[derive(Debug, Clone, Copy, PartialEq, Eq)]
pub enum Flow {
    /// Receives each frame before it submits the next.
    Single,
    /// Submits the next frame before it receives the previous one.
    Overlapped,
    /// Renders all frames by [`Renderer::render_many`].
    Many,
}

impl Workload {
    /// Workloads measured with a station. The fifth matches the published time of NVIDIA's raysim in its shape: 256
    /// scanlines of 4096 samples, one ray each, an image of 500 × 500, no maps.
    pub fn of(station: &Station) -> Vec<Self> {
        let settings = |quality, maps| RenderSettings { quality, maps, ..station.settings };
        let image = ImageSettings { width: 500, height: 500, ..station.settings.image };
        let raysim = RenderSettings { image, ..settings(Quality::LQ, false) };
        let kind = |name, settings| Self { name, probe: station.probe, settings, moves: false, flow: Flow::Single };
        vec![
            kind("LQ", settings(Quality::LQ, true)),
            kind("LQ without maps", settings(Quality::LQ, false)),
            Self { moves: true, ..kind("LQ, moving", settings(Quality::LQ, true)) },
            kind("HQ", settings(Quality::HQ, true)),
            Self {
                probe: Probe { scanlines: 256, samples: 4096.into(), ..station.probe },
                ..kind("256 x 4096, 500 x 500", raysim)
            },
            Self { flow: Flow::Overlapped, ..kind("LQ, two in flight", settings(Quality::LQ, true)) },
            Self { flow: Flow::Many, ..kind("LQ without maps, many", settings(Quality::LQ, false)) },
        ]
    }
}

/// Measured times of a workload.
#[derive(Debug, Clone, PartialEq, Serialize)]
pub struct Measured {
    /// Name of the workload.
    pub name: &'static str,
    /// Rays × layers, such as `32x3`.
    pub quality: String,
    /// Number of scanlines, and of samples per scanline.
    pub lines: [u32; 2],
    /// Width and height of the image, pixels.
    pub image: [u32; 2],
    /// Whether frames include the segmentation and attenuation maps.
    pub maps: bool,
    /// Throughput, frames per second.
    pub frames_per_s: f64,
    /// Percentiles of each pass and of whole frames.
    pub stages: Vec<StageTime>,
}

/// Measured times of one implementation of the pass `trace`.
#[derive(Debug, Clone, PartialEq, Serialize)]
pub struct TraceTime {
    /// Name of the workload.
    pub name: &'static str,
    /// Name of the implementation: `path` or `lanes`.
    pub by: &'static str,
    /// Median time of the pass, ms; `None` on a device without timestamps.
    pub trace_ms: Option<f64>,
    /// Median time of whole frames, ms.
    pub whole_ms: Option<f64>,
}

/// Measures `frames` frames, cycling through `poses`, after a warm-up. `progress` is called after each frame.
///
/// # Errors
/// Errors of [`Renderer::with_bvh`] and [`Renderer::render`].
pub fn measure(
    backend: &Backend,
    scene: &Scene,
    bvh: &Arc<Bvh>,
    workload: &Workload,
    poses: &[Pose],
    frames: usize,
    mut progress: impl FnMut(),
) -> Result<Measured, RenderError> {
    let Workload { name, probe, settings, .. } = *workload;
    let mut renderer = Renderer::with_bvh(backend, scene, bvh.clone(), &probe, &settings)?;
    let mut table = TimeTable::default();
    let mut measured = |frame: &Frame| {
        table.push(&frame.times);
        progress();
    };
    let frames_per_s = match workload.flow {
        Flow::Many => many(&mut renderer, &probe, poses, frames, &mut measured)?,
        flow => {
            let ahead = if flow == Flow::Overlapped { FRAMES_IN_FLIGHT - 1 } else { 0 };
            in_turn(&mut renderer, (&probe, poses, workload.moves), frames, ahead, &mut measured)?
        }
    };
    let mut stages = table.stages();
    // The frames of one dispatch share its pass times, so only the times of whole frames are kept.
    stages.retain(|stage| workload.flow != Flow::Many || stage.stage == WHOLE_FRAME);
    Ok(Measured {
        name,
        quality: format!("{}x{}", settings.quality.rays, settings.quality.layers),
        lines: [probe.scanlines, probe.sampled(settings.coarse_samples).sample_count()],
        image: [settings.image.width, settings.image.height],
        maps: settings.maps,
        frames_per_s,
        stages,
    })
}

/// Renders frames one after another, with `ahead` further frames submitted before each is received. Returns frames per
/// second.
fn in_turn(
    renderer: &mut Renderer,
    (probe, poses, moves): (&Probe, &[Pose], bool),
    frames: usize,
    ahead: usize,
    measured: &mut impl FnMut(&Frame),
) -> Result<f64, RenderError> {
    let mut frame = Frame::default();
    let mut started = Instant::now();
    for (number, pose) in poses.iter().cycle().take(WARM_UP + frames + ahead).enumerate() {
        if number == WARM_UP + ahead {
            started = Instant::now();
        }
        if moves {
            renderer.set_time_s(number as f64 * FRAME_S);
        }
        renderer.set_needle(timed_needle(renderer.settings(), probe, pose));
        renderer.submit(pose)?;
        if number < ahead {
            continue;
        }
        renderer.receive(&mut frame)?;
        if number >= WARM_UP + ahead {
            measured(&frame);
        }
    }
    let frames_per_s = frames as f64 / started.elapsed().as_secs_f64().max(1e-9);
    while renderer.frames_in_flight() > 0 {
        renderer.receive(&mut frame)?;
    }
    Ok(frames_per_s)
}

/// Renders frames by [`Renderer::render_many`]. Returns frames per second.
fn many(
    renderer: &mut Renderer,
    probe: &Probe,
    poses: &[Pose],
    frames: usize,
    measured: &mut impl FnMut(&Frame),
) -> Result<f64, RenderError> {
    let settings = *renderer.settings();
    let needle = |pose: &Pose| timed_needle(&settings, probe, pose);
    let seed = settings.quality.seed;
    let jobs = poses.iter().cycle().map(|&pose| Job { pose, time_s: 0.0, seed, needle: needle(&pose) });
    renderer.render_many(jobs.clone().take(WARM_UP), |_, _| Ok::<_, RenderError>(()))?;
    let started = Instant::now();
    renderer.render_many(jobs.take(frames), |_, frame| {
        measured(frame);
        Ok::<_, RenderError>(())
    })?;
    Ok(frames as f64 / started.elapsed().as_secs_f64().max(1e-9))
}

/// Measures a workload with both implementations of `trace`, each as [`measure`] does. Empty on the host, and on
/// devices that cannot trace by lanes.
///
/// # Errors
/// Errors of [`measure`].
pub fn measure_trace(
    backend: &Backend,
    scene: &Scene,
    bvh: &Arc<Bvh>,
    workload: &Workload,
    poses: &[Pose],
    frames: usize,
) -> Result<Vec<TraceTime>, RenderError> {
    let ways = if backend.has_trace_by_lanes() { &TraceBy::ALL[..] } else { &[] };
    let time = |&by: &TraceBy| {
        let found = measure(&backend.clone().tracing_by(by)?, scene, bvh, workload, poses, frames, || {})?;
        let p50_ms = |name| found.stages.iter().find(|stage| stage.stage == name).map(|stage| stage.p50_ms);
        Ok(TraceTime { name: workload.name, by: by.name(), trace_ms: p50_ms("trace"), whole_ms: p50_ms(WHOLE_FRAME) })
    };
    ways.iter().map(time).collect()
}
