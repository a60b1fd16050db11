//! Landmarks that the user touches with a live tracker.

use std::io::BufRead;
use std::path::{Path, PathBuf};
use std::time::Duration;

use anyhow::{Context, anyhow};
use glam::DVec3;
use insonify::anatomy::{Axes, import};
use insonify::files::FileKind;
use insonify::phantom;
use insonify::pose::csv::{self, Named};
use insonify::pose::landmark::{StillSettings, Touched, touch};
use insonify::pose::registration::PointPair;
use insonify::pose::{Calibration, fit_so_far};
use insonify::recording::spawn;
use insonify::segmentation::skin_points;
use insonify::station::{SceneSource, Station};
use insonify::tracker::pose_tap;
use tokio_util::sync::CancellationToken;

use super::super::{Classify, Failure, input, tracker_args};
use super::{calibration_file, positive};

/// Time without a pose after which the tracker counts as lost.
const SILENCE: Duration = Duration::from_secs(2);

/// Least distance between two landmarks, mm.
const APART_MM: f64 = 1.0;

/// Largest number of poses examined for a still tip, as a multiple of the number needed.
const PATIENCE: usize = 10;

/// Options of touching landmarks.
#[derive(Debug, clap::Args)]
pub(super) struct TouchArgs {
    /// Touch the landmarks with the tracker of this station (TOML)
    #[arg(long, value_name = "STATION")]
    pub(super) tracker: Option<PathBuf>,

    /// Points of the scene to touch: a table x,y,z,name (mm), or 3D Slicer's markups (.fcsv, .mrk.json) [default: those of the station's phantom, or SCENE.points.csv]
    #[arg(long, value_name = "FILE", requires = "tracker")]
    points: Option<PathBuf>,

    /// Sensor of the stylus [default: the station's]
    #[arg(long, requires = "tracker")]
    sensor: Option<u16>,

    /// OpenIGTLink name of the stylus's tool [default: the station's]
    #[arg(long, value_name = "NAME", requires = "tracker", conflicts_with = "sensor")]
    tool: Option<String>,

    /// Number of poses averaged for each landmark, 2..=10000
    #[arg(long, value_name = "N", default_value_t = 60, requires = "tracker", value_parser = clap::value_parser!(u16).range(2..=10_000))]
    samples: u16,

    /// Largest distance of a still tip from its mean position, mm
    #[arg(long, value_name = "MM", default_value_t = 1.0, requires = "tracker", value_parser = positive, allow_negative_numbers = true)]
    tolerance: f64,
}

/// Records the landmarks that the user touches. Returns them, and the calibration file to write: `out`, else the
/// station's.
pub(super) fn run(
    path: &Path,
    args: &TouchArgs,
    out: Option<&Path>,
) -> Result<(Vec<Named<PointPair>>, PathBuf), Failure> {
    let station = Station::load(path)?;
    let mut settings = tracker_args::of_station(&station)?;
    settings.device.choose(args.sensor, args.tool.clone());
    let out = calibration_file(&station, out, &args.points)?;
    let points = points(args, &station)?;
    distinct(&points).map_err(|fault| anyhow!("the points to touch: {fault}")).input()?;
    let (tip_mm, tip) = tip(&station, &out)?;
    let samples = usize::from(args.samples);
    let still = StillSettings { samples, tolerance_mm: args.tolerance, poses_max: PATIENCE * samples };

    let (tap, stream) = pose_tap();
    let cancel = CancellationToken::new();
    let session = spawn(&settings, Box::new(tap), cancel.clone())?;
    let pairs = ask(&points, tip, &mut std::io::stdin().lock(), |point| {
        let touched = touch(stream.poses(SILENCE), tip_mm, &still);
        touched.map_err(|error| format!("`{}` is not taken: {error}; {stream}", point.name))
    });
    cancel.cancel();
    session.join();
    Ok((pairs?, out))
}

