//! Recorded sessions to render without a clock: frames with the poses and settings of the live session.

mod error;
mod exam;
#[cfg(feature = "video")]
mod files;
mod frame_range;
mod key_frames;
mod misplaced;
mod pace;
mod sequence;
mod timeline;

use std::ops::Range;
use std::path::{Path, PathBuf};

use self::misplaced::MisplacedFrames;
use super::replayed::{OtherSetting, ReplayedControls, ReplayedNeedle, ReplayedPoses};
use crate::anatomy::Scene;
use crate::chooser::{StillQuality, choose_still};
use crate::look::{Look, Shape};
use crate::measuring::scene_name;
use crate::pose::{Estimator, Measurement, Pose};
use crate::recording::{self, Event, RecordedMeasurements, RecordingSummary};
use crate::render::{Backend, Frame, FrameQuality, RenderError, Renderer};
use crate::settings::{LiveSettings, RenderSettings};
use crate::sink::FrameRate;
use crate::station::{NeedleTracking, Station};
use crate::transducer::Probe;

pub use error::ReplayError;
pub use exam::RecordedExam;
pub(super) use exam::is_scored;
#[cfg(feature = "video")]
pub use files::{FrameEntry, REPLAY_FILES, WrittenReplay};
pub use frame_range::FrameRange;
pub use key_frames::{Agreement, KeyFrame, KeyFrames, KeyScores, Stage, key_frames, legend};
pub use pace::{Pace, ReplaySpeed};
pub use sequence::{SequenceMap, WrittenSequence};
pub use timeline::Timeline;

/// Choices of a replay.
#[derive(Debug, Clone, Copy)]
pub struct ReplayOptions {
    /// Frames per second of the recording.
    pub rate: FrameRate,
    /// Frames to render.
    pub frames: FrameRange,
    /// Numbers of rays and layers; none: the recorded session's quality, or the station's if the session has none.
    pub quality: Option<FrameQuality>,
    /// Seed; none: the seed of the station.
    pub seed: Option<u32>,
    /// Whether to interpolate the tracker's raw poses, without the station's calibration and filter. A tracked needle is
    /// not shown then, because only its calibration says where its tip is.
    pub raw_poses: bool,
    /// Whether to ignore the settings that were changed in the recorded session.
    pub ignore_controls: bool,
}

/// Consecutive frames that are rendered with the same settings.
#[derive(Debug, Clone, PartialEq)]
pub struct Stretch {
    /// Frame indices in the timeline.
    pub frames: Range<usize>,
    /// The probe.
    pub probe: Probe,
    /// Settings of the renderer.
    pub settings: RenderSettings,
}

/// A recorded session, ready to be rendered.
#[derive(Debug)]
pub struct Replay {
    /// The recording.
    pub path: PathBuf,
    /// The station.
    pub station: Station,
    /// Frames per second of the recording.
    pub rate: FrameRate,
    /// Content of the recording.
    pub summary: RecordingSummary,
    /// Pose and time of each frame.
    pub timeline: Timeline,
    /// Requested frames.
    pub frames: Range<usize>,
    /// Frames with the same settings, in order; at least one.
    pub stretches: Vec<Stretch>,
    /// Settings with which the recorded session began, if they differ from the station's.
    pub others_at_start: Vec<OtherSetting>,
    /// Reasons why settings of the recorded session were refused.
    pub refused: Vec<String>,
    /// The station's frame budget if it is ignored because the recorded session sets the quality, ms.
    pub overruled_budget_ms: Option<f64>,
    /// Frame budget that chooses the quality, ms; none if the station, the options or the recorded session set the
    /// quality.
    frame_budget_ms: Option<f64>,
}

