//! File format of a scene's standard planes.

use std::path::{Path, PathBuf};

use glam::DVec3;
use thiserror::Error;

use super::{PLANES_VERSION, StandardPlane, StandardPlanes, View};
use crate::files::{self, FileError, FileKind};
use crate::pose::POSITION_LIMIT_MM;

/// Largest accepted deviation of a direction's length from 1, and of the cosine of the angle between two directions
/// from 0.
const DIRECTION_TOLERANCE: f64 = 1e-2;

/// Errors in a scene's standard planes.
#[derive(Debug, Error)]
pub enum PlanesError {
    /// No planes file.
    #[error(
        "the scene {scene} has no standard planes: {path} is not there; `insonify planes --help` says how to write one"
    )]
    None {
        /// Scene file.
        scene: PathBuf,
        /// Expected planes file.
        path: PathBuf,
    },
    /// The file could not be read.
    #[error(transparent)]
    File(#[from] FileError),
    /// Not JSON, an unknown key, or a value of another type.
    #[error("standard planes {path}: {reason}")]
    Syntax {
        /// Path of the file.
        path: PathBuf,
        /// The parser's message with line and column.
        reason: String,
    },
    /// A value outside its range.
    #[error("standard planes {path}: {wrong}")]
    Value {
        /// Path of the file.
        path: PathBuf,
        /// Value and correct form.
        wrong: WrongValue,
    },
    /// A caliper or outline names a surface that the scene lacks.
    #[error("{path}: plane `{plane}` names the surface `{name}`, which the scene does not have{suggestion}")]
    Surface {
        /// File of the planes.
        path: PathBuf,
        /// Name of the plane.
        plane: String,
        /// Name of the surface.
        name: String,
        /// Nearest surface, as text to append, or empty.
        suggestion: String,
    },
    /// An unknown plane.
    #[error("the scene has no standard plane `{name}`{suggestion}; it has {known}")]
    Unknown {
        /// Name requested.
        name: String,
        /// Nearest known name, as text to append, or empty.
        suggestion: String,
        /// All names.
        known: String,
    },
}

/// Path of the planes of the scene file `scene`: the same name with `.planes.json` instead of its extension.
pub fn planes_path(scene: &Path) -> PathBuf {
    scene.with_extension("planes.json")
}

/// Reads the planes of the scene file `scene` from the planes file next to it.
///
/// # Errors
/// The file doesn't exist, cannot be read, or has an invalid value, which the error names.
pub fn read_planes(scene: &Path) -> Result<StandardPlanes, PlanesError> {
    let path = planes_path(scene);
    match files::read_text(&path, FileKind::Planes) {
        Ok(text) => StandardPlanes::from_json(&text, &path),
        Err(source) if source.kind() == std::io::ErrorKind::NotFound => {
            Err(PlanesError::None { scene: scene.to_owned(), path })
        }
        Err(source) => Err(FileError { path, doing: "read the standard planes", source }.into()),
    }
}

impl StandardPlanes {
    /// Parses the text of a planes file. Errors give the file's path as `path`.
    ///
    /// Directions are made exactly orthonormal.
    ///
    /// # Errors
    /// Text in another format, or a value out of range, which the error names.
    pub fn from_json(text: &str, path: &Path) -> Result<Self, PlanesError> {
        let mut planes: Self = serde_json::from_str(text)
            .map_err(|e| PlanesError::Syntax { path: path.to_owned(), reason: e.to_string() })?;
        planes.check().map_err(|wrong| PlanesError::Value { path: path.to_owned(), wrong })?;
        Ok(planes)
    }

