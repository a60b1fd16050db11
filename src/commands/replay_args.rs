//! Recorded sessions to render: frames with the poses and settings of the live session.

use std::ops::Range;
use std::path::{Path, PathBuf};
use std::str::FromStr;

use anyhow::anyhow;
use clap::Args;
use insonify::anatomy::Scene;
use insonify::chooser::{choose_still, scene_name};
use insonify::look::{Look, Shape};
use insonify::pipeline::{OtherSetting, ReplayedControls, ReplayedPoses};
use insonify::pose::{Estimator, Pose};
use insonify::recording::{self, Event, RecordingSummary};
use insonify::render::{Backend, Frame, Quality, RenderSettings, Renderer};
use insonify::settings::LiveSettings;
use insonify::sink::FrameRate;
use insonify::station::Station;
use insonify::transducer::Probe;

use super::effects::EffectArgs;
use super::quality::{self, RaysLayers};
use super::timeline::Timeline;
use super::{Failure, input, session};

/// Recording to replay, and the options for it.
#[derive(Debug, Args)]
pub(crate) struct ReplayArgs {
    /// Recording (.mcap)
    pub(crate) recording: PathBuf,

    /// Station file (TOML); `insonify station-keys` lists its keys
    pub(crate) station: PathBuf,

    #[arg(long, value_name = "QUALITY", help = quality::help("the recorded session's, else the station's"))]
    quality: Option<RaysLayers>,

    #[arg(long, value_name = "N", allow_negative_numbers = true, help = quality::seed_help())]
    seed: Option<u32>,

    #[command(flatten)]
    effects: EffectArgs,

    /// Frames per second of the recording, 0.1..=1000
    #[arg(long, value_name = "FPS", default_value_t = 20.0, allow_negative_numbers = true)]
    fps: f64,

    /// Only these frames: a..b (b not included), a.. or ..b
    #[arg(long, value_name = "RANGE", default_value = "..")]
    frames: FrameRange,

    /// Take the tracker's poses as they are, interpolated, without the station's calibration and filter
    #[arg(long)]
    raw_poses: bool,

    /// Leave alone what was set while it was recorded: gain, dynamic range, TGC, freeze, depth, focus,
    /// look, harmonics, quality
    #[arg(long)]
    ignore_controls: bool,
}

/// Frames `start..end`.
#[derive(Debug, Clone, Copy, PartialEq, Eq)]
pub(crate) struct FrameRange {
    start: usize,
    end: Option<usize>,
}

impl FrameRange {
    /// Part of the range within a recording of `frames` frames at `fps`.
    fn within(self, frames: usize, fps: f64) -> Result<Range<usize>, Failure> {
        let end = self.end.unwrap_or(frames).min(frames);
        if self.start >= end {
            let start = self.start;
            let error = anyhow!("--frames starts at {start}, but at {fps} frames a second the recording has {frames}");
            return Err(Failure::Input(error));
        }
        Ok(self.start..end)
    }
}

impl FromStr for FrameRange {
    type Err = String;

    fn from_str(text: &str) -> Result<Self, String> {
        let number = |part: &str, absent| if part.is_empty() { Some(absent) } else { part.parse().ok().map(Some) };
        let parts = text.split_once("..").and_then(|(a, b)| Some((number(a, Some(0))?, number(b, None)?)));
        match parts {
            Some((start, end)) if end.is_none_or(|end| end > start.unwrap_or(0)) => {
                Ok(Self { start: start.unwrap_or(0), end })
            }
            _ => Err("expected a..b with a < b, a.. or ..b".to_owned()),
        }
    }
}

/// Frames that are rendered with the same settings.
pub(crate) struct Part {
    /// Frame indices in the timeline.
    pub(crate) frames: Range<usize>,
    pub(crate) probe: Probe,
    pub(crate) settings: RenderSettings,
}

/// A recorded session, ready to be rendered.
pub(crate) struct Replay {
    pub(crate) station: Station,
    pub(crate) rate: FrameRate,
    pub(crate) summary: RecordingSummary,
    pub(crate) timeline: Timeline,
    /// Requested frames.
    pub(crate) frames: Range<usize>,
    /// In the order of their frames; at least one.
    pub(crate) parts: Vec<Part>,
    /// Frame time that chooses the quality, ms; `None` if station, command or recorded session sets the quality.
    frame_budget_ms: Option<f64>,
}