impl Replay {
    /// Reads the recording at `path` for `station`.
    ///
    /// # Errors
    /// A recording or calibration that can't be read, times that span too many frames, or no requested frame. Damage in
    /// the recording is logged before.
    pub fn read(path: &Path, station: Station, options: &ReplayOptions) -> Result<Self, ReplayError> {
        let ReplayOptions { rate, frames: FrameRange { start, end }, quality, .. } = *options;
        if let Some(end) = end.filter(|end| *end <= start) {
            return Err(ReplayError::Range { start, end });
        }
        let (timeline, summary) = timeline(path, &station, options)?;
        let mut timeline = timeline.since(summary.info.start_time_ns);
        let count = timeline.poses.len();
        let frames = start..end.unwrap_or(count).min(count);
        summary.warn_of_damage(path);
        if frames.is_empty() {
            return Err(ReplayError::Start { start, frames: count, fps: rate.fps() });
        }
        let mut settings = station.settings;
        settings.quality.seed = options.seed.unwrap_or(settings.quality.seed);
        let events = if options.ignore_controls { &[][..] } else { &summary.events };
        let recorded = events.iter().any(sets_quality);
        let begin = LiveSettings { probe: station.probe, render: settings, frozen: false, generator: false };
        let mut controls = ReplayedControls::new(begin, events);
        let live: Vec<LiveSettings> = timeline.times_ns.iter().map(|time| controls.at(*time)).collect();
        timeline.freeze(&live);
        Ok(Self {
            path: path.to_owned(),
            rate,
            stretches: stretches(&live, frames.clone(), quality),
            frames,
            others_at_start: controls.others_at_start(),
            refused: controls.refused().to_vec(),
            overruled_budget_ms: station.frame_budget_ms.filter(|_| quality.is_none() && recorded),
            frame_budget_ms: station.frame_budget_ms.filter(|_| quality.is_none() && !recorded),
            station,
            summary,
            timeline,
        })
    }

    /// Settings at the first frame.
    ///
    /// # Errors
    /// There is no frame.
    pub fn first(&self) -> Result<&Stretch, ReplayError> {
        self.stretches.first().ok_or(ReplayError::Empty)
    }

    /// Number of changes of the settings among the frames.
    pub fn changes(&self) -> usize {
        self.stretches.len().saturating_sub(1)
    }

    /// Applies and returns the quality that fits the station's frame budget; none without a budget. Times are
    /// measured at the poses of the first, middle and last frame.
    ///
    /// # Errors
    /// Errors of [`choose_still`].
    pub fn choose_quality(&mut self, backend: &Backend, scene: &Scene) -> Result<Option<StillQuality>, ReplayError> {
        let Some(frame_budget_ms) = self.frame_budget_ms else { return Ok(None) };
        let Stretch { probe, settings, .. } = self.first()?;
        let poses = self.timeline.poses.get(self.frames.clone()).unwrap_or_default();
        let last = poses.len().saturating_sub(1);
        let poses: Vec<Pose> = [0, last / 2, last].iter().filter_map(|i| poses.get(*i).copied()).collect();
        let mut renderer = Renderer::new(backend, scene, probe, settings)?;
        let name = scene_name(&self.station);
        let chosen = choose_still(&mut renderer, &name, probe, settings, &poses, frame_budget_ms)?;
        for Stretch { settings, .. } in &mut self.stretches {
            (settings.quality.rays, settings.quality.layers) = (chosen.quality.rays, chosen.quality.layers);
        }
        Ok(Some(chosen))
    }

    /// Renders all frames in order, two in flight. `before` runs before each submission and may wait. `each` receives
    /// every frame after post-processing, and its index among the requested frames.
    ///
    /// # Errors
    /// A frame that can't be rendered, or an error of `each`.
    pub fn render<E: From<RenderError> + From<ReplayError>>(
        &self,
        backend: &Backend,
        scene: &Scene,
        mut before: impl FnMut(usize),
        mut each: impl FnMut(usize, &Frame) -> Result<(), E>,
    ) -> Result<(), E> {
        let Stretch { probe, settings, .. } = self.first()?;
        let mut renderer = Renderer::new(backend, scene, probe, settings)?;
        let mut look = Look::default();
        let mut misplaced = MisplacedFrames::new(self.rate);
        for Stretch { frames, probe, settings } in &self.stretches {
            let from = frames.start - self.frames.start;
            renderer.reconfigure(probe, settings)?;
            let poses: &[Pose] = self.timeline.poses.get(frames.clone()).unwrap_or_default();
            let needles = self.timeline.needles.get(frames.clone()).unwrap_or_default();
            let before = |i| {
                before(from + i);
                (self.timeline.scene_s(frames.start + i), needles.get(i).copied().flatten())
            };
            let (pixel_mm, angles) = (renderer.sector().pixel_mm, settings.look.independent_angles(probe));
            renderer.render_each(poses, before, |i, frame| {
                let shape = Shape::new(frame.width, pixel_mm, &frame.mask, &settings.image, angles);
                look.apply(&settings.look, shape, &mut frame.bmode);
                misplaced.push(frame.contact.and_then(|contact| contact.misplaced));
                each(from + i, frame)
            })?;
        }
        if let Some((misplaced, count)) = misplaced.reported() {
            tracing::warn!("{}: in {count} of {} frames {misplaced}", self.path.display(), self.frames.len());
        }
        Ok(())
    }
}