    fn check(&mut self) -> Result<(), WrongValue> {
        if self.version != PLANES_VERSION {
            return Err(wrong("version", self.version, PLANES_VERSION));
        }
        if self.planes.is_empty() {
            return Err(wrong("planes", "empty", "a list of at least one plane"));
        }
        let mut names: Vec<String> = Vec::new();
        for plane in &mut self.planes {
            let name = plane.name.clone();
            if name.is_empty() || name.contains([',', ' ']) || names.contains(&name) {
                let expected = "a name without spaces and commas that no other plane has";
                return Err(wrong("planes.name", format!("`{name}`"), expected));
            }
            check_plane(plane).map_err(|w| WrongValue { key: format!("planes.{name}.{}", w.key), ..w })?;
            names.push(name);
        }
        Ok(())
    }
}

/// A value outside its range.
#[derive(Debug, Error)]
#[error("`{key}` is {found}; it must be {expected}")]
pub struct WrongValue {
    /// Key of the value, with the names of its plane and view.
    pub key: String,
    /// Value found, as text.
    pub found: String,
    /// Accepted values.
    pub expected: String,
}

fn wrong(key: impl Into<String>, found: impl ToString, expected: impl ToString) -> WrongValue {
    WrongValue { key: key.into(), found: found.to_string(), expected: expected.to_string() }
}

/// Checks that `value`, if any, is above 0 and at most `max`.
fn check_size(key: String, value: Option<f64>, max: f64) -> Result<(), WrongValue> {
    match value {
        Some(value) if !(value > 0.0 && value <= max) => Err(wrong(key, value, format!("above 0 and at most {max}"))),
        _ => Ok(()),
    }
}

fn check_plane(plane: &mut StandardPlane) -> Result<(), WrongValue> {
    let t = &plane.tolerances;
    let numbers = [
        ("angle_deg", Some(t.angle_deg), 90.0),
        ("distance_mm", Some(t.distance_mm), 1000.0),
        ("in_plane_deg", t.in_plane_deg, 90.0),
        ("centring_mm", Some(t.centring_mm), 1000.0),
    ];
    for (key, value, max) in numbers {
        check_size(format!("tolerances.{key}"), value, max)?;
    }
    let [least, greatest] = t.depth_mm;
    if !(least >= 0.0 && greatest > least && greatest <= 1000.0) {
        let expected = "two ascending depths in 0..=1000";
        return Err(wrong("tolerances.depth_mm", format!("[{least}, {greatest}]"), expected));
    }
    if plane.views.is_empty() {
        return Err(wrong("views", "empty", "a list of at least one view"));
    }
    plane.views.iter_mut().try_for_each(|view| {
        let name = view.name.clone();
        check_view(view).map_err(|w| WrongValue { key: format!("views.{name}.{}", w.key), ..w })
    })
}

fn check_view(view: &mut View) -> Result<(), WrongValue> {
    let landmarks = view.landmarks.iter().map(|l| l.position_mm);
    let points = landmarks.chain(view.calipers.iter().flat_map(|c| c.points_mm.iter().copied()));
    for point in points.chain([view.centre_mm]) {
        if !point.is_finite() || point.abs().max_element() > POSITION_LIMIT_MM {
            return Err(wrong("a point", point, format!("within ±{POSITION_LIMIT_MM} mm")));
        }
    }
    let unit = |key: &str, v: DVec3| {
        let is_unit = (v.length() - 1.0).abs() <= DIRECTION_TOLERANCE;
        if is_unit { Ok(v.normalize()) } else { Err(wrong(key, v, "a direction of length 1")) }
    };
    let square = |key: &str, v: DVec3, to: DVec3| {
        if v.dot(to).abs() <= DIRECTION_TOLERANCE {
            Ok(v.reject_from(to).normalize())
        } else {
            Err(wrong(key, v, "square to the directions before it (normal, lateral, to_probe)"))
        }
    };
    view.normal = unit("normal", view.normal)?;
    view.lateral = square("lateral", unit("lateral", view.lateral)?, view.normal)?;
    view.to_probe = square("to_probe", unit("to_probe", view.to_probe)?, view.normal)?;
    view.to_probe = square("to_probe", view.to_probe, view.lateral)?;
    for landmark in &view.landmarks {
        check_size(format!("landmarks.{}.within_mm", landmark.name), landmark.within_mm, 1e3)?;
    }
    for caliper in &view.calipers {
        let key = |k: &str| format!("calipers.{}.{k}", caliper.name);
        if caliper.points_mm.len() != caliper.kind.points() {
            let expected = format!("{} points", caliper.kind.points());
            return Err(wrong(key("points_mm"), format!("{} points", caliper.points_mm.len()), expected));
        }
        if caliper.points_mm.chunks_exact(2).any(|p| p[0].distance(p[1]) < 1e-3) {
            return Err(wrong(key("points_mm"), "two points at one place", "the ends of a line"));
        }
        check_size(key("reach_mm"), Some(caliper.reach_mm), 1e4)?;
        check_size(key("true_mm"), caliper.true_mm, 1e4)?;
    }
    Ok(())
}