/// Landmarks to touch, in the scene's axes.
fn points(args: &TouchArgs, station: &Station) -> Result<Vec<Named<DVec3>>, Failure> {
    if let Some(path) = &args.points {
        return read(path, station);
    }
    match &station.scene {
        SceneSource::ObstetricPhantom(options) => Ok(phantom::fiducials(&options.parameters)),
        SceneSource::File(scene) if skin_points::points_path(scene).is_file() => {
            read(&skin_points::points_path(scene), station)
        }
        SceneSource::File(scene) => Err(Failure::Input(anyhow!(
            "no landmarks of {} are known: give --points FILE, a table x,y,z,name (mm in the scene) or 3D Slicer's markups (.fcsv, .mrk.json), or write them to {}",
            scene.display(),
            skin_points::points_path(scene).display()
        ))),
    }
}

/// Refuses two points with the same name, or closer than `APART_MM`.
fn distinct(points: &[Named<DVec3>]) -> Result<(), String> {
    for (at, Named { name, value }) in points.iter().enumerate() {
        for other in &points[at + 1..] {
            if other.name.eq_ignore_ascii_case(name) {
                return Err(format!("`{name}` is there twice; give each a name of its own"));
            }
            let apart_mm = value.distance(other.value);
            if apart_mm < APART_MM {
                let other = &other.name;
                return Err(format!(
                    "`{name}` and `{other}` lie {apart_mm:.2} mm apart in the scene; give each a place of its own, at least {APART_MM} mm away"
                ));
            }
        }
    }
    Ok(())
}

/// Reads landmarks from `path`, and converts them to the scene's axes.
fn read(path: &Path, station: &Station) -> Result<Vec<Named<DVec3>>, Failure> {
    let found = csv::points(&input::text(path, FileKind::Table, "the points")?).input_of(path)?;
    found.notes.iter().for_each(|note| tracing::warn!("{}: {note}", path.display()));
    if !found.in_lps {
        return Ok(found.values);
    }
    let axes = scene_axes(station, path)?;
    let in_scene = |point: Named<DVec3>| Named { value: axes.from_lps(point.value), ..point };
    Ok(found.values.into_iter().map(in_scene).collect())
}

/// Axes of the station's scene, for points in LPS from the file `path`. Warns if the scene doesn't state its axes.
pub(super) fn scene_axes(station: &Station, path: &Path) -> Result<Axes, Failure> {
    let axes = match &station.scene {
        SceneSource::ObstetricPhantom(_) => Axes::Anatomical,
        SceneSource::File(scene) => import::axes(scene)?,
    };
    if axes == Axes::Depth {
        tracing::warn!(
            "{}: its points are in LPS, and the scene doesn't say how its patient lies (`extras.axes`): its x, y and z are taken as left, posterior and superior",
            path.display()
        );
    }
    Ok(axes)
}

/// Position of the touching tip in the frame of its sensor, mm, and a name of the tip for the user. `file` is another
/// calibration file that may hold the position.
fn tip(station: &Station, file: &Path) -> Result<(DVec3, &'static str), Failure> {
    let own = station.calibration.path.as_deref();
    let calibration = Calibration::of_files(own.into_iter().chain([file]))?;
    if let Some(tip) = calibration.stylus_tip_mm {
        return Ok((tip.value, "the tip of the stylus"));
    }
    let probe = station.calibration.sensor_from_probe.or(calibration.sensor_from_probe.map(|probe| probe.value));
    if let Some(probe) = probe {
        return Ok((probe.position_mm, "the centre of the probe's face"));
    }
    tracing::warn!(
        "neither the station's calibration nor {} knows the tip of a stylus or where the probe is at its sensor (`insonify calibrate pivot` finds both): the sensor itself must touch",
        file.display()
    );
    Ok((DVec3::ZERO, "the sensor"))
}

/// The user's answer for a landmark.
#[derive(Debug, Clone, PartialEq)]
enum Answer {
    Open,
    Skipped,
    Taken(PointPair),
}

/// Landmarks to touch, and the user's answers so far.
struct Session<'a> {
    points: &'a [Named<DVec3>],
    answers: Vec<Answer>,
    /// Indices of the answered landmarks, in the order of their answers.
    order: Vec<usize>,
}