impl ReplayArgs {
    /// Reads station and recording.
    pub(crate) fn read(&self) -> Result<Replay, Failure> {
        let rate = FrameRate::new(self.fps)?;
        let mut station = Station::load(&self.station)?;
        self.effects.apply(&mut station.settings);
        let (timeline, summary) = self.timeline(&station, rate)?;
        let mut timeline = timeline.since(summary.info.start_time_ns);
        input::warn_of_damage(&self.recording, &summary);
        let frames = self.frames.within(timeline.poses.len(), self.fps)?;
        let mut settings = station.settings;
        settings.quality.seed = self.seed.unwrap_or(settings.quality.seed);
        let events = if self.ignore_controls { &[][..] } else { &summary.events };
        let recorded = events.iter().any(sets_quality);
        let frame_budget_ms = station.frame_budget_ms.filter(|_| self.quality.is_none() && !recorded);
        if let (Some(ms), None, None) = (station.frame_budget_ms, frame_budget_ms, self.quality) {
            eprintln!("the recorded session says its quality: quality.frame_budget_ms = {ms} chooses nothing");
        }
        let mut controls = recorded_controls(&self.recording, station.probe, settings, events);
        self.say_others(&station, &controls);
        let live: Vec<LiveSettings> = timeline.times_ns.iter().map(|time| controls.at(*time)).collect();
        timeline.freeze(&live);
        let parts = self.parts(&live, frames.clone());
        Ok(Replay { station, rate, summary, timeline, frames, parts, frame_budget_ms })
    }

    /// Prints the settings with which the recorded session began, if they differ from the station's.
    fn say_others(&self, station: &Station, controls: &ReplayedControls) {
        let mut others = controls.others_at_start();
        // A quality chosen here differs on purpose.
        let chosen = self.quality.is_some() || station.frame_budget_ms.is_some();
        others.retain(|other| !chosen || !matches!(&*other.key, "rays" | "layers"));
        if others.is_empty() {
            return;
        }
        let text = |OtherSetting { key, recorded, here }: &OtherSetting| format!("{key} {recorded} (station: {here})");
        let others: Vec<String> = others.iter().map(text).collect();
        eprintln!(
            "{}: the recorded session began with other settings than the station's: {}; --ignore-controls leaves the station's",
            self.recording.display(),
            others.join(", ")
        );
    }

    fn timeline(&self, station: &Station, rate: FrameRate) -> Result<(Timeline, RecordingSummary), Failure> {
        if self.raw_poses {
            let (poses, summary) = recording::poses(&self.recording)?;
            return Ok((Timeline::new(&poses, rate)?, summary));
        }
        let (measurements, summary) = recording::measurements(&self.recording, &station.tracker)?;
        let span = measurements.first().zip(measurements.last());
        let (first_ns, last_ns) = span.map_or((0, 0), |(first, last)| (first.host_time_ns, last.host_time_ns));
        let estimator = Estimator::new(station.pose_settings()?);
        let mut poses = ReplayedPoses::new(estimator, measurements, &summary.events);
        Ok((Timeline::replayed(&mut poses, first_ns, last_ns, rate)?, summary))
    }

    /// Splits `frames` into parts of equal settings.
    fn parts(&self, live: &[LiveSettings], frames: Range<usize>) -> Vec<Part> {
        let mut parts: Vec<Part> = Vec::new();
        let mut last: Option<LiveSettings> = None;
        for frame in frames {
            let Some(now) = live.get(frame) else { break };
            match parts.last_mut() {
                Some(part) if last.is_some_and(|last| last.same_picture(now)) => part.frames.end = frame + 1,
                _ => {
                    let LiveSettings { probe, render: mut settings, .. } = *now;
                    let Quality { seed, .. } = settings.quality;
                    settings.quality = self.quality.map_or(settings.quality, |quality| quality.with_seed(seed));
                    parts.push(Part { frames: frame..frame + 1, probe, settings });
                }
            }
            last = Some(*now);
        }
        parts
    }
}

