//! A station's standard planes, and the skin that a probe touches.

use insonify::anatomy::planes::{StandardPlanes, file_beside};
use insonify::anatomy::{Scene, Skin};
use insonify::phantom;
use insonify::station::{SceneSource, Station};

use super::{Classify, Failure};

/// Depth of a probe in the skin at the pose of a plane, mm.
const PRESS_MM: f64 = 2.5;

/// Standard planes of a scene, and its skin.
pub(crate) struct PlaneScene {
    /// Including probe poses on the skin.
    pub(crate) planes: StandardPlanes,
    pub(crate) skin: Skin,
}

impl PlaneScene {
    /// Reads the planes, and the scene if it is a file. The phantom's skin needs no mesh.
    pub(crate) fn open(station: &Station) -> Result<Self, Failure> {
        match &station.scene {
            SceneSource::File(path) => Self::of(station, &station.load_scene_from(path)?),
            SceneSource::ObstetricPhantom(options) => Self::on(phantom::skin(&options.parameters), station),
        }
    }

    /// Planes and skin of the station's `scene`.
    pub(crate) fn of(station: &Station, scene: &Scene) -> Result<Self, Failure> {
        let names: Vec<_> = scene.surfaces.iter().map(|surface| surface.name.as_str()).collect();
        // The phantom's planes and surfaces match: its file is never named.
        let file = station.scene_file().map(file_beside).unwrap_or_default();
        station.standard_planes()?.check_surfaces(&file, &names)?;
        match &station.scene {
            SceneSource::File(_) => Self::on(Skin::of_scene(scene).input()?, station),
            SceneSource::ObstetricPhantom(options) => Self::on(phantom::skin(&options.parameters), station),
        }
    }

    fn on(skin: Skin, station: &Station) -> Result<Self, Failure> {
        Ok(Self { planes: station.standard_planes()?.with_poses(&skin, PRESS_MM), skin })
    }
}

/// Description of the scene.
pub(crate) fn scene_name(station: &Station) -> String {
    match &station.scene {
        SceneSource::File(path) => path.display().to_string(),
        SceneSource::ObstetricPhantom { .. } => "obstetric phantom".to_owned(),
    }
}