impl<'a> Session<'a> {
    fn new(points: &'a [Named<DVec3>]) -> Self {
        Self { points, answers: vec![Answer::Open; points.len()], order: Vec::new() }
    }

    fn answer(&mut self, index: usize, answer: Answer) {
        self.answers[index] = answer;
        self.order.push(index);
    }

    /// Takes back the last answer.
    fn back(&mut self) {
        if let Some(index) = self.order.pop() {
            self.answers[index] = Answer::Open;
        }
    }

    /// Reopens the landmark with this name or number. The error lists the names of all landmarks.
    fn again(&mut self, which: &str) -> Result<(), String> {
        let by_name = self.points.iter().position(|point| point.name.eq_ignore_ascii_case(which));
        let by_number = which.parse().ok().filter(|number| (1..=self.points.len()).contains(number));
        let Some(index) = by_name.or(by_number.map(|number: usize| number - 1)) else {
            let names = self.points.iter().map(|point| point.name.as_str()).collect::<Vec<_>>().join(", ");
            return Err(format!("`{which}` is none of the landmarks {names}"));
        };
        self.answers[index] = Answer::Open;
        self.order.retain(|answered| *answered != index);
        Ok(())
    }

    fn next(&self) -> Option<usize> {
        self.answers.iter().position(|answer| *answer == Answer::Open)
    }

    /// The touched landmarks, in their original order.
    fn taken(&self) -> Vec<Named<PointPair>> {
        let named = |(point, answer): (&Named<DVec3>, &Answer)| match answer {
            Answer::Taken(value) => Some(Named { name: point.name.clone(), value: *value }),
            _ => None,
        };
        self.points.iter().zip(&self.answers).filter_map(named).collect()
    }
}

/// Asks for each landmark in turn. The user answers with a line of `input`. After the last landmark, Enter or the end
/// of the input finishes.
fn ask(
    points: &[Named<DVec3>],
    tip: &str,
    input: &mut impl BufRead,
    mut take: impl FnMut(&Named<DVec3>) -> Result<Touched, String>,
) -> Result<Vec<Named<PointPair>>, Failure> {
    let mut session = Session::new(points);
    eprintln!(
        "Enter takes a landmark; `skip` leaves it out, `back` takes the last one again, `again NAME` any other, `quit` ends without a result"
    );
    let mut trouble = String::new();
    loop {
        let (next, count) = (session.next(), session.taken().len());
        match next {
            Some(index) => {
                let (number, all, Named { name, value }) = (index + 1, points.len(), &points[index]);
                let [x, y, z] = value.to_array();
                eprintln!(
                    "{number} of {all}: touch {name} with {tip}, hold it still and press Enter (at {x:.2}, {y:.2}, {z:.2} mm in the scene)"
                );
            }
            None => eprintln!("{count} landmarks are taken: Enter finishes; `back` or `again NAME` takes one again"),
        }
        let mut line = String::new();
        if input.read_line(&mut line).context("cannot read the input").other()? == 0 {
            let Some(index) = next else { return Ok(session.taken()) };
            let (name, all) = (&points[index].name, points.len());
            return Err(Failure::Input(anyhow!(
                "the input ended before `{name}` was taken, with {count} of {all} landmarks; nothing was written{trouble}"
            )));
        }
        let line = line.trim();
        let again = line.strip_prefix("again").or(line.strip_prefix("a ")).map(str::trim);
        match (line, next, again) {
            ("", None, _) => return Ok(session.taken()),
            ("", Some(index), _) => match take(&points[index]) {
                Ok(Touched { tracker_mm, rms_mm }) => {
                    let [x, y, z] = tracker_mm.to_array();
                    let name = &points[index].name;
                    eprintln!("   {name} at {x:.2}, {y:.2}, {z:.2} mm, spread {rms_mm:.3} mm RMS");
                    session.answer(index, Answer::Taken(PointPair { scene_mm: points[index].value, tracker_mm }));
                    fit_so_far(&session.taken()).iter().for_each(|line| eprintln!("   {line}"));
                    trouble.clear();
                }
                Err(reason) => {
                    eprintln!("   {reason}");
                    trouble = format!("; {reason}");
                }
            },
            ("s" | "skip", Some(index), _) => session.answer(index, Answer::Skipped),
            ("b" | "back" | "u" | "undo", ..) => session.back(),
            ("q" | "quit", ..) => {
                return Err(Failure::Input(anyhow!("ended with {count} landmarks taken; nothing was written")));
            }
            (_, _, Some(which)) => session.again(which).unwrap_or_else(|reason| eprintln!("   {reason}")),
            _ => eprintln!("   `{line}` is none of Enter, skip, back, again NAME and quit"),
        }
    }
}

