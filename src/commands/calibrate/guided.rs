//! Guided calibration of a probe. Its steps are recorded one after another with a live tracker.

use std::io::BufRead;
use std::path::{Path, PathBuf};

use anyhow::{Context, anyhow};
use insonify::pose::Pose;
use insonify::pose::pivot::{Pivot, calibrate, explained};
use insonify::pose::probe_mount::{MountError, MountSteps, ProbeMount, check_ends, mount};
use insonify::station::Station;
use insonify::transducer::{Probe, ProbeKind};

use super::super::{Classify, Failure};
use super::{calibration_file, live};

/// Instruction of each step, and duration of its recording, s.
const STEPS: [(&str, u64); 4] = [
    ("rest the middle of the probe's face in the dimple, press Enter, and tilt the probe slowly to all sides", 15),
    ("rest the end of the face at the marker in the same dimple, press Enter, and tilt the probe a little", 5),
    ("rest the other end of the face in the same dimple, press Enter, and tilt the probe a little", 5),
    (
        "hold the probe upright with its face in the dimple, press Enter, and turn it about its own long axis, a quarter turn each way; `skip` takes the beam from the arc of a convex face",
        10,
    ),
];

/// Largest differences of the measured face from the station's that give no warning: relative difference of the width,
/// and difference of the arc's height, mm.
const FACE: (f64, f64) = (0.15, 3.0);

/// Check of the first step: tilting the probe about the centre of its face.
type Check<'a> = &'a dyn Fn(&Pivot) -> Result<(), String>;

/// Records the steps with the given sensor or tool, else with the station's. Returns the mounting of the sensor on the
/// probe, and the calibration file to write: `out`, else the station's.
pub(super) fn run(
    path: &Path,
    (sensor, tool): (Option<u16>, Option<&str>),
    out: Option<&Path>,
    check: Check<'_>,
) -> Result<(ProbeMount, PathBuf), Failure> {
    let station = Station::load(path)?;
    let settings = live::settings(&station, sensor, tool)?;
    let out = calibration_file(&station, out, std::iter::empty())?;
    let found = live::recorded(&settings, |record| ask(&mut std::io::stdin().lock(), check, record))??;
    let face = found.width_mm.zip(found.arc_mm);
    if let Some(said) = face.and_then(|face| other_face(face, &station.probe)) {
        tracing::warn!("{said}");
    }
    Ok((found, out))
}

/// Warning if the measured width and arc height of the face, mm, differ from those of the station's probe.
fn other_face((width_mm, arc_mm): (f64, f64), probe: &Probe) -> Option<String> {
    if matches!(probe.kind, ProbeKind::Phased { .. }) {
        return None;
    }
    let on_face = |fraction: f64| probe.ray(probe.lateral_coordinate(fraction)).0;
    let [first, middle, last] = [0.0, 0.5, 1.0].map(on_face);
    let (its_width_mm, its_arc_mm) = (first.distance(last), middle.distance(0.5 * (first + last)));
    let differs = (width_mm - its_width_mm).abs() > FACE.0 * its_width_mm || (arc_mm - its_arc_mm).abs() > FACE.1;
    differs.then(|| {
        format!(
            "the measured face is {width_mm:.1} mm wide and its arc {arc_mm:.1} mm high; the station's probe has a face of {its_width_mm:.1} mm and an arc of {its_arc_mm:.1} mm: check [probe] of the station, or which ends were touched"
        )
    })
}

