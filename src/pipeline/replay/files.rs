//! Writes a replay as pictures, a video and a record.

use std::fmt;
use std::ops::Range;
use std::path::{Path, PathBuf};
use std::sync::Arc;
use std::time::Instant;

use serde::Serialize;
use sha2::{Digest, Sha256};

use super::{Pace, Replay, ReplayError, Stretch};
use crate::anatomy::Scene;
use crate::files::hex;
use crate::recording::{MarkReport, Marks, RecordingReport, RecordingSummary};
use crate::render::{Backend, warn_of_overflows};
use crate::report::TimeTable;
use crate::report::time_table::{SideBySide, StageTime};
use crate::settings::{ImageSettings, LookSettings, Probe, RenderSettings};
use crate::sink::frame_files::tissue_numbers;
use crate::sink::frame_record::{AdapterRecord, PoseRecord};
use crate::sink::png::{self, Effort};
use crate::sink::{Video, npy, remove, write_json};

/// Record of a written replay, the content of `replay.json`. [`Display`](fmt::Display) lists what was written.
#[derive(Debug, Serialize)]
pub struct WrittenReplay<'a> {
    version: &'static str,
    recording: RecordingReport<'a>,
    station: &'a Path,
    adapter: AdapterRecord,
    probe: Probe,
    quality: RenderSettings,
    fps: f64,
    /// Number of frames written.
    rendered: usize,
    /// Number of rendered frames with a held (earlier) pose, in or just after gaps of the recording.
    held: usize,
    /// Number of changes of settings by the recorded session within these frames.
    changes: usize,
    /// Runs of frames with the same settings, in order.
    parts: Vec<PartEntry>,
    /// Number of frames with hits or interactions that did not fit the buffers.
    overflowed: usize,
    /// Time from submitting the first frame to writing the last one, s.
    wall_s: f64,
    /// Greatest delay of a frame at the requested speed, s; `None` at full speed.
    #[serde(skip_serializing_if = "Option::is_none")]
    behind_s: Option<f64>,
    /// SHA-256 over image, segmentation and attenuation of all frames, in order.
    frames_sha256: String,
    times: Vec<StageTime>,
    video: PathBuf,
    /// Marks of the recorded session on these frames.
    #[serde(skip_serializing_if = "Vec::is_empty")]
    marks: Vec<FrameMark>,
    /// Time and pose of each frame; may be emptied before printing.
    #[serde(skip_serializing_if = "Vec::is_empty")]
    pub frames: Vec<FrameEntry>,
    #[serde(skip)]
    table: TimeTable,
    #[serde(skip)]
    summary: &'a RecordingSummary,
}

/// Consecutive frames with the same settings.
#[derive(Debug, Serialize)]
struct PartEntry {
    /// Index of the first frame.
    first: usize,
    /// Number of frames.
    frames: usize,
    probe: Probe,
    quality: RenderSettings,
    look: LookSettings,
    #[serde(flatten)]
    image: ImageSettings,
}

impl From<&Stretch> for PartEntry {
    fn from(&Stretch { ref frames, probe, settings }: &Stretch) -> Self {
        let RenderSettings { look, image, .. } = settings;
        Self { first: frames.start, frames: frames.len(), probe, quality: settings, look, image }
    }
}

/// A mark on a frame.
#[derive(Debug, Serialize)]
struct FrameMark {
    /// Index of the frame nearest to the marked picture.
    index: usize,
    #[serde(flatten)]
    mark: MarkReport,
}

/// Time and pose of a frame.
#[derive(Debug, Serialize)]
pub struct FrameEntry {
    index: usize,
    time_s: f64,
    pose: PoseRecord,
    /// Pose of the needle; `None` where it is unknown, and without a needle.
    #[serde(skip_serializing_if = "Option::is_none")]
    needle: Option<PoseRecord>,
    held: bool,
}

/// Names of a replay's files below its directory; a `*` stands for anything.
pub const REPLAY_FILES: [&str; 9] = [
    "bmode/*.png",
    "video.mp4",
    "video.part.mp4",
    "segmentation/*.png",
    "attenuation/*.npy",
    "mask.png",
    "mask_*.png",
    "tissues.json",
    "replay.json",
];

