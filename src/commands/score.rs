//! `insonify score`: compares a session with the standard planes.

use std::collections::BTreeMap;
use std::path::PathBuf;

use anyhow::anyhow;
use clap::Parser;
use insonify::anatomy::Mesh;
use insonify::exam::score::{self, Reference, Score};
use insonify::pipeline::ReplayedControls;
use insonify::pose::{TimedPose, TrackingState};
use insonify::recording::{RecordingReader, RecordingReport, read_both};
use insonify::report::exam as exam_report;
use insonify::settings::{Choice, Effect, LiveSettings};
use insonify::station::{PlaneScene, Station};
use serde::Serialize;

use super::outputs::Outputs;
use super::replay_args::warn_of_refused;
use super::{Failure, input, output, session};

/// Compare a recorded session with the standard planes of the station's scene.
///
/// For each plane: whether it was found (within its tolerances for a second, the probe on the skin), when, how far off the
/// best second was, how steady it was held, and what would be measured there against the truth. Caliper events of the
/// session are compared with the truth, too. What counts is what was on the screen: depth and freeze as they were set in
/// the session. Planes are those of the scene at rest: that a mother's breath moves them is not taken out.
#[derive(Debug, Parser)]
#[command(after_help = "Examples:\n  \
                        insonify score session.mcap configs/obstetric.toml --out session.html\n  \
                        insonify score session.mcap configs/obstetric.toml --planes head,abdomen --json\n\n\
                        A caliper is the event {\"name\": \"caliper\", \"value\": {\"measure\": \"BPD\", \
                        \"points_mm\": [[x, z], [x, z]]}} in the recording: mm right of the image's middle line and mm \
                        below the centre of the probe's face; four points are an ellipse.")]
pub(crate) struct Args {
    /// Recording (.mcap)
    recording: PathBuf,

    /// Station file (TOML) whose scene has standard planes
    station: PathBuf,

    /// Planes that count [default: all of the scene]
    #[arg(long, value_name = "A,B,...", value_delimiter = ',')]
    planes: Vec<String>,

    /// Also write a page to look at (.html), with pictures of how far off the probe was and where it went
    #[arg(long, value_name = "FILE", value_parser = input::html)]
    out: Option<PathBuf>,

    /// Print the score as JSON
    #[arg(long)]
    json: bool,
}

#[derive(Serialize)]
struct Report<'a> {
    recording: RecordingReport<'a>,
    station: &'a PathBuf,
    /// Source of the poses: `session`, or `tracker` with the station's calibration.
    poses: &'static str,
    #[serde(flatten)]
    score: &'a Score,
}

/// Runs the command.
pub(crate) fn run(args: &Args) -> Result<(), Failure> {
    let station = Station::load(&args.station)?;
    if let Some(out) = &args.out {
        Outputs::beside_station(&station).and([&args.recording]).replaced("--out", out)?;
    }
    let (raw, used, summary) = read_both(RecordingReader::open(&args.recording)?)?;
    summary.warn_of_damage(&args.recording);
    // Scores the poses shown in the session; without any, the tracker's poses with the station's calibration.
    let (mut poses, source): (Vec<TimedPose>, _) = if used.is_empty() {
        let calibration = station.pose_settings()?.calibration;
        (raw.iter().map(|t| TimedPose { pose: calibration.scene_from_probe(t.pose), ..*t }).collect(), "tracker")
    } else {
        let shown = used.iter().filter(|p| p.state <= TrackingState::Stuck);
        let timed = shown.map(|p| TimedPose {
            host_time_ns: p.host_time_ns,
            device_time_us: p.host_time_ns / 1000,
            pose: p.pose,
        });
        (timed.collect(), "session")
    };
    if poses.is_empty() {
        return Err(Failure::Input(anyhow!("{} holds no pose to score", args.recording.display())));
    }
    let begin = LiveSettings { probe: station.probe, render: station.settings, frozen: false, generator: false };
    let mut controls = ReplayedControls::new(begin, &summary.events);
    warn_of_refused(&args.recording, controls.refused());
    let depths_mm = shown(&mut poses, &mut controls);
    let scene = session::load_scene(&station)?;
    let PlaneScene { planes, skin } = PlaneScene::of(&station, &scene)?;
    let names = planes.surfaces();
    let named = scene.surfaces.into_iter().filter(|surface| names.contains(&surface.name.as_str()));
    let surfaces: BTreeMap<String, Mesh> = named.map(|surface| (surface.name, surface.mesh)).collect();
    let reference = Reference {
        planes: planes.chosen(&args.planes)?,
        // A station that simulates no contact shows the whole picture wherever the probe is.
        skin: (station.settings.effects.of(Effect::Contact) != Choice::Off).then_some(&skin),
        surfaces: &surfaces,
        contact: &station.settings.contact,
        probe: &station.probe,
        depths_mm: &depths_mm,
    };
    let (score, track) = score::score(&poses, &summary.events, &reference);
    for refused in &score.calipers_refused {
        tracing::warn!("{}: {refused}", args.recording.display());
    }
    if let Some(out) = &args.out {
        let title = args.recording.file_name().map_or_else(String::new, |name| name.to_string_lossy().into_owned());
        exam_report::write(out, &title, &score, &track, &reference)?;
    }
    if args.json {
        let recording = RecordingReport::new(&args.recording, &summary);
        return output::json(&Report { recording, station: &args.station, poses: source, score: &score });
    }
    output::text(&score)?;
    args.out.as_ref().map_or(Ok(()), |out| output::line(format!("\n{}", out.display())))
}

/// Holds the pose while the picture is frozen. Returns the image depth at each pose, mm.
fn shown(poses: &mut [TimedPose], controls: &mut ReplayedControls) -> Vec<f64> {
    let mut last = None;
    let mut each = |timed: &mut TimedPose| {
        let live = controls.at(timed.host_time_ns);
        if live.frozen {
            timed.pose = last.unwrap_or(timed.pose);
        }
        last = Some(timed.pose);
        live.probe.depth_mm
    };
    poses.iter_mut().map(&mut each).collect()
}

#[cfg(test)]
mod tests {
    use insonify::recording::Event;
    use insonify::settings::{LiveSettings, Probe};

    use super::*;

    #[test]
    fn the_picture_on_the_screen_counts() {
        let pose = |i: u64| {
            let pose = insonify::pose::Pose::from_components([i as f64, 0.0, 0.0, 1.0, 0.0, 0.0, 0.0]).unwrap();
            TimedPose { host_time_ns: 1000 + 10 * i, device_time_us: 0, pose }
        };
        let mut poses: Vec<TimedPose> = (0..5).map(pose).collect();
        let event = |time_ns, name: &str, value: serde_json::Value| Event::new(time_ns, name).with(value);
        let events = [
            event(1010, "depth_mm", 90.0.into()),
            event(1020, "frozen", true.into()),
            event(1040, "frozen", false.into()),
        ];
        let mut controls = ReplayedControls::new(LiveSettings::default(), &events);
        assert_eq!(controls.refused(), [] as [String; 0]);
        let depths = shown(&mut poses, &mut controls);
        assert_eq!(depths, [Probe::default().depth_mm, 90.0, 90.0, 90.0, 90.0]);
        let xs: Vec<f64> = poses.iter().map(|p| p.pose.position_mm.x).collect();
        assert_eq!(xs, [0.0, 1.0, 1.0, 1.0, 4.0]);
    }
}
