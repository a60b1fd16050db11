//! Standard planes of a station, and the skin that a probe touches.

use super::{SceneSource, Station, StationError};
use crate::anatomy::planes::{StandardPlanes, planes_path};
use crate::anatomy::{Scene, Skin};
use crate::phantom;

/// Depth to which a probe's face presses the skin at the pose of a standard plane, mm.
const PRESS_MM: f64 = 2.5;

/// Standard planes of a scene, and its skin.
#[derive(Debug)]
pub struct PlaneScene {
    /// Standard planes, including the probe poses on the skin that show them.
    pub planes: StandardPlanes,
    /// Outer surface of the scene.
    pub skin: Skin,
}

impl PlaneScene {
    /// Reads the planes. If the scene is a file, reads it for the skin; the phantom's skin is known without its mesh.
    ///
    /// # Errors
    /// Errors of [`Station::standard_planes`]; for a scene file also those of [`Station::load_scene_from`] and
    /// [`PlaneScene::of`].
    pub fn open(station: &Station) -> Result<Self, StationError> {
        match &station.scene {
            SceneSource::File(path) => Self::of(station, &station.load_scene_from(path)?),
            SceneSource::ObstetricPhantom(options) => Self::on(phantom::skin(&options.parameters), station),
        }
    }

    /// Planes and skin of the station's `scene`.
    ///
    /// # Errors
    /// Errors of [`Station::standard_planes`]; the planes name a surface that the scene lacks; or the scene has no
    /// triangles.
    pub fn of(station: &Station, scene: &Scene) -> Result<Self, StationError> {
        let names: Vec<_> = scene.surfaces.iter().map(|surface| surface.name.as_str()).collect();
        // The phantom's planes match its surfaces, so no error ever shows this empty path.
        let file = station.scene_file().map(planes_path).unwrap_or_default();
        station.standard_planes()?.check_surfaces(&file, &names)?;
        match &station.scene {
            SceneSource::File(_) => Self::on(Skin::of_scene(scene)?, station),
            SceneSource::ObstetricPhantom(options) => Self::on(phantom::skin(&options.parameters), station),
        }
    }

    fn on(skin: Skin, station: &Station) -> Result<Self, StationError> {
        Ok(Self { planes: station.standard_planes()?.with_poses(&skin, PRESS_MM), skin })
    }
}
