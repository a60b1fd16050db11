//! `insonify inspect`: contents of a recording.

use std::path::PathBuf;

use clap::Parser;
use insonify::recording::{
    Event, RecordingReader, RecordingReport, RecordingSummary, SessionSettings, Timing, read_all,
};
use serde::Serialize;

use super::{Failure, output};

/// Say what is in a recording: duration, rate, jitter, gaps, damage, events and settings.
///
/// The `.part` file of a recording that was not finished can be inspected too.
#[derive(Debug, Parser)]
#[command(after_help = "Examples:\n  \
                        insonify inspect assets/exams/obstetric_sweep.mcap\n  \
                        insonify inspect session.mcap --station > station.toml   the station it was made with")]
pub(crate) struct Args {
    /// Recording (.mcap)
    recording: PathBuf,

    /// Print as JSON
    #[arg(long)]
    json: bool,

    /// Print the station file that the recording holds, and nothing else
    #[arg(long, conflicts_with = "json")]
    station: bool,
}

#[derive(Serialize)]
struct Report<'a> {
    #[serde(flatten)]
    recording: RecordingReport<'a>,
    protocol: &'static str,
    start_time_ns: u64,
    sensor: Option<u16>,
    messages: u64,
    bytes: u64,
    poses: usize,
    without_pose: u64,
    session_poses: u64,
    timing: Option<Timing>,
    damage: &'a [String],
    events: &'a [Event],
    settings: Option<&'a SessionSettings>,
}

/// Runs the command.
pub(crate) fn run(args: &Args) -> Result<(), Failure> {
    let (poses, summary) = read_all(RecordingReader::open(&args.recording)?)?;
    let timing = Timing::of(&poses);
    if args.station {
        let station = summary.settings.as_ref().map(|settings| settings.station.trim_end());
        let none = || Failure::Input(anyhow::anyhow!("{} holds no station file", args.recording.display()));
        return output::line(station.filter(|text| !text.is_empty()).ok_or_else(none)?);
    }
    if !args.json {
        return people(args, poses.len(), timing.as_ref(), &summary);
    }
    output::json(&Report {
        recording: RecordingReport::new(&args.recording, &summary),
        protocol: summary.info.protocol.name(),
        start_time_ns: summary.info.start_time_ns,
        sensor: summary.sensor,
        messages: summary.messages,
        bytes: summary.bytes,
        poses: poses.len(),
        without_pose: summary.without_pose,
        session_poses: summary.session_poses,
        timing,
        damage: &summary.damage.damaged_first,
        events: &summary.events,
        settings: summary.settings.as_ref(),
    })
}

fn people(args: &Args, poses: usize, timing: Option<&Timing>, summary: &RecordingSummary) -> Result<(), Failure> {
    let info = &summary.info;
    let or_none = |text: &str| if text.is_empty() { "not given".to_owned() } else { text.to_owned() };
    output::line(format!("{}: {summary}", args.recording.display()))?;
    output::line(format!("protocol   {}", info.protocol.name()))?;
    output::line(format!("device     {}", or_none(&info.device)))?;
    output::line(format!("scene      {}", or_none(&info.scene)))?;
    if let Some(sensor) = summary.sensor {
        output::line(format!("sensor     {sensor}"))?;
    }
    output::line(format!("poses      {poses}, and {} that the session used", summary.session_poses))?;
    if let Some(timing) = timing {
        output::line(format!("rate       {:.2} poses a second", timing.rate_hz))?;
        output::line(format!(
            "interval   p50 {:.2} ms, p95 {:.2} ms, max {:.2} ms; jitter {:.3} ms",
            timing.p50_ms, timing.p95_ms, timing.max_ms, timing.jitter_ms
        ))?;
        output::line(format!("gaps       {} of more than 250 ms", timing.gap_count))?;
        for gap in &timing.gaps {
            output::line(format!("           at {:.2} s for {:.2} s", gap.at_s, gap.length_s))?;
        }
    }
    if let Some(settings) = &summary.settings {
        output::line(format!("made by    insonify {}, seed {}", settings.version, settings.seed))?;
        output::line(format!("adapter    {}", or_none(&settings.adapter)))?;
        output::line(format!(
            "station    {} ({} bytes; --station prints it)",
            or_none(&settings.station_path),
            settings.station.len()
        ))?;
    }
    output::line(format!("events     {}", summary.events.len()))?;
    for event in &summary.events {
        let seconds = (i128::from(event.host_time_ns) - i128::from(info.start_time_ns)) as f64 * 1e-9;
        let value = event.value.as_ref().map_or_else(String::new, |value| format!(" = {value}"));
        output::line(format!("  {seconds:9.3} s  {}{value}", event.name))?;
    }
    Ok(())
}
