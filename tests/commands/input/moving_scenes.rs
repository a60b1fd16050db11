//! Tests of motion in scene files: `extras.motion` of the glTF scene.

use std::path::Path;

use glam::Vec3;
use insonify::anatomy::export::{LabelledSurface, write_moving_glb};
use insonify::anatomy::motion::{Drift, Field, Motion, Rhythm, Shape};
use insonify::anatomy::{Scene, SceneError, TissueTable, analytic, import};

/// Writes a ball with this motion, and reads it back.
fn written_and_read(motion: &Motion) -> Result<Scene, SceneError> {
    let directory = tempfile::tempdir().unwrap();
    let path = directory.path().join("moving.glb");
    let mesh = analytic::sphere(Vec3::new(0.0, 0.0, 50.0), 20.0, 3);
    let ball = LabelledSurface { name: "heart_wall".into(), tissue: "muscle".into(), priority: 1, mesh };
    write_moving_glb(&[ball], motion, &path).unwrap();
    read(&path)
}

fn read(path: &Path) -> Result<Scene, SceneError> {
    let tissues = TissueTable::builtin().unwrap();
    let background = tissues.index_of("gel").unwrap();
    import::load(path, &tissues, background)
}

fn heart() -> Field {
    Field {
        name: "heart".into(),
        surfaces: vec!["heart*".into()],
        shape: Shape::Beat {
            centre_mm: Vec3::new(0.0, 0.0, 50.0),
            axis: Vec3::X,
            radius_mm: 9.0,
            squeeze: 0.3,
            shorten: 0.2,
        },
        rhythm: Rhythm::Heart { beats_per_min: 140.0 },
    }
}

#[test]
fn motion_is_unchanged_by_writing_and_reading() {
    let rhythm = Rhythm::Breath { breaths_per_min: 14.0, bout_s: 1.0, pause_s: 0.0, seed: 3 };
    let drift = Some(Drift { way_mm: Vec3::new(0.0, -2.0, 0.0), rhythm });
    let motion = Motion { fields: vec![heart()], drift };
    assert_eq!(written_and_read(&motion).unwrap().motion, motion);
    assert!(written_and_read(&Motion::default()).unwrap().motion.is_empty());
}

#[test]
fn invalid_motion_is_refused_by_name() {
    let fast = Field { rhythm: Rhythm::Heart { beats_per_min: 1000.0 }, ..heart() };
    let nowhere = Field { surfaces: vec!["liver".into()], ..heart() };
    for (fields, words) in [
        (vec![fast], "`beats_per_min` of motion `heart` is 1000; it must be 20 to 300"),
        (vec![nowhere], "motion `heart` names no surface of the scene"),
        (vec![heart(); 8], "8 motion fields; at most 7"),
    ] {
        let error = written_and_read(&Motion { fields, drift: None }).unwrap_err();
        assert!(matches!(error, SceneError::BadMotion { .. }), "{error}");
        assert!(error.to_string().contains(words) && error.to_string().contains("moving.glb"), "{error}");
    }
    assert_eq!(written_and_read(&Motion { fields: vec![heart(); 7], drift: None }).unwrap().motion.fields.len(), 7);
}
