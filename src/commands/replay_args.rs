//! Arguments of commands that render a recorded session with its poses and settings.

use std::path::{Path, PathBuf};

use anyhow::Context as _;
use clap::Args;
use insonify::anatomy::Scene;
use insonify::pipeline::OtherSetting;
use insonify::pipeline::replay::{FrameRange, Replay, ReplayError, ReplayOptions, Stretch};
use insonify::render::{Backend, FrameQuality};
use insonify::sink::FrameRate;
use insonify::station::{Station, other_scene};

use super::effects::EffectArgs;
use super::quality;
use super::{Classify, Failure, input, session};

/// Recording to replay, and the options for it.
#[derive(Debug, Args)]
pub(crate) struct ReplayArgs {
    /// Recording (.mcap)
    pub(crate) recording: PathBuf,

    /// Station file (TOML); `insonify station-keys` lists its keys
    pub(crate) station: PathBuf,

    #[arg(long, value_name = "QUALITY", help = quality::help("the recorded session's, else the station's"))]
    quality: Option<FrameQuality>,

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

    /// Ignore settings that were changed in the recorded session: gain, dynamic range, TGC, freeze, depth, focus, look,
    /// harmonics, quality
    #[arg(long)]
    ignore_controls: bool,
}

impl ReplayArgs {
    /// Reads station and recording. Prints remarks on what may surprise the user.
    pub(crate) fn read(&self) -> Result<Replay, Failure> {
        let rate = FrameRate::new(self.fps)?;
        input::expect_recording(&self.recording, &self.station)?;
        let mut station = Station::load(&self.station)?;
        self.effects.apply(&mut station.settings);
        let options = ReplayOptions {
            rate,
            frames: self.frames,
            quality: self.quality,
            seed: self.seed,
            raw_poses: self.raw_poses,
            ignore_controls: self.ignore_controls,
        };
        let replay = match Replay::read(&self.recording, station, &options) {
            Err(error @ ReplayError::Start { .. }) => Err(error).context("--frames").input()?,
            other => other?,
        };
        if let Some(ms) = replay.overruled_budget_ms {
            eprintln!("the recorded session says its quality: quality.frame_budget_ms = {ms} chooses nothing");
        }
        warn_of_refused(&self.recording, &replay.refused);
        if let Some(other) = other_scene(&replay.summary.info.scene, &replay.station) {
            tracing::warn!("{}: {other}", self.recording.display());
        }
        self.say_others(&replay);
        Ok(replay)
    }

    /// Prints settings that differ between the start of the recorded session and the station.
    fn say_others(&self, replay: &Replay) {
        // A quality chosen on the command line differs on purpose.
        let chosen = self.quality.is_some() || replay.station.frame_budget_ms.is_some();
        let others = replay.others_at_start.iter().filter(|o| !chosen || !matches!(&*o.key, "rays" | "layers"));
        let text = |OtherSetting { key, recorded, here }: &OtherSetting| format!("{key} {recorded} (station: {here})");
        let others: Vec<String> = others.map(text).collect();
        if others.is_empty() {
            return;
        }
        eprintln!(
            "{}: the recorded session began with other settings than the station's: {}; --ignore-controls leaves the station's",
            self.recording.display(),
            others.join(", ")
        );
    }
}

/// Warns of settings in the session recorded at `path` that were refused.
pub(crate) fn warn_of_refused(path: &Path, refused: &[String]) {
    for reason in refused {
        tracing::warn!("{}: {reason}", path.display());
    }
}

/// Chooses and prints the quality for the station's frame budget, if the station has one. Also warns of missing
/// effects.
pub(crate) fn choose_quality(replay: &mut Replay, backend: &Backend, scene: &Scene) -> Result<(), Failure> {
    if let Some(chosen) = replay.choose_quality(backend, scene)? {
        quality::say_chosen(&chosen);
    }
    let Stretch { probe, settings, .. } = replay.first()?;
    session::warn_of_effects(scene, probe, settings);
    Ok(())
}