fn timeline(
    path: &Path,
    station: &Station,
    options: &ReplayOptions,
) -> Result<(Timeline, RecordingSummary), ReplayError> {
    if options.raw_poses {
        let (poses, summary) = recording::poses(path)?;
        return Ok((standing(Timeline::new(&poses, options.rate)?, station), summary));
    }
    let RecordedMeasurements { probe: measurements, needle, summary } =
        recording::measurements(path, &station.tracker)?;
    let span = measurements.first().zip(measurements.last());
    let (first_ns, last_ns) = span.map_or((0, 0), |(first, last)| (first.host_time_ns, last.host_time_ns));
    let mut settings = station.pose_settings()?;
    settings.calibration = recording::calibration_for(path, &summary, settings.calibration);
    let estimator = Estimator::new(settings);
    let mut poses = ReplayedPoses::new(estimator, measurements, &summary.events);
    let needle = replayed_needle(path, station, needle, &summary)?;
    let is_tracked = needle.is_some();
    let timeline = Timeline::replayed(&mut poses, needle, first_ns, last_ns, options.rate)?;
    Ok((if is_tracked { timeline } else { standing(timeline, station) }, summary))
}

/// The needle of a recording, from the `measurements` of its sensor; `None` if it has none, or the station has no needle.
fn replayed_needle(
    path: &Path,
    station: &Station,
    measurements: Vec<Measurement>,
    summary: &RecordingSummary,
) -> Result<Option<ReplayedNeedle>, ReplayError> {
    if measurements.is_empty() {
        return Ok(None);
    }
    let Some(NeedleTracking { mut settings, bevel_known }) = station.needle_settings()? else { return Ok(None) };
    settings.calibration = recording::calibration_for(path, summary, settings.calibration);
    let poses = ReplayedPoses::new(Estimator::new(settings), measurements, &summary.events);
    Ok(Some(ReplayedNeedle { poses, bevel_known }))
}

/// `timeline` with the needle that stands still at the station, if it has one.
fn standing(timeline: Timeline, station: &Station) -> Timeline {
    match station.standing_needle() {
        Some(needle) => timeline.with_standing_needle(needle),
        None => timeline,
    }
}

/// Splits `frames` into runs of equal settings.
fn stretches(live: &[LiveSettings], frames: Range<usize>, quality: Option<FrameQuality>) -> Vec<Stretch> {
    let mut stretches: Vec<Stretch> = Vec::new();
    let mut last: Option<LiveSettings> = None;
    for frame in frames {
        let Some(now) = live.get(frame) else { break };
        match stretches.last_mut() {
            Some(stretch) if last.is_some_and(|last| last.same_picture(now)) => stretch.frames.end = frame + 1,
            _ => {
                let LiveSettings { probe, render: mut settings, .. } = *now;
                if let Some(FrameQuality { rays, layers, .. }) = quality {
                    (settings.quality.rays, settings.quality.layers) = (rays, layers);
                }
                stretches.push(Stretch { frames: frame..frame + 1, probe, settings });
            }
        }
        last = Some(*now);
    }
    stretches
}

/// Whether an event of a recorded session sets rays or layers.
fn sets_quality(event: &Event) -> bool {
    let says = |key: &str| event.name == key || event.value.as_ref().is_some_and(|value| value.get(key).is_some());
    ["rays", "layers"].into_iter().any(says)
}

#[cfg(test)]
mod tests {
    use super::*;

    #[test]
    fn a_range_without_a_frame_is_refused_before_the_recording_is_read() {
        let station = Station::parse("[scene]\npath = \"a.glb\"", Path::new("/station")).unwrap();
        let read = |end| {
            let rate = FrameRate::new(10.0).unwrap();
            let (quality, seed, raw_poses, ignore_controls) = (None, None, false, false);
            let frames = FrameRange { start: 5, end: Some(end) };
            let options = ReplayOptions { rate, frames, quality, seed, raw_poses, ignore_controls };
            Replay::read(Path::new("/nonexistent/a.mcap"), station.clone(), &options).unwrap_err()
        };
        assert!(matches!(read(5), ReplayError::Range { start: 5, end: 5 }));
        assert!(matches!(read(6), ReplayError::Recording(_)));
    }
}
