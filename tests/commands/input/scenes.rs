//! Tests of the committed scenes and station files.

use std::path::{Path, PathBuf};

use insonify::anatomy::import::load_with_findings;
use insonify::anatomy::{TissueTable, analytic};
use insonify::station::{SceneSource, Station};

use super::made_scenes::SCENES;

fn repository() -> PathBuf {
    PathBuf::from(env!("CARGO_MANIFEST_DIR"))
}

fn files(dir: &str, extension: &str) -> Vec<PathBuf> {
    let entries = std::fs::read_dir(repository().join(dir)).unwrap();
    let mut paths: Vec<_> = entries.map(|e| e.unwrap().path()).collect();
    paths.retain(|p| p.extension().is_some_and(|e| e == extension));
    paths.sort();
    paths
}

#[test]
fn every_committed_scene_is_closed_and_outward_and_equals_its_function() {
    let table = TissueTable::builtin().unwrap();
    assert_eq!(files("assets/scenes", "glb").len(), SCENES.len());
    for (name, parts) in SCENES {
        let path = repository().join(format!("assets/scenes/{name}.glb"));
        let (scene, findings) = load_with_findings(&path, &table, table.index_of("gel").unwrap()).unwrap();
        assert_eq!(findings, [], "{name}");
        let made = analytic::scene(parts(), &table, "gel").unwrap();
        assert_eq!(scene.surfaces.len(), made.surfaces.len());
        for (read, made) in scene.surfaces.iter().zip(&made.surfaces) {
            assert_eq!((&read.name, read.tissue, read.priority), (&made.name, made.tissue, made.priority));
            assert_eq!(read.mesh.triangles.len(), made.mesh.triangles.len());
            assert!(read.mesh.signed_volume_mm3() > 0.0 && read.mesh.unpaired_edges() == 0, "{name}");
            for (read, made) in read.mesh.corners_mm().zip(made.mesh.corners_mm()) {
                assert!((0..3).all(|i| (read[i] - made[i]).length() < 1e-4), "{name}: {read:?} {made:?}");
            }
        }
    }
}

#[test]
fn every_scene_has_sound_surfaces_and_known_tissues() {
    let table = TissueTable::builtin().unwrap();
    for (name, parts) in SCENES {
        for part in parts() {
            assert_eq!(part.mesh.unpaired_edges(), 0, "{name}: {}", part.name);
            assert!(part.mesh.signed_volume_mm3() > 0.0, "{name}: {}", part.name);
        }
        assert!(analytic::scene(parts(), &table, "gel").is_some(), "{name}");
    }
}

#[test]
fn every_station_file_of_configs_is_valid() {
    let paths = files("configs", "toml");
    assert!(paths.len() >= 5);
    for path in paths {
        let station = Station::load(&path).unwrap();
        assert!(station.default_pose.is_some(), "{}", path.display());
        assert_eq!(station.path, path);
        match &station.scene {
            SceneSource::File(file) => {
                let scene = station.load_scene_from(file).unwrap();
                assert_eq!(scene.tissues.names()[scene.background], station.background);
            }
            SceneSource::ObstetricPhantom(options) => assert_eq!(options.scale, 1.0),
        }
    }
}

#[test]
fn the_obstetric_station_has_the_papers_parameters() {
    let station = Station::load(&repository().join("configs/obstetric.toml")).unwrap();
    let minimal = Station::parse("[scene]\nphantom = \"obstetric\"", Path::new("")).unwrap();
    // Gain, sliders and dynamic range are set for appearance; the rest is the paper's.
    let size = |s: &Station| (s.settings.image.width, s.settings.image.height, s.settings.quality);
    assert_eq!((station.probe, size(&station)), (minimal.probe, size(&minimal)));
    let into_body = station.default_pose.unwrap().transform_vector(glam::DVec3::Z);
    assert!((into_body - glam::DVec3::NEG_Z).length() < 1e-12);
}
