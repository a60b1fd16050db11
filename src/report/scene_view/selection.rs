//! Selection of surfaces by name.

use super::ViewError;
use crate::anatomy::Scene;
use crate::suggest::did_you_mean;

/// Visible surfaces of a scene.
#[derive(Debug, Clone, PartialEq, Eq)]
pub struct Selection {
    pub(super) shown: Vec<bool>,
}

impl Selection {
    /// Shows every surface of `scene`.
    pub fn all(scene: &Scene) -> Self {
        Self { shown: vec![true; scene.surfaces.len()] }
    }

    /// Shows the surfaces in `only` (all if it is empty) except those in `hide`, by the name of a surface or tissue.
    ///
    /// # Errors
    /// An unknown name; no surface left.
    pub fn of(scene: &Scene, only: &[String], hide: &[String]) -> Result<Self, ViewError> {
        let tissue = |index: usize| scene.tissues.names().get(index).map_or("", String::as_str);
        let named = |name: &str| -> Result<Vec<bool>, ViewError> {
            let found: Vec<bool> = scene.surfaces.iter().map(|s| s.name == name || tissue(s.tissue) == name).collect();
            if found.contains(&true) {
                return Ok(found);
            }
            let known = scene.surfaces.iter().flat_map(|s| [s.name.as_str(), tissue(s.tissue)]);
            Err(ViewError::UnknownName { name: name.to_owned(), suggestion: did_you_mean(name, known) })
        };
        let mut shown = vec![only.is_empty(); scene.surfaces.len()];
        for (names, value) in [(only, true), (hide, false)] {
            for name in names {
                let found = named(name)?;
                shown.iter_mut().zip(found).filter(|(_, found)| *found).for_each(|(shown, _)| *shown = value);
            }
        }
        if shown.contains(&true) { Ok(Self { shown }) } else { Err(ViewError::NothingLeft) }
    }
}
