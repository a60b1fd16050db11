//! Messages of a score besides its marks: on a plane not found, sparse poses, another scene, damage, and wrong files.

use super::documented::{STATION, insonify, printed, scene};
use super::*;

#[test]
fn a_plane_that_is_not_found_names_the_failed_condition() {
    let why = |poses: &[TimedPose]| scored(poses, &[], &["head"]).planes.remove(0).why_not.unwrap_or_default();
    assert_eq!(why(&still(perfect("head"), 1.5)), "");
    let slid = |by_mm: DVec3| Pose { position_mm: perfect("head").transform_point(by_mm), ..perfect("head") };
    for (pose, reason) in [
        (slid(DVec3::X * 27.05), "27.1 mm off the picture's middle line (at most 25)"),
        (turned("head", DVec3::X, 20.05), "tilted off the plane by 20.1° (at most "),
        (slid(DVec3::Z * -6.0), "off the skin in "),
        (slid(DVec3::Z * -200.0), "not in the picture of 150 mm depth: the plane's centre"),
    ] {
        let why = why(&still(pose, 1.5));
        assert!(why.starts_with("in the best second ") && why.contains(reason), "{reason}: {why}");
    }
    let mut short = still(perfect("head"), 0.65);
    let tilted = still(turned("head", DVec3::X, 20.0), 0.9);
    short.extend(tilted.iter().map(|p| TimedPose { host_time_ns: p.host_time_ns + 670_000_000, ..*p }));
    let why = why(&short);
    assert!(why.starts_with("held for 0.6 s (at least 1); in the best second tilted off the plane by "), "{why}");
}

#[test]
fn a_session_of_sparse_poses_is_not_judged() {
    let sparse: Vec<TimedPose> = still(perfect("head"), 12.0).into_iter().step_by(60).collect();
    let score = scored(&sparse, &[], &["head"]);
    assert_eq!((score.points, score.found), (None, 0));
    let text = score.to_string();
    assert!(text.starts_with("not judged: only 13 poses in 12.0 s (gaps of up to 1.00 s)"), "{text}");
    assert!(!text.contains("of 100 points") && !text.contains(" no "), "{text}");
    assert_eq!(score.planes[0].why_not.as_deref(), Some("not judged: every second has a gap"));
}

#[test]
fn the_page_warns_of_another_scene_and_of_damage() {
    let dir = tempfile::tempdir().unwrap();
    scene(dir.path());
    let at = |name: &str| dir.path().join(name);
    let station = STATION.replace("[calibration]\npath = \"calibration.toml\"\n", "");
    std::fs::write(at("station.toml"), &station).unwrap();
    let shallow = station.replace("scanlines = 32", "scanlines = 32\ndepth_mm = 60");
    std::fs::write(at("shallow.toml"), shallow).unwrap();
    printed(&insonify(dir.path(), "insonify exam station.toml --planes head --seed 3 --out exam.mcap"));
    let score = |line: &str| {
        let output = insonify(dir.path(), &format!("insonify score {line} --json --out page.html"));
        let json: serde_json::Value = serde_json::from_str(&printed(&output)).unwrap();
        (json, String::from_utf8_lossy(&output.stderr).into_owned(), std::fs::read_to_string(at("page.html")).unwrap())
    };
    let (json, said, page) = score("exam.mcap station.toml");
    assert!(json["other_scene"].is_null() && !said.contains("recorded on") && !page.contains("Warning:"), "{said}");
    assert!(page.contains("docs/commands.md (Points)") && page.contains("Tolerances are assumed"), "{page}");
    let (json, said, page) = score("exam.mcap shallow.toml");
    let other = "the session was recorded on depth_mm 150, the station has depth_mm 60";
    assert_eq!(json["other_scene"], other);
    assert!(said.contains(&format!("warning: exam.mcap: {other}")), "{said}");
    assert!(page.contains(&format!("<p class=\"note\">Warning: {other}.</p>")), "{page}");

    let whole = std::fs::read(at("exam.mcap")).unwrap();
    std::fs::write(at("cut.mcap"), &whole[..whole.len() * 2 / 3]).unwrap();
    let (_, _, page) = score("cut.mcap station.toml");
    assert!(page.contains("<p class=\"note\">Warning: the recording is not complete"), "{page}");
    assert!(page.contains("what was read ends after "), "{page}");
}

#[test]
fn swapped_and_foreign_files_get_a_hint() {
    let dir = tempfile::tempdir().unwrap();
    for (line, hint) in [
        ("score station.toml exam.mcap", "give the recording first"),
        ("replay station.toml exam.mcap", "give the recording first"),
        ("score good.csv station.toml", "`insonify import good.csv --out FILE.mcap`"),
    ] {
        let output = insonify(dir.path(), &format!("insonify {line}"));
        let said = String::from_utf8_lossy(&output.stderr).into_owned();
        assert!(output.status.code() == Some(2) && said.contains(hint), "{line}: {said}");
    }
}
