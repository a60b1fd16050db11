//! The educator's sequence of commands, typed as the documents state it.

use std::path::Path;
use std::process::{Command, Output};

use insonify::anatomy::analytic::cuboid;
use insonify::anatomy::export::{LabelledSurface, write_glb};
use insonify::sink::write_json;
use serde_json::{Value, json};

pub(super) const STATION: &str = r#"
[scene]
path = "scene.glb"

[probe]
scanlines = 32
samples = 256

[image]
width = 64
height = 48

[calibration]
path = "calibration.toml"
"#;

/// Calibration with a tracker away from the scene's origin and axes, and a sensor at the probe's handle.
const CALIBRATION: &str = r#"
version = 1

[scene_from_tracker]
position_mm = [120.0, -40.0, 300.0]
quaternion = [0.5, 0.5, 0.5, 0.5]

[sensor_from_probe]
position_mm = [3.0, -8.0, 140.0]
quaternion = [0.0, 1.0, 0.0, 0.0]
"#;

/// Writes a block of liver with planes called like the phantom's, whose meshing would take minutes.
pub(super) fn scene(dir: &Path) {
    let mesh = cuboid(glam::Vec3::new(-44.0, -80.0, 10.0), glam::Vec3::new(44.0, 80.0, 90.0));
    let surface = LabelledSurface { name: "block".into(), tissue: "liver".into(), priority: 1, mesh };
    write_glb(&[surface], &dir.join("scene.glb")).unwrap();
    let plane = |name: &str, y: f64, measure: &str| {
        json!({
            "name": name, "title": name,
            "tolerances": { "angle_deg": 10, "distance_mm": 5, "centring_mm": 20, "depth_mm": [20, 60] },
            "views": [{
                "centre_mm": [0, y, 50], "normal": [0, 1, 0], "lateral": [1, 0, 0], "to_probe": [0, 0, -1],
                "calipers": [{
                    "name": measure, "title": "width", "kind": "line", "points_mm": [[-44, y, 50], [44, y, 50]],
                    "surface": "block", "reach_mm": 5
                }]
            }]
        })
    };
    let planes = [
        plane("head", -40.0, "BPD"),
        plane("abdomen", 0.0, "AD"),
        plane("femur", 40.0, "FL"),
        plane("spine", 60.0, "SL"),
    ];
    write_json(&dir.join("scene.planes.json"), &json!({ "version": 1, "planes": planes })).unwrap();
}

pub(super) fn insonify(dir: &Path, line: &str) -> Output {
    let words: Vec<&str> = line.split_whitespace().take_while(|word| !word.starts_with('#')).skip(1).collect();
    let mut program = Command::new(env!("CARGO_BIN_EXE_insonify"));
    program.args(&words).current_dir(dir).output().unwrap()
}

pub(super) fn printed(output: &Output) -> String {
    assert!(output.status.success(), "{}", String::from_utf8_lossy(&output.stderr));
    String::from_utf8_lossy(&output.stdout).into_owned()
}

/// Lines that begin with `start` in the code blocks of a document.
fn lines(document: &str, start: &str) -> Vec<String> {
    let text = std::fs::read_to_string(Path::new(env!("CARGO_MANIFEST_DIR")).join(document)).unwrap();
    text.lines().filter(|line| line.starts_with(start)).map(str::to_owned).collect()
}

#[test]
fn the_documented_sequence_gives_the_expert_full_points() {
    let dir = tempfile::tempdir().unwrap();
    scene(dir.path());
    std::fs::write(dir.path().join("station.toml"), STATION).unwrap();
    std::fs::write(dir.path().join("calibration.toml"), CALIBRATION).unwrap();
    let exam = lines("docs/station.md", "insonify exam station.toml");
    let score = lines("docs/station.md", "insonify score exam.mcap");
    assert_eq!((exam.len(), score.len()), (1, 1), "{exam:?} {score:?}");
    printed(&insonify(dir.path(), &exam[0]));
    let text = printed(&insonify(dir.path(), &score[0]));
    assert!(text.starts_with("3 of 3 planes found, 100 of 100 points"), "{text}");
    assert!(text.contains("Scored: the planes of the recording's exam (head, abdomen, femur)"), "{text}");
    let page = std::fs::read_to_string(dir.path().join("out/exam.html")).unwrap();
    assert!(page.contains("<b>100</b> of 100 points") && page.contains("the planes of the recording"), "{page}");

    // What counts can be said otherwise.
    let json = |more: &str| {
        let line = format!("insonify score exam.mcap station.toml --json {more}");
        serde_json::from_str::<Value>(&printed(&insonify(dir.path(), &line))).unwrap()
    };
    let all = json("--planes all");
    assert_eq!((all["planes"].as_array().unwrap().len(), &all["planes_from"]), (4, &"option".into()));
    assert!((all["points"].as_f64().unwrap() - 75.0).abs() < 1.0, "{all}");
    let own = json("");
    let names: Vec<_> = own["planes"].as_array().unwrap().iter().map(|plane| plane["name"].clone()).collect();
    assert_eq!(
        (names, &own["planes_from"]),
        (vec!["head".into(), "abdomen".into(), "femur".into()], &"recording".into())
    );
    let measured: Vec<_> = own["calipers"].as_array().unwrap().iter().map(|c| c["plane"].clone()).collect();
    assert_eq!(measured, ["head", "abdomen", "femur"], "the picture of each measurement");
}
