//! `insonify score`: compares a recorded session with the standard planes of a scene.

use std::collections::BTreeMap;
use std::path::PathBuf;

use anyhow::anyhow;
use clap::Parser;
use insonify::anatomy::Mesh;
use insonify::anatomy::planes::{StandardPlane, StandardPlanes};
use insonify::exam::planes_of;
use insonify::exam::score::{self, MisplacedTime, Reference, Score};
use insonify::files::Outputs;
use insonify::pipeline::replay::RecordedExam;
use insonify::recording::{Event, RecordingReport};
use insonify::report::exam as exam_report;
use insonify::settings::{Choice, Effect};
use insonify::station::{PlaneScene, Station, other_scene};
use serde::Serialize;

use super::replay_args::warn_of_refused;
use super::{Failure, input, output, session};

/// Compare a recorded session with the standard planes of the station's scene.
///
/// For each plane, prints whether and when it was found: within its tolerances for a second, with the probe on the
/// skin. Prints deviation, steadiness and measurement errors of the best second. The planes that the recording names
/// are scored (as recordings by `insonify exam` do), else all planes of the scene. Measurements made in the session are
/// compared with true values, too; its texts and body marks are listed. The displayed picture counts, with depth and
/// freeze as set in the session. Planes refer to the scene at rest: their motion by the mother's breathing is not
/// compensated.
#[derive(Debug, Parser)]
#[command(after_help = "Examples:\n  \
                        insonify score session.mcap configs/obstetric.toml --out session.html\n  \
                        insonify score session.mcap configs/obstetric.toml --planes head,abdomen --json\n\n\
                        A caliper of another program is the event {\"name\": \"caliper\", \"value\": {\"measure\": \"BPD\", \
                        \"points_mm\": [[x, z], [x, z]]}} in the recording: mm right of the image's middle line and mm \
                        below the centre of the probe's face; three points are an angle (its corner second), four an ellipse.")]
pub(crate) struct Args {
    /// Recording (.mcap)
    recording: PathBuf,

    /// Station file (TOML) whose scene has standard planes
    station: PathBuf,

    /// Planes to score, or `all` [default: those that the recording names, else all planes of the scene]
    #[arg(long, value_name = "A,B,...", value_delimiter = ',', value_parser = input::plane)]
    planes: Vec<String>,

    /// Also write a page (.html) with pictures of the probe's deviations and path
    #[arg(long, value_name = "FILE", value_parser = input::html)]
    out: Option<PathBuf>,

    /// Print the score as JSON
    #[arg(long)]
    json: bool,
}

#[derive(Serialize)]
struct ScoredSession<'a> {
    recording: RecordingReport<'a>,
    station: &'a PathBuf,
    /// Source of the poses: `session`, or `tracker` (with the station's calibration).
    poses: &'static str,
    /// Source of the names of the scored planes: `option`, `recording` or `scene`.
    planes_from: &'static str,
    #[serde(flatten)]
    score: &'a Score,
    /// Time during which the probe was where no hand can hold it; `None` if there was none.
    misplaced: Option<MisplacedTime>,
    /// How the station's scene differs from the recorded session's; `None` if it doesn't.
    other_scene: Option<&'a str>,
    /// Text about the tolerances and their source.
    tolerances: &'a str,
}

