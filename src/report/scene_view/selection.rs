//! Selection of visible surfaces by name, and their opacities.

use std::str::FromStr;

use super::ViewError;
use crate::anatomy::{Scene, Surface};
use crate::sink::layers::Layers;
use crate::suggest::did_you_mean;

/// Opacity of a layer, a tissue or a surface.
#[derive(Debug, Clone, PartialEq)]
pub struct Opacity {
    /// Name of the layer, the tissue or the surface.
    pub name: String,
    /// Opacity, percent, 0..=100.
    pub percent: f32,
}

impl FromStr for Opacity {
    type Err = ViewError;

    fn from_str(text: &str) -> Result<Self, ViewError> {
        let wrong = || ViewError::Opacity { text: text.to_owned() };
        let (name, percent) = text.split_once('=').ok_or_else(wrong)?;
        let percent =
            percent.trim_end_matches('%').parse::<f32>().ok().filter(|percent| (0.0..=100.0).contains(percent));
        Ok(Self { name: name.to_owned(), percent: percent.ok_or_else(wrong)? })
    }
}

/// Surfaces of a scene that are visible, with their opacities.
#[derive(Debug, Clone, PartialEq)]
pub struct Selection {
    pub(super) shown: Vec<bool>,
    /// Whether each surface was requested by name. Such a surface is shown even if its layer is hidden at first.
    is_named: Vec<bool>,
    /// Requested opacity of each surface, 0..=1; none for the default.
    given: Vec<Option<f32>>,
}

impl Selection {
    /// Shows every surface of `scene`.
    pub fn all(scene: &Scene) -> Self {
        let count = scene.surfaces.len();
        Self { shown: vec![true; count], is_named: vec![false; count], given: vec![None; count] }
    }

    /// Shows the surfaces in `only` (all if it is empty), except those in `hide`. Both hold names of surfaces, tissues
    /// or layers.
    ///
    /// # Errors
    /// A name is unknown, or no surface is left.
    pub fn of(scene: &Scene, only: &[String], hide: &[String]) -> Result<Self, ViewError> {
        let mut selection = Self::all(scene);
        let names = Names::of(scene);
        if !only.is_empty() {
            selection.shown.fill(false);
        }
        for name in only {
            for index in names.found(name)? {
                selection.shown[index] = true;
                selection.is_named[index] = true;
            }
        }
        for name in hide {
            for index in names.found(name)? {
                selection.shown[index] = false;
            }
        }
        if selection.shown.contains(&true) { Ok(selection) } else { Err(ViewError::NothingLeft) }
    }

    /// Sets opacities of surfaces. If several apply to a surface, the last one counts.
    ///
    /// # Errors
    /// A name is unknown.
    pub fn with_opacities(mut self, scene: &Scene, opacities: &[Opacity]) -> Result<Self, ViewError> {
        let names = Names::of(scene);
        for Opacity { name, percent } in opacities {
            for index in names.found(name)? {
                self.given[index] = Some(percent / 100.0);
            }
        }
        Ok(self)
    }

    /// Opacities of the surfaces at `indices`, each 0..=1.
    pub(super) fn opacities(&self, scene: &Scene, indices: &[usize]) -> Vec<f32> {
        let surfaces: Vec<_> = indices.iter().filter_map(|&i| scene.surfaces.get(i)).map(|s| (s, &s.mesh)).collect();
        let layers = Layers::of(scene, &surfaces);
        let of = |(at, &index): (usize, &usize)| match self.given.get(index) {
            Some(&Some(given)) => given,
            _ if self.is_named.get(index) == Some(&true) => layers.opacity_if_shown(at),
            _ => layers.opacity(at),
        };
        indices.iter().enumerate().map(of).collect()
    }
}

/// Names of a scene's surfaces, tissues and layers.
struct Names<'a> {
    scene: &'a Scene,
    layers: Layers,
}

impl<'a> Names<'a> {
    fn of(scene: &'a Scene) -> Self {
        let surfaces: Vec<_> = scene.surfaces.iter().map(|s| (s, &s.mesh)).collect();
        Self { scene, layers: Layers::of(scene, &surfaces) }
    }

    fn tissue(&self, surface: &Surface) -> &'a str {
        self.scene.tissues.names().get(surface.tissue).map_or("", String::as_str)
    }

    /// Indices of the surfaces that `name` selects: surfaces or tissues with this name, or else a layer.
    fn found(&self, name: &str) -> Result<Vec<usize>, ViewError> {
        let surfaces = || self.scene.surfaces.iter().enumerate();
        let found: Vec<usize> =
            surfaces().filter(|(_, s)| s.name == name || self.tissue(s) == name).map(|(i, _)| i).collect();
        if !found.is_empty() {
            return Ok(found);
        }
        let layers = &self.layers.layers;
        if let Some(layer) = layers.iter().position(|layer| layer.name == name) {
            let members = self.layers.members.iter().enumerate();
            return Ok(members.filter(|(_, member)| member.layer == layer).map(|(i, _)| i).collect());
        }
        let known = surfaces().flat_map(|(_, s)| [s.name.as_str(), self.tissue(s)]);
        let known = known.chain(layers.iter().map(|layer| layer.name.as_str()));
        Err(ViewError::UnknownName { name: name.to_owned(), suggestion: did_you_mean(name, known) })
    }
}
