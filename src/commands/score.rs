//! `insonify score`: compares a recorded session with the standard planes of a scene, and judges its needle.

mod needle;

use std::collections::BTreeMap;
use std::path::PathBuf;

use anyhow::anyhow;
use clap::Parser;
use insonify::Scene;
use insonify::anatomy::Mesh;
use insonify::anatomy::planes::{StandardPlane, StandardPlanes};
use insonify::exam::needle::NeedleScore;
use insonify::exam::planes_of;
use insonify::exam::score::{self, MisplacedTime, Reference, Score};
use insonify::files::Outputs;
use insonify::pipeline::replay::RecordedExam;
use insonify::recording::{Event, RecordingReport};
use insonify::report::exam::{self as exam_report, NeedleReport, PlanesReport};
use insonify::settings::{Choice, Effect};
use insonify::station::{PlaneScene, Station, other_scene};
use serde::Serialize;

use super::replay_args::warn_of_refused;
use super::{Classify, Failure, input, output, session};
use needle::Judge;

/// Note on a session of which no planes are scored.
const NEEDLE_ALONE: &str =
    "Scored: the needle, by the station's exercise; the recording names no standard planes, and --planes chooses some.";

/// Compare a recorded session with the standard planes of the station's scene.
///
/// For each plane, prints whether and when it was found: within its tolerances for a second, with the probe on the
/// skin. Prints deviation, steadiness and measurement errors of the best second. The planes that the recording names
/// are scored (as recordings by `insonify exam` do), else all planes of the scene. Measurements made in the session are
/// compared with true values, too; its texts and body marks are listed. The displayed picture counts, with depth and
/// freeze as set in the session. Planes refer to the scene at rest: their motion by the mother's breathing is not
/// compensated.
///
/// If the station has an exercise with a needle, the needle is scored, too: docs/needle.md. Planes are then scored only
/// where the recording or --planes names them.
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
    /// Source of the names of the scored planes: `option`, `recording` or `scene`; `None` if none are scored.
    planes_from: Option<&'static str>,
    #[serde(flatten)]
    score: Option<&'a Score>,
    /// Score of the needle; left out for stations without an exercise.
    #[serde(skip_serializing_if = "Option::is_none")]
    needle: Option<&'a NeedleScore>,
    /// Time during which the probe was where no hand can hold it; `None` if there was none.
    misplaced: Option<MisplacedTime>,
    /// How the station's scene differs from the recorded session's; `None` if it doesn't.
    other_scene: Option<&'a str>,
    /// Text about the tolerances and their source; `None` if no planes are scored.
    tolerances: Option<&'a str>,
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
    let judge = Judge::of(&station, &scene);
    let needle = judge.as_ref().map(|judge| judge.score(&exam)).transpose()?;
    let events = &exam.summary.events;
    let about_planes = judge.is_none() || !args.planes.is_empty() || !planes_of(events).input()?.is_empty();
    let of_scene = about_planes.then(|| PlaneSurfaces::of(&station, &scene)).transpose()?;
    let subject = of_scene.as_ref().map(|of| Subject::of(args, events, &of.scene.planes)).transpose()?;
    let reference = of_scene.as_ref().zip(subject.as_ref()).map(|(of, subject)| of.reference(&station, &exam, subject));
    let scored = reference.as_ref().map(|reference| score::score(&exam.poses, events, reference));
    let misplaced = scored.as_ref().and_then(|(_, track)| MisplacedTime::of(track));
    let refused = scored.iter().flat_map(|(score, _)| &score.calipers_refused).cloned();
    for doubt in refused.chain(misplaced.as_ref().map(ToString::to_string)) {
        tracing::warn!("{}: {doubt}", args.recording.display());
    }
    let note = subject.as_ref().map_or(NEEDLE_ALONE, |subject| subject.note.as_str());
    if let Some(out) = &args.out {
        let title = args.recording.file_name().map_or_else(String::new, |name| name.to_string_lossy().into_owned());
        let warnings = warnings(&exam, other_scene.as_deref());
        let heading = exam_report::Heading { title: &title, note, warnings: &warnings };
        let planes = scored.as_ref().zip(reference.as_ref());
        let planes = planes.map(|((score, track), reference)| PlanesReport { score, track, reference });
        let exercise = judge.as_ref().map(Judge::reference);
        let needle = needle.as_ref().zip(exercise.as_ref());
        let needle = needle.map(|((score, track), reference)| NeedleReport { score, track, reference });
        exam_report::write(out, heading, planes, needle)?;
    }
    let tolerances = reference.as_ref().map(Reference::tolerances);
    if args.json {
        return output::json(&ScoredSession {
            recording: RecordingReport::new(&args.recording, &exam.summary),
            station: &args.station,
            poses: exam.source,
            planes_from: subject.as_ref().map(|subject| subject.from),
            score: scored.as_ref().map(|(score, _)| score),
            needle: needle.as_ref().map(|(score, _)| score),
            misplaced,
            other_scene: other_scene.as_deref(),
            tolerances: tolerances.as_deref(),
        });
    }
    if let Some((score, _)) = &needle {
        output::text(score)?;
    }
    if let Some((score, _)) = &scored {
        output::text(score)?;
    }
    output::line(format!("\n{note}"))?;
    tolerances.map_or(Ok(()), output::line)?;
    args.out.as_ref().map_or(Ok(()), |out| output::line(format!("\n{}", out.display())))
}

/// Standard planes of the scene, and the surfaces that their calipers name.
struct PlaneSurfaces {
    scene: PlaneScene,
    surfaces: BTreeMap<String, Mesh>,
}

impl PlaneSurfaces {
    fn of(station: &Station, scene: &Scene) -> Result<Self, Failure> {
        let of_scene = PlaneScene::of(station, scene)?;
        let names = of_scene.planes.surfaces();
        let named = scene.surfaces.iter().filter(|surface| names.contains(&surface.name.as_str()));
        let surfaces = named.map(|surface| (surface.name.clone(), surface.mesh.clone())).collect();
        Ok(Self { scene: of_scene, surfaces })
    }

    /// Planes of `subject` with all that the score needs.
    fn reference<'a>(&'a self, station: &'a Station, exam: &'a RecordedExam, subject: &Subject<'a>) -> Reference<'a> {
        Reference {
            planes: subject.planes.clone(),
            scene_planes: self.scene.planes.planes.iter().collect(),
            // If the station does not simulate contact, the picture is complete wherever the probe is.
            skin: (station.settings.effects.of(Effect::Contact) != Choice::Off).then_some(&self.scene.skin),
            surfaces: &self.surfaces,
            contact: &station.settings.contact,
            probe: &station.probe,
            depths_mm: &exam.depths_mm,
        }
    }
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