/// Asks for each step in turn. The user answers with a line of `input`; `record` records poses for a number of seconds.
fn ask(
    input: &mut impl BufRead,
    check: Check<'_>,
    mut record: impl FnMut(u64) -> Result<Vec<Pose>, String>,
) -> Result<ProbeMount, Failure> {
    eprintln!("Enter takes a step, `back` takes the one before again, `quit` ends without a result");
    // Poses of each step so far; `None` for a skipped step.
    let mut taken: Vec<Option<Vec<Pose>>> = Vec::new();
    let mut trouble = String::new();
    loop {
        let step = taken.len();
        let Some((what, seconds)) = STEPS.get(step) else {
            match finished(&taken) {
                Ok(found) => return Ok(found),
                Err(reason) => {
                    eprintln!("   {reason}; once more, or `back` for the step before");
                    trouble = format!("; {reason}");
                    taken.pop();
                }
            }
            continue;
        };
        eprintln!("{} of {}: {what} ({seconds} s)", step + 1, STEPS.len());
        let mut line = String::new();
        if input.read_line(&mut line).context("cannot read the input").other()? == 0 {
            let step = step + 1;
            return Err(Failure::Input(anyhow!("the input ended before step {step}; nothing was written{trouble}")));
        }
        match line.trim() {
            "" => match record(*seconds).and_then(|poses| accepted(&taken, poses, check)) {
                Ok(poses) => {
                    eprintln!("   {} poses", poses.len());
                    taken.push(Some(poses));
                    trouble.clear();
                }
                Err(reason) => {
                    let back = if step > 0 { ", or `back` for the step before" } else { "" };
                    eprintln!("   {reason}; once more{back}");
                    trouble = format!("; {reason}");
                }
            },
            "s" | "skip" if step + 1 == STEPS.len() => taken.push(None),
            "b" | "back" | "u" | "undo" => drop(taken.pop()),
            "q" | "quit" => return Err(Failure::Input(anyhow!("ended at step {}; nothing was written", step + 1))),
            other => eprintln!("   `{other}` is none of Enter, back and quit; only the last step can be skipped"),
        }
    }
}

/// Checks the poses of the next step against the steps in `taken`, so that a bad step is recorded again at once.
fn accepted(taken: &[Option<Vec<Pose>>], poses: Vec<Pose>, check: Check<'_>) -> Result<Vec<Pose>, String> {
    let before = |step: usize| taken.get(step).and_then(Option::as_deref);
    let tilted = before(0).unwrap_or(&poses);
    let pivot = calibrate(tilted).map_err(|error| explained(error, tilted))?;
    let ends = match (taken.len(), before(1)) {
        (0, _) => {
            check(&pivot).map_err(|reason| explained(reason, tilted))?;
            Ok(())
        }
        (1, _) => check_ends(&pivot, &poses, None),
        (2, Some(marker)) => check_ends(&pivot, marker, Some(&poses)),
        _ => Ok(()),
    };
    ends.map(|()| poses).map_err(|error: MountError| error.to_string())
}

/// Mounting of the sensor on the probe, computed from all steps together.
fn finished(taken: &[Option<Vec<Pose>>]) -> Result<ProbeMount, String> {
    let of = |step: usize| taken.get(step).and_then(Option::as_deref);
    let steps = MountSteps {
        pivot: of(0).unwrap_or_default(),
        ends: of(1).zip(of(2)).map(<[_; 2]>::from),
        slide: None,
        spin: of(3),
    };
    mount(&steps).map_err(|error| error.to_string())
}

#[cfg(test)]
mod tests {
    use std::f64::consts::{FRAC_PI_2, PI, TAU};

    use glam::{DQuat, DVec3};

    use super::*;

    /// Sensor poses of a step, for a convex probe. Its sensor is 90 mm from the face, away from the body, and turned by
    /// 90° about the beam axis.
    fn poses(rests: DVec3, tilt: f64, spin: f64) -> Vec<Pose> {
        let sensor_from_probe = Pose { position_mm: DVec3::Z * 90.0, orientation: DQuat::from_rotation_z(FRAC_PI_2) };
        let pose = |i: u32| {
            let part = f64::from(i) / 200.0;
            let axis = DVec3::new((5.0 * TAU * part).cos(), (5.0 * TAU * part).sin(), 0.0);
            let lean = DQuat::from_axis_angle(axis, tilt * (0.3 + 0.7 * part)) * DQuat::from_rotation_x(PI);
            let orientation = lean * DQuat::from_rotation_z(spin * (TAU * part).sin());
            Pose { position_mm: -(orientation * rests), orientation } * sensor_from_probe.inverse()
        };
        (0..200).map(pose).collect()
    }

    /// Result of `ask` for the answers `input` and the recordings `script`. A pivot with an RMS of up to 5 mm is
    /// accepted.
    fn asked(input: &str, mut script: Vec<Result<Vec<Pose>, String>>) -> Result<ProbeMount, String> {
        script.reverse();
        let record = |_| script.pop().unwrap_or_else(|| Err("nothing".to_owned()));
        let check = |pivot: &Pivot| if pivot.rms_mm > 5.0 { Err("it slipped".to_owned()) } else { Ok(()) };
        ask(&mut input.as_bytes(), &check, record).map_err(|failure| match failure {
            Failure::Input(error) => error.to_string(),
            other => panic!("{other:?}"),
        })
    }