#[cfg(test)]
mod tests {
    use serde_json::{Value, json};

    use super::*;

    fn example() -> Value {
        json!({ "version": 1, "planes": [{
            "name": "ball", "title": "middle of the ball",
            "tolerances": { "angle_deg": 10, "distance_mm": 3, "centring_mm": 20, "depth_mm": [20, 100] },
            "views": [{
                "centre_mm": [0, 0, 70], "normal": [0, 1, 0], "lateral": [1, 0, 0], "to_probe": [0, 0, -1],
                "calipers": [{
                    "name": "D", "title": "diameter", "kind": "line", "points_mm": [[-20, 0, 70], [20, 0, 70]],
                    "surface": "sphere", "reach_mm": 5
                }]
            }]
        }]})
    }

    fn read(value: &Value) -> Result<StandardPlanes, PlanesError> {
        StandardPlanes::from_json(&value.to_string(), Path::new("t.planes.json"))
    }

    #[test]
    fn a_file_written_by_hand_is_read() {
        let planes = read(&example()).unwrap();
        assert_eq!(planes.surfaces(), ["sphere"]);
        assert_eq!(planes.chosen(&["ball"]).unwrap().len(), 1);
        let error = planes.chosen(&["bal"]).unwrap_err().to_string();
        assert!(error.contains("did you mean `ball`"), "{error}");
        let error = planes.check_surfaces(Path::new("t.planes.json"), &["spheres"]).unwrap_err().to_string();
        for part in ["t.planes.json: plane `ball`", "`sphere`", "did you mean `spheres`"] {
            assert!(error.contains(part), "{error}");
        }
    }

    #[test]
    fn wrong_values_are_named() {
        for (path, value, words) in [
            ("/version", json!(2), "`version` is 2; it must be 1"),
            ("/planes", json!([]), "`planes` is empty"),
            ("/planes/0/name", json!("a b"), "name without spaces"),
            ("/planes/0/tolerances/angle_deg", json!(0), "`planes.ball.tolerances.angle_deg` is 0"),
            ("/planes/0/tolerances/depth_mm", json!([30, 20]), "two ascending depths"),
            ("/planes/0/views/0/normal", json!([0, 2, 0]), "`planes.ball.views..normal`"),
            ("/planes/0/views/0/lateral", json!([0, 1, 0]), "square to"),
            ("/planes/0/views/0/centre_mm", json!([1e9, 0, 0]), "within"),
            ("/planes/0/views/0/calipers/0/points_mm", json!([[0, 0, 0]]), "it must be 2 points"),
            ("/planes/0/views/0/calipers/0/reach_mm", json!(-1), "calipers.D.reach_mm` is -1"),
            ("/planes/0/views/0/calipers/0/kind", json!("arc"), "unknown variant `arc`"),
        ] {
            let mut file = example();
            *file.pointer_mut(path).unwrap() = value;
            let error = read(&file).unwrap_err().to_string();
            assert!(error.contains(words) && error.contains("t.planes.json"), "{path}: {error}");
        }
        let mut file = example();
        file["planes"][0]["colour"] = json!("red");
        assert!(read(&file).unwrap_err().to_string().contains("unknown field `colour`"));
    }
}
