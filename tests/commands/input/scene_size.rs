//! Scenes in a wrong unit are refused, or warned about, wherever a station's scene is loaded.

use std::path::Path;

use glam::Vec3;
use insonify::anatomy::analytic::{cuboid, joined, sphere};
use insonify::anatomy::doctor::wrong_size;
use insonify::anatomy::export::{LabelledSurface, SceneExtras, write_scene_glb};
use insonify::anatomy::import::{FindingKind, load_with_findings};
use insonify::anatomy::{Mesh, TissueTable};
use insonify::station::Station;

use crate::program::{insonify, refused, stderr, succeeded};

/// Writes a scene of one surface and its station; returns the station's path.
fn written(folder: &Path, mesh: Mesh) -> String {
    let surface = LabelledSurface { name: "organ".to_owned(), tissue: "liver".to_owned(), priority: 0, mesh };
    write_scene_glb(&[surface], &SceneExtras::default(), &folder.join("s.glb")).unwrap();
    let station = folder.join("s.toml");
    let text = "[scene]\npath = 's.glb'\n[image]\nwidth = 64\nheight = 64\n[pose]\nposition_mm = [0, 0, 0]\nquaternion = [1, 0, 0, 0]\n";
    std::fs::write(&station, text).unwrap();
    station.display().to_string()
}

#[test]
fn every_command_refuses_a_scene_that_is_52_m_across() {
    let folder = tempfile::tempdir().unwrap();
    // A ball of 30 mm whose mm were taken for metres.
    let station = written(folder.path(), sphere(Vec3::ZERO, 15_000.0, 3));
    let out = folder.path().join("out").display().to_string();
    let at = |name: &str| folder.path().join(name).display().to_string();
    let (metrics, picture) = (at("m.jsonl"), at("v.png"));
    for arguments in [
        &["render", &station, "--out", &out, "--backend", "host"][..],
        &["run", &station, "--frames", "1", "--sink", "null", "--metrics", &metrics, "--backend", "host"],
        &["plan", &station, "--no-measure"],
        &["view", &station, "--out", &picture],
    ] {
        refused(
            &insonify(arguments),
            &["52.0 m across", "1000 times too large", "150 mm deep shows nothing", "Unit Scale"],
        );
    }
    let error = Station::load(station.as_ref()).unwrap().load_scene(&|_| ()).unwrap_err().to_string();
    assert!(error.contains("52.0 m across"), "{error}");
}

#[test]
fn a_large_scene_with_thin_surfaces_and_a_tiny_one_are_rendered_with_a_warning() {
    let folder = tempfile::tempdir().unwrap();
    let slab = cuboid(Vec3::new(-4000.0, -4000.0, 30.0), Vec3::new(4000.0, 4000.0, 50.0));
    for (mesh, says) in [(slab, "11.3 m across"), (sphere(Vec3::new(0.0, 0.0, 30.0), 1.0, 2), "mm across")] {
        let station = written(folder.path(), mesh);
        let out = folder.path().join("out").display().to_string();
        let output = insonify(&["render", &station, "--out", &out, "--quality", "lq", "--backend", "host"]);
        succeeded(&output);
        let said = stderr(&output);
        assert!(said.starts_with("warning: the scene is") && said.contains(says), "{said}");
        assert!(said.contains("scale the objects"), "{said}");
    }
    let station = written(folder.path(), sphere(Vec3::new(0.0, 0.0, 60.0), 30.0, 3));
    let scene = Station::load(station.as_ref()).unwrap().load_scene(&|_| ()).unwrap();
    assert_eq!(wrong_size(&scene), None);
}

#[test]
fn parts_that_face_inward_are_told_while_loading_and_cavities_are_not() {
    let folder = tempfile::tempdir().unwrap();
    let mut inward = sphere(Vec3::new(100.0, 0.0, 0.0), 20.0, 3);
    inward.flip();
    let mut cavity = sphere(Vec3::ZERO, 10.0, 3);
    cavity.flip();
    let kinds = |mesh: Mesh| -> Vec<FindingKind> {
        written(folder.path(), mesh);
        let tissues = TissueTable::builtin().unwrap();
        let (_, findings) = load_with_findings(&folder.path().join("s.glb"), &tissues, 0).unwrap();
        findings.into_iter().map(|finding| finding.kind).collect()
    };
    let ball = || sphere(Vec3::ZERO, 30.0, 3);
    assert_eq!(kinds(joined([ball(), inward])), [FindingKind::Inward { parts: 1, of: 2 }]);
    assert_eq!(kinds(joined([ball(), cavity])), []);
}