/// Runs the command.
pub(crate) fn run(args: &Args) -> Result<(), Failure> {
    input::expect_recording(&args.recording, &args.station)?;
    let station = Station::load(&args.station)?;
    if let Some(out) = &args.out {
        Outputs::apart_from(station.files()).and([&args.recording]).replaced("--out", out)?;
    }
    let exam = RecordedExam::read(&args.recording, &station)?;
    warn_of_refused(&args.recording, &exam.refused);
    let other_scene = other_scene(&exam.summary.info.scene, &station);
    if let Some(other) = &other_scene {
        tracing::warn!("{}: {other}", args.recording.display());
    }
    let scene = session::load_scene(&station)?;
    let PlaneScene { planes, skin } = PlaneScene::of(&station, &scene)?;
    let names = planes.surfaces();
    let named = scene.surfaces.into_iter().filter(|surface| names.contains(&surface.name.as_str()));
    let surfaces: BTreeMap<String, Mesh> = named.map(|surface| (surface.name, surface.mesh)).collect();
    let subject = Subject::of(args, &exam.summary.events, &planes)?;
    let reference = Reference {
        planes: subject.planes.clone(),
        scene_planes: planes.planes.iter().collect(),
        // If the station does not simulate contact, the picture is complete wherever the probe is.
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
    let misplaced = MisplacedTime::of(&track);
    if let Some(misplaced) = &misplaced {
        tracing::warn!("{}: {misplaced}", args.recording.display());
    }
    if let Some(out) = &args.out {
        let title = args.recording.file_name().map_or_else(String::new, |name| name.to_string_lossy().into_owned());
        let warnings = warnings(&exam, other_scene.as_deref());
        let heading = exam_report::Heading { title: &title, note: &subject.note, warnings: &warnings };
        exam_report::write(out, heading, &score, &track, &reference)?;
    }
    let tolerances = reference.tolerances();
    if args.json {
        let recording = RecordingReport::new(&args.recording, &exam.summary);
        let (station, planes_from) = (&args.station, subject.from);
        let poses = exam.source;
        let (other_scene, tolerances, score) = (other_scene.as_deref(), tolerances.as_str(), &score);
        return output::json(&ScoredSession {
            recording,
            station,
            poses,
            planes_from,
            score,
            misplaced,
            other_scene,
            tolerances,
        });
    }
    output::text(&score)?;
    output::line(format!("\n{}\n{tolerances}", subject.note))?;
    args.out.as_ref().map_or(Ok(()), |out| output::line(format!("\n{}", out.display())))
}

/// Reasons to doubt the score: another scene, a damaged recording, refused settings.
fn warnings(exam: &RecordedExam, other_scene: Option<&str>) -> Vec<String> {
    let mut warnings: Vec<String> = other_scene.map(str::to_owned).into_iter().collect();
    if !exam.summary.is_clean() {
        let summary = exam.summary.to_string().replace('\n', "; ");
        warnings.push(format!("the recording is not complete, and what is left of it was scored: {summary}"));
    }
    warnings.extend_from_slice(&exam.refused);
    warnings
}

/// Standard planes to score.
struct Subject<'a> {
    planes: Vec<&'a StandardPlane>,
    /// Source of the planes' names: `option`, `recording` or `scene`.
    from: &'static str,
    /// Sentence for the user about that source.
    note: String,
}

impl<'a> Subject<'a> {
    /// Planes named by the option, else by the recording's `events`, else all planes of the scene.
    fn of(args: &Args, events: &[Event], scene: &'a StandardPlanes) -> Result<Self, Failure> {
        const CHOOSE: &str = "choose them with --planes head,abdomen, or --planes all";
        let all = scene.planes.len();
        if args.planes.iter().map(String::as_str).eq([input::ALL_PLANES]) {
            let note = format!("Scored: all {all} planes of the scene, as --planes asks.");
            return Ok(Self { planes: scene.planes.iter().collect(), from: "option", note });
        }
        if !args.planes.is_empty() {
            let planes = input::chosen(&args.planes, scene)?;
            let note = format!("Scored: {} of the scene's {all} planes, as --planes asks.", planes.len());
            return Ok(Self { planes, from: "option", note });
        }
        let recording = args.recording.display();
        let names = planes_of(events).map_err(|e| Failure::Input(anyhow!("{recording}: {e}; {CHOOSE}")))?;
        if names.is_empty() {
            let note = format!("Scored: all {all} planes of the scene, since the recording names none; {CHOOSE}.");
            return Ok(Self { planes: scene.planes.iter().collect(), from: "scene", note });
        }
        let planes = scene.chosen(&names).map_err(|e| {
            Failure::Input(anyhow!("{recording} is about the planes {}: {e}; {CHOOSE}", names.join(", ")))
        })?;
        let note = format!(
            "Scored: the planes of the recording's exam ({}). The scene has {all}; --planes all scores them all.",
            names.join(", ")
        );
        Ok(Self { planes, from: "recording", note })
    }
}
