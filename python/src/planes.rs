//! Standard planes of a scene, and the offset of an image from one.

use insonify::anatomy::Skin;
use insonify::anatomy::planes::StandardPlanes;
use insonify::exam::offset::Offset;
use insonify::exam::score::{HOLD_S, is_on_skin};
use insonify::pose::Pose;
use insonify::settings::ContactSettings;
use insonify::transducer::{Probe, touch};
use pyo3::prelude::*;

use crate::errors::{Failure, Kind};
use crate::frame::pose_of;

/// Standard planes of a station's scene, with its skin.
#[pyclass(frozen, module = "insonify._insonify")]
pub(crate) struct Planes {
    pub(crate) planes: StandardPlanes,
    pub(crate) skin: Skin,
    pub(crate) probe: Probe,
    pub(crate) contact: ContactSettings,
}

/// Contact of a probe with the skin: the coupled part of the face, 0..=1, the depth of its centre below the skin, mm
/// (`None` if far away), and whether a score counts the probe as on the skin.
pub(crate) type Touched = (f64, Option<f64>, bool);

/// Contact of `probe` at `pose` with `skin`.
pub(crate) fn touched(skin: &Skin, probe: &Probe, pose: &Pose, contact: &ContactSettings) -> Touched {
    let (_, contact) = touch(skin, probe, pose, contact);
    (contact.part, contact.press_mm, is_on_skin(&contact))
}

#[pymethods]
impl Planes {
    /// The planes as JSON, as in the file next to a scene.
    fn json(&self) -> PyResult<String> {
        Ok(serde_json::to_string(&self.planes).map_err(|error| Failure::of(Kind::Internal, &error))?)
    }

    /// Index of the view of a plane that is nearest to the image, and the image's offset from it as JSON.
    fn offset(&self, plane: &str, pose: [f64; 7]) -> PyResult<(usize, String)> {
        let pose = pose_of(pose)?;
        let chosen = self.planes.chosen(&[plane]).map_err(|error| Failure::of(Kind::Input, &error))?;
        let nearest = chosen.first().and_then(|plane| Offset::nearest(plane, &self.probe, &pose));
        let no_view = || Failure::new(Kind::Input, format!("the plane {plane} has no view"));
        let (view, offset) = nearest.ok_or_else(no_view)?;
        Ok((view, serde_json::to_string(&offset).map_err(|error| Failure::of(Kind::Internal, &error))?))
    }

    /// Contact of the probe with the skin.
    fn touch(&self, pose: [f64; 7]) -> PyResult<Touched> {
        Ok(touched(&self.skin, &self.probe, &pose_of(pose)?, &self.contact))
    }

    /// Time for which a plane must be held so that it counts as found, s.
    #[classattr]
    fn hold_s() -> f64 {
        HOLD_S
    }
}
