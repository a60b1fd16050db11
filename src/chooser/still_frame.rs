//! One frame of a station with its post-processing ("look") and its record.

use super::still::{StillQuality, choose_still};
use crate::anatomy::Scene;
use crate::lanes::{in_order, lane_count};
use crate::look::{Look, Shape};
use crate::measuring::{MeasuringError, scene_name};
use crate::needle::Needle;
use crate::pose::Pose;
use crate::render::{Backend, Frame, Quality, RenderSettings, Renderer};
use crate::sink::FrameRecord;
use crate::station::Station;

/// A frame with its record.
#[derive(Debug)]
pub struct StillFrame {
    /// The frame.
    pub frame: Frame,
    /// Inputs and times of the frame.
    pub record: FrameRecord,
    /// Quality chosen within the budget; `None` if the quality is fixed.
    pub chosen: Option<StillQuality>,
}

/// Poses of the tools in a still, and its time.
#[derive(Debug, Clone, Copy, PartialEq)]
pub struct StillPoses {
    /// Pose of the probe.
    pub probe: Pose,
    /// The needle; `None`: the still shows none. A station without a needle, or with a pointer, never shows one.
    pub needle: Option<Needle>,
    /// Scene time, s.
    pub time_s: f64,
}

/// Renders a station's `scene` with `settings` and the tools `at` their poses, and applies the post-processing. With
/// `frame_budget_ms`, rays and layers are chosen. Logs a warning if paths met more interfaces than the buffers hold.
///
/// # Errors
/// The frame can't be rendered, or an error of [`choose_still`].
pub fn render_still(
    backend: &Backend,
    scene: &Scene,
    station: &Station,
    settings: RenderSettings,
    at: StillPoses,
    frame_budget_ms: Option<f64>,
) -> Result<StillFrame, MeasuringError> {
    let mut renderer = Renderer::new(backend, scene, &station.probe, &settings)?;
    render_still_with(&mut renderer, backend, station, settings, at, frame_budget_ms)
}

/// Does [`render_still`] with an existing `renderer` of the station's scene on `backend`, for successive stills. The
/// renderer is switched to the station's probe and to `settings`.
///
/// # Errors
/// Errors of [`render_still`].
pub fn render_still_with(
    renderer: &mut Renderer,
    backend: &Backend,
    station: &Station,
    mut settings: RenderSettings,
    StillPoses { probe: pose, needle, time_s }: StillPoses,
    frame_budget_ms: Option<f64>,
) -> Result<StillFrame, MeasuringError> {
    let probe = &station.probe;
    renderer.reconfigure(probe, &settings)?;
    renderer.set_time_s(time_s);
    renderer.set_needle(needle);
    let mut chosen = None;
    if let Some(budget_ms) = frame_budget_ms {
        let found = choose_still(renderer, &scene_name(station), probe, &settings, &[pose], budget_ms)?;
        settings.quality = Quality { rays: found.quality.rays, layers: found.quality.layers, ..settings.quality };
        chosen = Some(found);
    }
    let mut frame = Frame::default();
    renderer.render(&pose, &mut frame)?;
    if frame.overflows > 0 {
        tracing::warn!("{} paths met more interfaces than are kept, and go on in the last medium", frame.overflows);
    }
    let angles = settings.look.independent_angles(probe);
    let shape = Shape::new(frame.width, renderer.sector().pixel_mm, &frame.mask, &settings.image, angles);
    Look::default().apply(&settings.look, shape, &mut frame.bmode);
    let (plan, sector) = (renderer.plan(), renderer.sector());
    let mut record = FrameRecord::new(&frame, &pose, probe, &settings, plan, sector, backend.into());
    record.chosen = chosen.as_ref().map(StillQuality::to_string);
    record.set_needle(needle.as_ref());
    Ok(StillFrame { frame, record, chosen })
}

/// Request for one still in a batch.
#[derive(Debug, Clone)]
pub struct StillJob {
    /// Settings of the frame.
    pub settings: RenderSettings,
    /// Poses of the tools, and time.
    pub at: StillPoses,
}

/// Does [`render_still_with`] for all `jobs`, several at once on the host. `each` receives the frames in order.
/// Afterwards, `renderer` has the settings and time of any one of the jobs.
///
/// # Errors
/// The first frame that can't be rendered, after those before it, or an error of `each`.
pub fn render_stills_with<E: From<MeasuringError> + Send>(
    renderer: &mut Renderer,
    backend: &Backend,
    station: &Station,
    jobs: &[StillJob],
    mut each: impl FnMut(usize, StillFrame) -> Result<(), E>,
) -> Result<(), E> {
    let render = |lane: &mut &mut Renderer, job: &StillJob| {
        Ok(render_still_with(lane, backend, station, job.settings, job.at, None)?)
    };
    let count = lane_count().min(jobs.len());
    let done = renderer.with_lanes(count, |lanes| in_order(lanes, jobs.iter().map(Ok), render, &mut each));
    done.map_err(MeasuringError::from)?
}
