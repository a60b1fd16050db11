//! Exercises with a needle as they are shipped, done by simulated hands.

use std::fs;
use std::path::Path;

use glam::{DQuat, DVec3};
use insonify::Scene;
use insonify::exam::Skills;
use insonify::exam::hand::Skill;
use insonify::exam::needle::{Exercises, GaussianSlice, NeedleReference, NeedleScore, hand, score};
use insonify::phantom::{self, Parameters};
use insonify::pose::{Calibration, Fitted, Pose};
use insonify::recording::{RecordingReader, read_tools};
use insonify::report::exam::{Heading, NeedleReport, write};
use insonify::station::Station;
use serde_json::Value;

use crate::program::{insonify, refused, succeeded};

/// Surfaces of the phantom that the needle meets, or may meet.
const MET: [&str; 10] = [
    "skin",
    "subcutaneous_fat",
    "rectus_muscles",
    "uterus",
    "membranes",
    "amniotic_cavity",
    "placenta",
    "cord",
    "fetal_skin",
    "maternal_bladder",
];

fn station(name: &str) -> Station {
    Station::load(&Path::new(env!("CARGO_MANIFEST_DIR")).join(format!("configs/{name}.toml"))).unwrap()
}

/// Score of a hand at the station's exercise. Its page is written to `page`.
fn done(station: &Station, scene: &Scene, skill: Skill, seed: u64, page: Option<&Path>) -> NeedleScore {
    let (exercise, start) = (station.exercise.as_ref().unwrap(), station.default_pose.unwrap());
    let samples = hand::samples(exercise, scene, &station.probe, &start, skill, seed).unwrap();
    let profile = GaussianSlice(station.probe);
    let reference = NeedleReference { exercise, scene, probe: &station.probe, profile: &profile };
    let (score, track) = score(&samples, &reference).unwrap();
    if let Some(page) = page {
        let needle = NeedleReport { score: &score, track: &track, reference: &reference };
        write(page, Heading { title: "session", note: "", warnings: &[] }, None, Some(needle)).unwrap();
    }
    score
}

/// Checks that an expert does an exercise well, and a novice less so.
fn check(name: &str, scene: &Scene) {
    let station = station(name);
    let dir = tempfile::tempdir().unwrap();
    let page = dir.path().join("score.html");
    let expert = done(&station, scene, Skill::Expert, 1, Some(&page));
    assert!(
        expert.reached.is_some() && expert.forbidden().count() == 0 && expert.right_entry == Some(true),
        "{expert}"
    );
    assert!(expert.points.unwrap() >= 80.0, "{expert}");
    let html = fs::read_to_string(&page).unwrap();
    for part in [expert.exercise.as_str(), "sideways sweep", "target reached (green)", "<polyline", "Events on the way"]
    {
        assert!(html.contains(part), "{part}: {html}");
    }
    let mean = |skill| (0..4).map(|seed| done(&station, scene, skill, seed, None).points.unwrap()).sum::<f64>() / 4.0;
    let (expert, novice) = (mean(Skill::Expert), mean(Skill::Novice));
    assert!(novice < expert - 10.0, "{name}: {novice} and {expert} points");
}

#[test]
fn an_expert_does_the_shipped_exercises_better_than_a_novice() {
    for name in ["needle_cyst", "needle_vessel"] {
        let station = station(name);
        check(name, &station.load_scene_from(station.scene_file().unwrap()).unwrap());
    }
}

#[test]
fn the_amniocentesis_spares_placenta_and_fetus() {
    let station = station("needle_amniocentesis");
    let parameters = Parameters::default();
    let organs = phantom::organs(&parameters);
    let names: Vec<&str> = organs.iter().map(|organ| organ.name).collect();
    station.exercise.as_ref().unwrap().check(&names).unwrap();
    let mut scene = Scene::new(station.tissues.clone(), "gel").unwrap();
    for part in phantom::parts(&parameters, &MET, 2.0) {
        scene.add(&part.name, &part.tissue, part.priority, part.mesh).unwrap();
    }
    check("needle_amniocentesis", &scene);
}

#[test]
fn a_target_that_the_scene_lacks_is_named_with_the_nearest() {
    let text = "[scene]\npath = 'assets/scenes/needle_cyst.glb'\n[exercise]\ntarget = 'cist'";
    let station = Station::parse(text, Path::new(env!("CARGO_MANIFEST_DIR"))).unwrap();
    let error = station.load_scene_from(station.scene_file().unwrap()).unwrap_err().to_string();
    assert!(error.contains("`exercise.target`") && error.contains("did you mean `cyst`"), "{error}");
}

fn json(arguments: &[&str]) -> Value {
    serde_json::from_str(&succeeded(&insonify(arguments))).unwrap()
}