#[cfg(test)]
mod tests {
    use super::*;

    fn points() -> Vec<Named<DVec3>> {
        let point = |(i, name): (usize, &str)| Named { name: name.to_owned(), value: DVec3::X * i as f64 };
        ["A", "B", "C"].into_iter().enumerate().map(point).collect()
    }

    /// Names of the landmarks that the dialogue returns, and names of all touched landmarks, in order of the attempts.
    fn asked(input: &str, mut is_still: impl FnMut(usize) -> bool) -> (Result<Vec<String>, String>, Vec<String>) {
        let mut tried = Vec::new();
        let result = ask(&points(), "it", &mut input.as_bytes(), |point| {
            tried.push(point.name.clone());
            let touched = Touched { tracker_mm: DVec3::Y * tried.len() as f64, rms_mm: 0.1 };
            if is_still(tried.len()) { Ok(touched) } else { Err("it moves".to_owned()) }
        });
        let result = match result {
            Ok(pairs) => Ok(pairs.into_iter().map(|pair| pair.name).collect()),
            Err(Failure::Input(error)) => Err(error.to_string()),
            Err(other) => panic!("{other:?}"),
        };
        (result, tried)
    }

    #[test]
    fn landmarks_are_taken_skipped_and_taken_again() {
        assert_eq!(asked("\n\n\n", |_| true).0.unwrap(), ["A", "B", "C"]);
        let (taken, tried) = asked("\nwhat\nskip\nback\n\n\n", |_| true);
        assert_eq!(
            (taken.unwrap(), tried),
            (vec!["A".into(), "B".into(), "C".into()], vec!["A".into(), "B".into(), "C".into()])
        );
        assert_eq!(asked("\nskip\n\n", |_| true).0.unwrap(), ["A", "C"]);
        // After the last landmark, any landmark can be touched again, chosen by name or number.
        for line in ["back", "undo", "again c", "again 3"] {
            let (taken, tried) = asked(&format!("\n\n\n{line}\n\n\n"), |_| true);
            assert_eq!((taken.unwrap().len(), tried.join("")), (3, "ABCC".to_owned()), "{line}");
        }
        let (taken, tried) = asked("\n\nagain A\nagain none\n\n\n", |_| true);
        assert_eq!((taken.unwrap(), tried.join("")), (vec!["A".into(), "B".into(), "C".into()], "ABAC".to_owned()));
        // If the tip moved, the same landmark is asked for again.
        let (taken, tried) = asked("\n\n\n\n", |attempt| attempt != 2);
        assert_eq!((taken.unwrap().len(), tried.join("")), (3, "ABBC".to_owned()));
    }

    #[test]
    fn points_of_one_name_or_position_are_refused() {
        let mut all = points();
        assert_eq!(distinct(&all), Ok(()));
        all[2].name = "a".into();
        assert!(distinct(&all).unwrap_err().contains("`A` is there twice"));
        all[2] = Named { name: "C".into(), value: all[1].value + 0.3 * DVec3::Z };
        assert!(distinct(&all).unwrap_err().starts_with("`B` and `C` lie 0.30 mm apart in the scene"));
    }

    #[test]
    fn an_end_before_the_last_landmark_is_an_error() {
        let error = asked("\n\n", |attempt| attempt == 1).0.unwrap_err();
        assert_eq!(error, "the input ended before `B` was taken, with 1 of 3 landmarks; nothing was written; it moves");
        assert!(asked("\nquit\n", |_| true).0.unwrap_err().starts_with("ended with 1 landmarks taken"));
    }
}
