//! Directions of a scene's axes in the patient, by their letters.

use std::str::FromStr;

use glam::{DMat3, DVec3};
use thiserror::Error;

/// Directions of the scene's axes in the patient.
#[derive(Debug, Clone, Copy, PartialEq)]
pub struct SceneAxes {
    pub(super) ras_from_scene: DMat3,
}

/// Text that does not name the axes of a scene.
#[derive(Debug, Error, Clone, PartialEq, Eq)]
#[error("`{text}` are no axes: expected three letters of R or L, A or P, S or I, each pair once, right-handed")]
pub struct SceneAxesError {
    /// Text given.
    pub text: String,
}

impl FromStr for SceneAxes {
    type Err = SceneAxesError;

    /// Reads the directions of x, y and z from their letters: `RAS`, `LPS`, `LSA` and so on.
    fn from_str(text: &str) -> Result<Self, SceneAxesError> {
        let direction = |letter| match letter {
            'R' => Some(DVec3::X),
            'L' => Some(-DVec3::X),
            'A' => Some(DVec3::Y),
            'P' => Some(-DVec3::Y),
            'S' => Some(DVec3::Z),
            'I' => Some(-DVec3::Z),
            _ => None,
        };
        let mut letters = text.chars().map(direction);
        let mut next = || letters.next().flatten();
        let columns = (next(), next(), next());
        let (Some(x), Some(y), Some(z)) = columns else { return Err(SceneAxesError { text: text.to_owned() }) };
        let ras_from_scene = DMat3::from_cols(x, y, z);
        // A scene is right-handed, as RAS is. Left-handed letters would mirror it.
        if letters.next().is_some() || ras_from_scene.determinant() < 0.5 {
            return Err(SceneAxesError { text: text.to_owned() });
        }
        Ok(Self { ras_from_scene })
    }
}

impl Default for SceneAxes {
    /// RAS.
    fn default() -> Self {
        Self { ras_from_scene: DMat3::IDENTITY }
    }
}

#[cfg(test)]
mod tests {
    use super::*;

    #[test]
    fn axes_are_letters() {
        let matrix = |text: &str| text.parse::<SceneAxes>().map(|axes| axes.ras_from_scene);
        assert_eq!(matrix("RAS"), Ok(DMat3::IDENTITY));
        assert_eq!(matrix("LPS"), Ok(DMat3::from_diagonal(DVec3::new(-1.0, -1.0, 1.0))));
        assert_eq!(matrix("LSA"), Ok(DMat3::from_cols(-DVec3::X, DVec3::Z, DVec3::Y)));
        for text in ["", "RA", "RASS", "LAS", "RRS", "ras", "RAX"] {
            assert!(matrix(text).is_err(), "{text}");
        }
    }
}