/// Controls of the session recorded at `path`, which begins with `probe` and `render`. Warns of those that are refused.
pub(crate) fn recorded_controls(
    path: &Path,
    probe: Probe,
    render: RenderSettings,
    events: &[Event],
) -> ReplayedControls {
    let begin = LiveSettings { probe, render, frozen: false, generator: false };
    let controls = ReplayedControls::new(begin, events);
    for reason in controls.refused() {
        tracing::warn!("{}: {reason}", path.display());
    }
    controls
}

/// Whether an event of a recorded session sets rays or layers.
fn sets_quality(event: &Event) -> bool {
    let says = |key: &str| event.name == key || event.value.as_ref().is_some_and(|value| value.get(key).is_some());
    ["rays", "layers"].into_iter().any(says)
}

impl Replay {
    /// Settings at the first frame.
    pub(crate) fn first(&self) -> Result<&Part, Failure> {
        self.parts.first().ok_or_else(|| Failure::Input(anyhow!("the recording has no frame")))
    }

    /// Number of changes of the settings among the frames.
    pub(crate) fn changes(&self) -> usize {
        self.parts.len().saturating_sub(1)
    }

    /// Applies the quality chosen by the station's budget, if it has one, and reports it. Measured at the poses of the
    /// first, middle and last frame.
    pub(crate) fn choose_quality(&mut self, backend: &Backend, scene: &Scene) -> Result<(), Failure> {
        let Some(frame_budget_ms) = self.frame_budget_ms else { return Ok(()) };
        let Part { probe, settings, .. } = self.first()?;
        let poses = self.timeline.poses.get(self.frames.clone()).unwrap_or_default();
        let last = poses.len().saturating_sub(1);
        let poses: Vec<Pose> = [0, last / 2, last].iter().filter_map(|i| poses.get(*i).copied()).collect();
        let mut renderer = Renderer::new(backend, scene, probe, settings)?;
        let name = scene_name(&self.station);
        let chosen = choose_still(&mut renderer, &name, probe, settings, &poses, frame_budget_ms)?;
        quality::say_chosen(&chosen);
        for Part { settings, .. } in &mut self.parts {
            (settings.quality.rays, settings.quality.layers) = (chosen.quality.rays, chosen.quality.layers);
        }
        Ok(())
    }

    /// Renders all frames in order, two in flight. `before` runs before each submission and may wait. `each` receives
    /// every frame, with the look of its settings, and its index among the requested frames.
    pub(crate) fn render(
        &self,
        backend: &Backend,
        scene: &Scene,
        mut before: impl FnMut(usize),
        mut each: impl FnMut(usize, &Frame) -> Result<(), Failure>,
    ) -> Result<(), Failure> {
        let Part { probe, settings, .. } = self.first()?;
        session::warn_of_effects(scene, probe, settings);
        let mut renderer = Renderer::new(backend, scene, probe, settings)?;
        let mut look = Look::default();
        for Part { frames, probe, settings } in &self.parts {
            let from = frames.start - self.frames.start;
            renderer.reconfigure(probe, settings)?;
            let poses: &[Pose] = self.timeline.poses.get(frames.clone()).unwrap_or_default();
            let before = |i| {
                before(from + i);
                self.timeline.scene_s(frames.start + i)
            };
            let (pixel_mm, angles) = (renderer.sector().pixel_mm, settings.look.independent_angles(probe));
            session::render_paced(&mut renderer, poses, before, |i, frame| {
                let shape = Shape::new(frame.width, pixel_mm, &frame.mask, &settings.image, angles);
                look.apply(&settings.look, shape, &mut frame.bmode);
                each(from + i, frame)
            })?;
        }
        Ok(())
    }
}

#[cfg(test)]
mod tests {
    use super::*;

    #[test]
    fn ranges_are_understood() {
        let range = |text: &str| text.parse::<FrameRange>().map(|r| (r.start, r.end));
        assert_eq!(range("3..7"), Ok((3, Some(7))));
        assert_eq!(range("3.."), Ok((3, None)));
        assert_eq!(range("..7"), Ok((0, Some(7))));
        assert_eq!(range(".."), Ok((0, None)));
        for wrong in ["", "3", "7..3", "3..3", "..0", "a..b", "-1..3", "1...3"] {
            assert!(range(wrong).is_err(), "{wrong}");
        }
    }
}
