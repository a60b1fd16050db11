//! Exercises with a needle as they are shipped, done by simulated hands.

use std::fs;
use std::path::Path;

use insonify::Scene;
use insonify::exam::hand::Skill;
use insonify::exam::needle::{GaussianSlice, NeedleReference, NeedleScore, hand, score};
use insonify::phantom::{self, Parameters};
use insonify::report::exam::{Heading, NeedleReport, write};
use insonify::station::Station;

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
    for part in
        [expert.exercise.as_str(), "sideways sweep", "target reached (green)", "<polyline", "Surfaces on the way"]
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