    #[test]
    fn steps_are_taken_in_turn_again_and_skipped() {
        let [pivot, spin] = [poses(DVec3::ZERO, 0.6, 0.3), poses(DVec3::ZERO, 0.0, 1.5)];
        let [marker, other] = [-28.0, 28.0].map(|x| poses(DVec3::new(x, 0.0, -8.0), 0.1, 0.0));
        let all = || [pivot.clone(), marker.clone(), other.clone(), spin.clone()].map(Ok).to_vec();
        let turn =
            |found: &ProbeMount| found.sensor_from_probe.orientation.angle_between(DQuat::from_rotation_z(FRAC_PI_2));
        let found = asked("\n\n\n\n", all()).unwrap();
        assert!(turn(&found) < 1e-6 && (found.position_mm.z - 90.0).abs() < 1e-6, "{found:?}");
        assert!(turn(&asked("\n\n\nskip\n", all()).unwrap()) < 1e-6);
        // A pivot without tilting has to be repeated, and a step can be taken back.
        let mut script = all();
        script.insert(0, Ok(spin.clone()));
        script.insert(2, Ok(other.clone()));
        assert!(turn(&asked("\n\n\nback\n\n\n\n", script).unwrap()) < 1e-6);
        let error = asked("\n\nskip\n", all()).unwrap_err();
        assert_eq!(error, "the input ended before step 3; nothing was written");
        let error = asked("\n\n\n", [pivot.clone(), marker.clone(), marker.clone()].map(Ok).to_vec()).unwrap_err();
        assert!(error.contains("step 3; nothing was written; the ends of the face lie 0.0 mm apart"), "{error}");
        assert!(asked("\nq\n", all()).unwrap_err().starts_with("ended at step 2"));
    }

    #[test]
    fn a_face_that_is_not_the_stations_is_named() {
        let linear = Probe { kind: ProbeKind::Linear { width_mm: 30.0 }, ..Probe::default() };
        assert_eq!(other_face((31.0, 0.4), &linear), None);
        let said = other_face((45.9, 7.2), &linear).unwrap();
        assert!(said.contains("45.9 mm wide") && said.contains("a face of 30.0 mm and an arc of 0.0 mm"), "{said}");
        let convex = Probe { kind: ProbeKind::Convex { radius_mm: 50.0, fov_deg: 60.0 }, ..Probe::default() };
        assert_eq!(other_face((50.0, 6.7), &convex), None);
        assert!(other_face((50.0, 1.0), &convex).is_some());
        let phased = Probe { kind: ProbeKind::Phased { fov_deg: 90.0 }, ..Probe::default() };
        assert_eq!(other_face((20.0, 0.0), &phased), None);
    }

    #[test]
    fn a_step_that_slipped_is_asked_for_at_once() {
        let slipped = |poses: &[Pose]| -> Vec<Pose> {
            let shift_mm = |i: usize| DVec3::X * if i.is_multiple_of(2) { 8.0 } else { -8.0 };
            let moved = |(i, pose): (usize, &Pose)| Pose { position_mm: pose.position_mm + shift_mm(i), ..*pose };
            poses.iter().enumerate().map(moved).collect()
        };
        let pivot = poses(DVec3::ZERO, 0.6, 0.3);
        let [marker, other] = [-28.0, 28.0].map(|x| poses(DVec3::new(x, 0.0, -8.0), 0.1, 0.0));
        let script = [
            (slipped(&pivot), "before step 1; nothing was written; it slipped"),
            (pivot, ""),
            (slipped(&marker), "before step 2; nothing was written; the end of the face at the marker: "),
            (marker, ""),
            (slipped(&other), "before step 3; nothing was written; the other end of the face: "),
            (other, ""),
        ];
        let all = || script.iter().map(|(poses, _)| Ok(poses.clone())).collect::<Vec<_>>();
        for (at, (_, expected)) in script.iter().enumerate() {
            let error = asked(&"\n".repeat(at + 1), all()).unwrap_err();
            assert!(error.contains(*expected), "{at}: {error}");
        }
        assert!(asked("\n\n\n\n\n\nskip\n", all()).is_ok());
    }
}
