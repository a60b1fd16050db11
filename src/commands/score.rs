//! `insonify score`: compares a session with the standard planes.

use std::collections::BTreeMap;
use std::path::PathBuf;

use clap::Parser;
use insonify::anatomy::Mesh;
use insonify::exam::score::{self, MisplacedTime, Reference, Score};
use insonify::files::Outputs;
use insonify::pipeline::replay::RecordedExam;
use insonify::recording::RecordingReport;
use insonify::report::exam as exam_report;
use insonify::settings::{Choice, Effect};
use insonify::station::{PlaneScene, Station};
use serde::Serialize;

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
    /// Time with the probe where no hand can hold it.
    misplaced: Option<MisplacedTime>,
}

/// Runs the command.
pub(crate) fn run(args: &Args) -> Result<(), Failure> {
    let station = Station::load(&args.station)?;
    if let Some(out) = &args.out {
        Outputs::beside(station.files()).and([&args.recording]).replaced("--out", out)?;
    }
    let exam = RecordedExam::read(&args.recording, &station)?;
    warn_of_refused(&args.recording, &exam.refused);
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
        depths_mm: &exam.depths_mm,
    };
    let (score, track) = score::score(&exam.poses, &exam.summary.events, &reference);
    for refused in &score.calipers_refused {
        tracing::warn!("{}: {refused}", args.recording.display());
    }
    let misplaced = MisplacedTime::of(&exam.poses, &reference);
    if let Some(misplaced) = &misplaced {
        tracing::warn!("{}: {misplaced}", args.recording.display());
    }
    if let Some(out) = &args.out {
        let title = args.recording.file_name().map_or_else(String::new, |name| name.to_string_lossy().into_owned());
        exam_report::write(out, &title, &score, &track, &reference)?;
    }
    if args.json {
        let recording = RecordingReport::new(&args.recording, &exam.summary);
        return output::json(&Report {
            recording,
            station: &args.station,
            poses: exam.source,
            score: &score,
            misplaced,
        });
    }
    output::text(&score)?;
    args.out.as_ref().map_or(Ok(()), |out| output::line(format!("\n{}", out.display())))
}
