//! Exercises with a needle as they are shipped, done by simulated hands.

use std::fs;
use std::path::Path;

use insonify::Scene;
use insonify::exam::hand::Skill;
use insonify::exam::needle::{GaussianSlice, NeedleReference, NeedleScore, hand, score};
use insonify::phantom::{self, Parameters};
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
        (&["--duration", "9"][..], "--duration has no effect on an exercise"),
        (&["--shuffle"], "--shuffle has no effect on an exercise"),
        (&["--planes", "all"], "planes"),
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
