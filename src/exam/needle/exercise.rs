//! Exercise with a needle: target, entry, and surfaces that must not be punctured.

use glam::DVec3;
use serde::Serialize;
use thiserror::Error;

use crate::names::{listed, named};
use crate::suggest::did_you_mean;

/// Largest number of surface names in an error.
const NAMES_MAX: usize = 20;

/// Way of the needle relative to the image plane.
#[derive(Debug, Clone, Copy, Default, PartialEq, Eq, Serialize)]
#[serde(rename_all = "kebab-case")]
pub enum Approach {
    /// The shaft lies in the image plane.
    InPlane,
    /// The shaft crosses the image plane.
    OutOfPlane,
    /// Either.
    #[default]
    Any,
}

named!(Approach { InPlane = "in-plane", OutOfPlane = "out-of-plane", Any = "any" });

/// Region of the scene: a surface's inside, or a ball.
#[derive(Debug, Clone, PartialEq, Serialize)]
#[serde(rename_all = "snake_case")]
pub enum Region {
    /// Inside of the surfaces of this name.
    Surface(String),
    /// Ball about a point of the scene.
    Ball {
        /// Centre in the scene, mm.
        centre_mm: DVec3,
        /// Radius, mm.
        radius_mm: f64,
    },
}

/// An exercise, from the table `[exercise]` of a station.
#[derive(Debug, Clone, PartialEq, Serialize)]
pub struct Exercise {
    /// Display name.
    pub name: String,
    /// Region that the tip is to reach.
    pub target: Region,
    /// Surface that must be entered first, or region in which the tip must enter the body; `None`: anywhere.
    pub entry: Option<Region>,
    /// Names of surfaces that the tip must not enter. A `*` at the end matches any suffix.
    pub forbidden: Vec<String>,
    /// Required way of the needle relative to the image plane.
    pub approach: Approach,
    /// Time from the entry to the target that earns all points, s.
    pub time_s: f64,
}

/// A surface of an exercise that the scene lacks.
#[derive(Debug, Clone, PartialEq, Eq, Error)]
#[error("`exercise.{key}` names the surface `{surface}`, which the scene lacks{suggestion}; its surfaces are {known}")]
pub struct ExerciseError {
    /// Key of the table `[exercise]`.
    pub key: &'static str,
    /// Name looked up.
    pub surface: String,
    /// Nearest known name, ready to print, or empty.
    pub suggestion: String,
    /// Names of the scene's surfaces.
    pub known: String,
}

impl Exercise {
    /// Checks that a scene with these surfaces has every surface that the exercise names.
    ///
    /// # Errors
    /// The first name that no surface has.
    pub fn check(&self, surfaces: &[&str]) -> Result<(), ExerciseError> {
        let of_region = |region: &Region| match region {
            Region::Surface(name) => Some(name.clone()),
            Region::Ball { .. } => None,
        };
        let target = of_region(&self.target).map(|name| ("target", name));
        let entry = self.entry.as_ref().and_then(of_region).map(|name| ("entry", name));
        let forbidden = self.forbidden.iter().map(|name| ("forbidden", name.clone()));
        let unknown = |(_, name): &(&str, String)| !surfaces.iter().any(|surface| is_called(surface, name));
        let Some((key, surface)) = target.into_iter().chain(entry).chain(forbidden).find(unknown) else {
            return Ok(());
        };
        let suggestion = did_you_mean(&surface, surfaces.iter().copied());
        let known: Vec<String> = surfaces.iter().map(|&name| name.to_owned()).collect();
        Err(ExerciseError { key, surface, suggestion, known: listed(&known, NAMES_MAX, ", ") })
    }

    /// Whether the tip must not enter the surface of this name.
    pub fn forbids(&self, surface: &str) -> bool {
        self.forbidden.iter().any(|name| is_called(surface, name))
    }
}

impl Region {
    /// Whether the region is the inside of a surface of this name.
    pub fn is_surface(&self, surface: &str) -> bool {
        matches!(self, Self::Surface(name) if is_called(surface, name))
    }
}

/// Whether `surface` has the name `name`, or begins like it where that ends with a `*`.
fn is_called(surface: &str, name: &str) -> bool {
    match name.strip_suffix('*') {
        Some(start) => surface.starts_with(start),
        None => surface == name,
    }
}

#[cfg(test)]
mod tests {
    use super::*;

    #[test]
    fn surfaces_that_the_scene_lacks_are_named_with_the_nearest() {
        let exercise = |target: &str, entry: Option<&str>, forbidden: &[&str]| Exercise {
            name: String::new(),
            target: Region::Surface(target.into()),
            entry: entry.map(|name| Region::Surface(name.into())),
            forbidden: forbidden.iter().map(|&name| name.into()).collect(),
            approach: Approach::Any,
            time_s: 60.0,
        };
        let surfaces = ["skin", "vessel wall", "blood", "fetus_head", "fetus_arm"];
        assert_eq!(exercise("blood", Some("skin"), &["vessel wall", "fetus_*"]).check(&surfaces), Ok(()));
        for (wrong, words) in [
            (exercise("blod", None, &[]), ["`exercise.target` names the surface `blod`", "did you mean `blood`"]),
            (exercise("blood", Some("skn"), &[]), ["`exercise.entry`", "did you mean `skin`"]),
            (exercise("blood", None, &["skin", "bone*"]), ["`exercise.forbidden`", "its surfaces are skin, vessel"]),
        ] {
            let error = wrong.check(&surfaces).unwrap_err().to_string();
            assert!(words.iter().all(|word| error.contains(word)), "{error}");
        }
        let fetus = exercise("blood", None, &["fetus_*"]);
        assert!(fetus.forbids("fetus_arm") && !fetus.forbids("fetal") && !fetus.forbids("skin"));
    }
}