/// The commands of the documents: a session of the shipped exercise, twice the same, and its score.
#[test]
fn a_recorded_exercise_is_scored_as_its_samples_are() {
    let dir = tempfile::tempdir().unwrap();
    let path = |name: &str| dir.path().join(name).to_str().unwrap().to_owned();
    let cyst = "configs/needle_cyst.toml";
    let made = |name: &str, skill: &str| {
        json(&["exam", cyst, "--skill", skill, "--seed", "3", "--out", &path(name), "--json"])
    };
    let (novice, again) = (made("novice.mcap", "novice"), made("again.mcap", "novice"));
    let bytes = |name: &str| fs::read(dir.path().join(name)).unwrap();
    assert_eq!(bytes("novice.mcap"), bytes("again.mcap"));
    assert_eq!(novice["key_frames"], again["key_frames"]);
    made("expert.mcap", "expert");
    let inspected = json(&["inspect", &path("novice.mcap"), "--json"]);
    assert_eq!((&inspected["sensor"], &inspected["needle"]["sensor"]), (&0.into(), &1.into()), "{inspected}");
    let station = station("needle_cyst");
    let scene = station.load_scene_from(station.scene_file().unwrap()).unwrap();
    for (name, skill) in [("novice.mcap", Skill::Novice), ("expert.mcap", Skill::Expert)] {
        let scored = json(&["score", &path(name), cyst, "--json"]);
        let needle = &scored["needle"];
        let expected = done(&station, &scene, skill, 3, None);
        let points = needle["points"].as_f64().unwrap();
        assert!((points - expected.points.unwrap()).abs() < 0.5, "{name}: {points} and {expected}");
        assert_eq!(needle["events"].as_array().unwrap().len(), expected.events.len());
        assert_eq!(needle["passes"], expected.passes);
    }
    let passes = novice["key_frames"].as_array().unwrap();
    assert!(passes.len() > 1 && passes[1]["name"] == "end of pass 2", "{novice}");
}

#[test]
fn options_of_other_exams_are_refused_at_a_station_with_an_exercise() {
    let dir = tempfile::tempdir().unwrap();
    let out = dir.path().join("a.mcap");
    let out = out.to_str().unwrap();
    let cyst = "configs/needle_cyst.toml";
    for (more, words) in [
        (&["--duration", "9"][..], "--duration is only for sessions that look for planes"),
        (&["--shuffle"], "--shuffle is only for sessions"),
        (&["--planes", "all"], "no standard planes"),
    ] {
        refused(&insonify(&[&["exam", cyst, "--out", out], more].concat()), &[words]);
    }
    let text = fs::read_to_string(Path::new(env!("CARGO_MANIFEST_DIR")).join(cyst)).unwrap();
    let text = text.replace("../assets", concat!(env!("CARGO_MANIFEST_DIR"), "/assets"));
    let station = dir.path().join("station.toml");
    let [before, needle] = text.split("[needle]").collect::<Vec<_>>()[..] else { panic!("{text}") };
    fs::write(&station, before).unwrap();
    refused(&insonify(&["exam", station.to_str().unwrap(), "--out", out]), &["`[needle]` is missing"]);
    let (start, end) = (before.find("[pose]").unwrap(), before.find("[exercise]").unwrap());
    fs::write(&station, format!("{}{}[needle]{needle}", &before[..start], &before[end..])).unwrap();
    refused(&insonify(&["exam", station.to_str().unwrap(), "--out", out]), &["`[pose]` is missing"]);
    assert!(!Path::new(out).exists());
}

/// A station's tracker and sensors are where its calibration says, and not where the scene and the tools are.
#[test]
fn recorded_tools_are_as_the_stations_tracker_measures_them() {
    let pose = |x: f64| Pose {
        position_mm: DVec3::new(x, 2.0 * x, -x),
        orientation: DQuat::from_axis_angle(DVec3::Y, 0.01 * x),
    };
    let calibration = |mount| Calibration {
        scene_from_tracker: Some(Fitted::known(pose(70.0))),
        sensor_from_probe: Some(Fitted::known(mount)),
        ..Calibration::default()
    };
    let station = station("needle_cyst");
    let scene = station.load_scene_from(station.scene_file().unwrap()).unwrap();
    let (exercise, start) = (station.exercise.as_ref().unwrap(), station.default_pose.unwrap());
    let plan = hand::Plan::of(exercise, &scene, &station.probe, &start).unwrap();
    let exercises = Exercises {
        scene: "test".into(),
        plan,
        skills: Skills::One(Skill::Trained),
        probe: calibration(pose(5.0)),
        needle: calibration(pose(-9.0)),
    };
    let dir = tempfile::tempdir().unwrap();
    let path = dir.path().join("a.mcap");
    exercises.write(4, &path).unwrap();
    let tools = read_tools(RecordingReader::open(&path).unwrap()).unwrap();
    let hand::HandSession { samples, phases } = plan.session(Skill::Trained, 4);
    assert_eq!((tools.probe.measured.len(), tools.needle.measured.len()), (samples.len(), samples.len()));
    for ((probe, needle), sample) in tools.probe.measured.iter().zip(&tools.needle.measured).zip(&samples) {
        let probe = exercises.probe.scene_from_probe(probe.pose);
        let tip_mm = exercises.needle.scene_from_probe(needle.pose).position_mm;
        assert!(probe.position_mm.distance(sample.probe.unwrap().position_mm) < 1e-3);
        assert!(tip_mm.distance(sample.needle.unwrap().tip_mm()) < 1e-3, "{tip_mm} at {} s", sample.time_s);
    }
    // The phases are what the needle does: it advances, rests, and goes back.
    let depth_mm = |time_s: f64| {
        let at = samples.partition_point(|sample| sample.time_s < time_s).min(samples.len() - 1);
        samples[at].needle.unwrap().tip_mm().distance(plan.entry_mm)
    };
    for (phase, next) in phases.iter().zip(phases.iter().skip(1)) {
        let way_mm = depth_mm(next.time_s) - depth_mm(phase.time_s);
        let fits = match phase.name {
            "advance" => way_mm > 5.0,
            "withdraw" => way_mm < -5.0,
            _ => way_mm.abs() < 4.0,
        };
        assert!(fits, "{phase:?}: {way_mm} mm");
    }
}