impl Replay {
    /// Renders all frames into [`REPLAY_FILES`] below `out`: a PNG of each frame, and a video; with `maps` also
    /// segmentation (PNG) and attenuation (NPY) of each frame. `pace` delays each frame until it is due. `progress`
    /// receives the number of finished frames.
    ///
    /// # Errors
    /// A frame that can't be rendered, or a file that can't be written.
    pub fn write(
        &self,
        backend: &Backend,
        scene: &Scene,
        out: &Path,
        maps: bool,
        mut pace: Pace,
        progress: &dyn Fn(usize),
    ) -> Result<WrittenReplay<'_>, ReplayError> {
        let Range { start, end } = self.frames;
        let Stretch { probe, settings, .. } = self.first()?;
        // Output of an earlier replay must not pass for this one's.
        remove(&out.join("replay.json"))?;
        let left = earlier_frames(out, start..end);
        if left > 0 {
            tracing::warn!("{} holds {left} frames of an earlier replay that this one does not replace", out.display());
        }
        let mut video = Video::create(&out.join("video"), settings.image.width, settings.image.height, self.rate)?;
        let (mut table, mut overflowed, mut hash, mut mask) = (TimeTable::default(), 0, Sha256::new(), Arc::default());
        let started = Instant::now();
        self.render(
            backend,
            scene,
            |i| pace.wait(i),
            |i, frame| {
                let name = |map: &str, extension| out.join(map).join(format!("{:05}.{extension}", start + i));
                let (w, h) = (frame.width, frame.height);
                png::write_grey(&name("bmode", "png"), w, h, &frame.bmode, Effort::Fast)?;
                video.push(&frame.bmode)?;
                if maps {
                    png::write_grey(&name("segmentation", "png"), w, h, &frame.segmentation, Effort::Fast)?;
                    npy::write_f32(&name("attenuation", "npy"), [h as usize, w as usize], &frame.attenuation)?;
                }
                if mask != frame.mask {
                    // The sector depends on the depth, so each depth has a mask of its own.
                    let name = if i == 0 { "mask.png".to_owned() } else { format!("mask_{:05}.png", start + i) };
                    png::write_grey(&out.join(name), w, h, &frame.mask, Effort::Small)?;
                    mask.clone_from(&frame.mask);
                }
                hash.update(&frame.bmode);
                hash.update(&frame.segmentation);
                hash.update(bytemuck::cast_slice::<f32, u8>(&frame.attenuation));
                table.push(&frame.times);
                overflowed += usize::from(frame.overflows > 0);
                progress(i + 1);
                Ok::<(), ReplayError>(())
            },
        )?;
        let video = video.finish()?;
        let wall_s = started.elapsed().as_secs_f64();
        write_json(&out.join("tissues.json"), &tissue_numbers(&scene.tissues))?;
        warn_of_overflows(overflowed);
        let written = WrittenReplay {
            version: env!("CARGO_PKG_VERSION"),
            recording: RecordingReport::new(&self.path, &self.summary),
            station: &self.station.path,
            adapter: backend.into(),
            probe: *probe,
            quality: *settings,
            fps: self.rate.fps(),
            rendered: end - start,
            held: self.timeline.held_in(start..end),
            changes: self.changes(),
            parts: self.stretches.iter().map(PartEntry::from).collect(),
            overflowed,
            wall_s,
            behind_s: pace.behind_s(),
            frames_sha256: hex(&hash.finalize()),
            times: table.stages(),
            video,
            marks: self.marks(),
            frames: (start..end).map(|index| self.entry(index)).collect(),
            table,
            summary: &self.summary,
        };
        write_json(&out.join("replay.json"), &written)?;
        Ok(written)
    }

    /// Marks on the requested frames, in the order in which they were set.
    fn marks(&self) -> Vec<FrameMark> {
        let start_ns = self.summary.info.start_time_ns;
        let marks = Marks::of(&self.summary.events).all;
        let on_frames = marks.iter().map(|mark| {
            let index = self.timeline.nearest(mark.picture_time_ns());
            FrameMark { index, mark: MarkReport::new(mark, start_ns) }
        });
        on_frames.filter(|mark| self.frames.contains(&mark.index)).collect()
    }

    fn entry(&self, index: usize) -> FrameEntry {
        let timeline = &self.timeline;
        let (time_s, held) = (timeline.seconds(index), timeline.is_held(index));
        let needle = timeline.needles.get(index).copied().flatten();
        let needle = needle.map(|needle| PoseRecord::from(&needle.scene_from_needle));
        FrameEntry { index, time_s, pose: PoseRecord::from(&timeline.poses[index]), needle, held }
    }
}

impl fmt::Display for WrittenReplay<'_> {
    fn fmt(&self, f: &mut fmt::Formatter<'_>) -> fmt::Result {
        let Self { rendered, wall_s, held, changes, fps, .. } = self;
        let name = self.quality.quality.name();
        writeln!(f, "{}: {}", self.recording.path, self.summary)?;
        writeln!(f, "{rendered} frames at {name} in {wall_s:.1} s on {}", self.adapter.name)?;
        if *held > 0 {
            writeln!(f, "{held} of them in gaps of the recording or just behind: they hold a pose")?;
        }
        if *changes > 0 {
            writeln!(f, "the settings change {changes} times, as they did in the recorded session")?;
        }
        if let Some(behind_s) = self.behind_s.filter(|s| *s > 0.5 / fps) {
            writeln!(f, "this machine does not keep up: frames came up to {behind_s:.2} s late")?;
        }
        writeln!(f, "\n{}\n", SideBySide(&[(&name, &self.table)]))?;
        writeln!(f, "sha256   {} (of all frames)", self.frames_sha256)?;
        writeln!(f, "video    {}", self.video.display())?;
        writeln!(f, "frames   {}", self.video.with_file_name("bmode").display())
    }
}

/// Number of earlier frame files below `out` that a replay of `frames` would not overwrite.
fn earlier_frames(out: &Path, frames: Range<usize>) -> usize {
    let files = ["bmode", "segmentation", "attenuation"].iter().filter_map(|map| std::fs::read_dir(out.join(map)).ok());
    let numbers = files.flatten().flatten().filter_map(|file| file.path().file_stem()?.to_str()?.parse().ok());
    numbers.filter(|number| !frames.contains(number)).count()
}
