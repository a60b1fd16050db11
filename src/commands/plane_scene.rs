//! A station's scene as its standard planes need it: the planes, the skin, the surfaces that are measured.

use std::collections::BTreeMap;

use insonify::anatomy::planes::StandardPlanes;
use insonify::anatomy::{Mesh, Scene, Skin, phantom};
use insonify::station::{SceneSource, Station};

use super::{Classify, Failure};

/// Cells of the phantom's surfaces that are measured, mm.
const CELL_MM: f32 = 0.7;

/// How deep a probe is pressed into the skin where a plane's pose is given, mm.
pub(crate) const PRESS_MM: f64 = 2.5;

/// What a station's planes need.
pub(crate) struct PlaneScene {
    pub(crate) planes: StandardPlanes,
    pub(crate) skin: Skin,
    /// The scene, where it has a file.
    scene: Option<Scene>,
}

impl PlaneScene {
    /// Reads planes and scene.
    pub(crate) fn open(station: &Station) -> Result<Self, Failure> {
        let planes = station.standard_planes()?;
        let scene = station.scene_file().map(|path| station.load_scene_from(path)).transpose()?;
        let skin = match &scene {
            Some(scene) => {
                let names: Vec<_> = scene.surfaces.iter().map(|surface| surface.name.as_str()).collect();
                planes.check_surfaces(&names)?;
                Skin::of_scene(scene).input()?
            }
            None => Skin::phantom().ok_or_else(|| Failure::Other(anyhow::anyhow!("the phantom has no skin")))?,
        };
        Ok(Self { planes: planes.with_poses(&skin, PRESS_MM), skin, scene })
    }

    /// Surfaces that the planes name.
    pub(crate) fn surfaces(self) -> (StandardPlanes, Skin, BTreeMap<String, Mesh>) {
        let names = self.planes.surfaces();
        let surfaces = match self.scene {
            Some(scene) => {
                let named = scene.surfaces.into_iter().filter(|surface| names.contains(&surface.name.as_str()));
                named.map(|surface| (surface.name, surface.mesh)).collect()
            }
            None => phantom::parts(&names, CELL_MM).into_iter().map(|part| (part.name, part.mesh)).collect(),
        };
        (self.planes, self.skin, surfaces)
    }
}

/// What the scene is, for people.
pub(crate) fn scene_name(station: &Station) -> String {
    match &station.scene {
        SceneSource::File(path) => path.display().to_string(),
        SceneSource::ObstetricPhantom { .. } => "obstetric phantom".to_owned(),
    }
}
