//! Standard planes of a scene: what a trainee is to find, how near counts, and what is measured there.
//!
//! The obstetric phantom knows its own ([`obstetric`]). Any other scene brings them in a file beside its glTF file:
//! `belly.glb` has `belly.planes.json` ([`beside`]). `insonify planes STATION --json` prints a whole such file.
//!
//! Points are in mm and directions are unit vectors, both in the scene frame, written `[x, y, z]`; a pose is
//! `[x, y, z, qw, qx, qy, qz]`, as in a station file.

mod file;
mod json;
mod obstetric;
mod pose;

use glam::DVec3;
use serde::{Deserialize, Serialize};

pub use file::{PlanesError, beside, file_beside};
pub use obstetric::{obstetric, obstetric_of};

use super::Skin;
use crate::pose::Pose;

/// Version of the file's format; a reader refuses any other.
pub const PLANES_VERSION: u32 = 1;

/// Every standard plane of a scene.
#[derive(Debug, Clone, PartialEq, Serialize, Deserialize)]
#[serde(deny_unknown_fields)]
pub struct StandardPlanes {
    /// [`PLANES_VERSION`].
    pub version: u32,
    /// The planes, in the order in which they are usually looked for; at least one.
    pub planes: Vec<StandardPlane>,
}

/// A plane that a trainee is to find.
#[derive(Debug, Clone, PartialEq, Serialize, Deserialize)]
#[serde(deny_unknown_fields)]
pub struct StandardPlane {
    /// Short name without spaces, unique in the scene: `head`.
    pub name: String,
    /// What people call it.
    pub title: String,
    /// Who defines it.
    #[serde(default, skip_serializing_if = "String::is_empty")]
    pub source: String,
    /// How near counts as found.
    pub tolerances: Tolerances,
    /// Where it is; any one of them will do (either femur, for example). At least one.
    pub views: Vec<View>,
}

/// How near to a plane counts as found.
#[derive(Debug, Clone, PartialEq, Serialize, Deserialize)]
#[serde(deny_unknown_fields)]
pub struct Tolerances {
    /// Greatest angle between image plane and standard plane, degrees.
    pub angle_deg: f64,
    /// Greatest distance of the plane's centre from the image plane, mm.
    pub distance_mm: f64,
    /// Greatest angle in the image between [`View::lateral`] and the horizontal, degrees; none where any will do.
    #[serde(default, skip_serializing_if = "Option::is_none")]
    pub in_plane_deg: Option<f64>,
    /// Greatest distance of the plane's centre from the image's middle line, mm.
    pub centring_mm: f64,
    /// Least and greatest depth of the plane's centre below the probe's face, mm.
    pub depth_mm: [f64; 2],
    /// Where the numbers come from.
    #[serde(default, skip_serializing_if = "String::is_empty")]
    pub source: String,
}

/// One place where a plane can be seen.
#[derive(Debug, Clone, PartialEq, Serialize, Deserialize)]
#[serde(deny_unknown_fields)]
pub struct View {
    /// Which one it is, `left` for example; empty where there is only one.
    #[serde(default, skip_serializing_if = "String::is_empty")]
    pub name: String,
    /// Centre of what is looked at, in the plane.
    #[serde(with = "json::vector")]
    pub centre_mm: DVec3,
    /// Normal of the plane; its sign does not matter.
    #[serde(with = "json::vector")]
    pub normal: DVec3,
    /// Direction in the plane that lies across the beam, horizontal in the image, when the view is best.
    #[serde(with = "json::vector")]
    pub lateral: DVec3,
    /// Whether any plane through the line along [`View::lateral`] will do, as for a long bone.
    #[serde(default, skip_serializing_if = "std::ops::Not::not")]
    pub any_turn_about_lateral: bool,
    /// From the centre to where the probe is on the skin; in the plane, across `lateral`.
    #[serde(with = "json::vector")]
    pub to_probe: DVec3,
    /// `scene_from_probe` of a probe on the skin that shows the view; for people and pages.
    #[serde(default, skip_serializing_if = "Option::is_none", with = "json::optional_pose")]
    pub pose: Option<Pose>,
    /// Surfaces whose outline shows people where they are, by the names of their glTF nodes.
    #[serde(default, skip_serializing_if = "Vec::is_empty")]
    pub outlines: Vec<String>,
    /// Points that belong in the image.
    #[serde(default, skip_serializing_if = "Vec::is_empty")]
    pub landmarks: Vec<PlaneLandmark>,
    /// What is measured.
    #[serde(default, skip_serializing_if = "Vec::is_empty")]
    pub calipers: Vec<Caliper>,
}

/// A point that belongs in the image.
#[derive(Debug, Clone, PartialEq, Serialize, Deserialize)]
#[serde(deny_unknown_fields)]
pub struct PlaneLandmark {
    /// What is there.
    pub name: String,
    /// Where.
    #[serde(with = "json::vector")]
    pub position_mm: DVec3,
    /// Greatest distance from the image plane at which it is still seen, mm; none where it need only be within the sector.
    #[serde(default, skip_serializing_if = "Option::is_none")]
    pub within_mm: Option<f64>,
}

/// A measurement in the plane.
#[derive(Debug, Clone, PartialEq, Serialize, Deserialize)]
#[serde(deny_unknown_fields)]
pub struct Caliper {
    /// Its name, as in `caliper` events: `BPD`.
    pub name: String,
    /// What people call it.
    pub title: String,
    /// A line or an ellipse.
    pub kind: CaliperKind,
    /// A line's two ends, or the two ends of an ellipse's first axis and the two of its second.
    #[serde(with = "json::vectors")]
    pub points_mm: Vec<DVec3>,
    /// Surface whose border is measured, by the name of its glTF node.
    pub surface: String,
    /// Surface whose border counts at the end far from the probe, where that is another one: a skull's inside, for
    /// example, of an outer-to-inner diameter.
    #[serde(default, skip_serializing_if = "Option::is_none")]
    pub far_surface: Option<String>,
    /// How far from the caliper a border may lie and still be taken for its, mm.
    pub reach_mm: f64,
    /// The true length or circumference, mm; without it, what the scene's surfaces measure in the plane itself.
    #[serde(default, skip_serializing_if = "Option::is_none")]
    pub true_mm: Option<f64>,
}

/// How something is measured.
#[derive(Debug, Clone, Copy, PartialEq, Eq, Serialize, Deserialize)]
#[serde(rename_all = "lowercase")]
pub enum CaliperKind {
    /// The distance of two points.
    Line,
    /// The circumference of an ellipse.
    Ellipse,
}

impl CaliperKind {
    /// Points that it takes.
    pub fn points(self) -> usize {
        match self {
            Self::Line => 2,
            Self::Ellipse => 4,
        }
    }
}

impl StandardPlanes {
    /// The planes called `names`, in their order; all of them where there are no names.
    ///
    /// # Errors
    /// The first name that no plane has.
    pub fn chosen(&self, names: &[impl AsRef<str>]) -> Result<Vec<&StandardPlane>, PlanesError> {
        if names.is_empty() {
            return Ok(self.planes.iter().collect());
        }
        let known = || self.planes.iter().map(|plane| plane.name.as_str());
        let find = |name: &str| {
            self.planes.iter().find(|plane| plane.name == name).ok_or_else(|| PlanesError::Unknown {
                name: name.to_owned(),
                suggestion: crate::suggest::did_you_mean(name, known()),
                known: known().collect::<Vec<_>>().join(", "),
            })
        };
        names.iter().map(|name| find(name.as_ref())).collect()
    }

    /// Gives each view the pose of a probe on `skin` that shows it; a view whose line to the probe meets no skin has none.
    #[must_use]
    pub fn with_poses(mut self, skin: &Skin, press_mm: f64) -> Self {
        for view in self.planes.iter_mut().flat_map(|plane| &mut plane.views) {
            view.pose = view.pose_on(skin, press_mm);
        }
        self
    }

    /// Names of the surfaces that calipers measure and outlines show, each once.
    pub fn surfaces(&self) -> Vec<&str> {
        let views = || self.planes.iter().flat_map(|plane| &plane.views);
        let measured = views().flat_map(|view| &view.calipers);
        let measured = measured.flat_map(|c| std::iter::once(c.surface.as_str()).chain(c.far_surface.as_deref()));
        let mut names: Vec<_> = measured.chain(views().flat_map(|view| &view.outlines).map(String::as_str)).collect();
        names.sort_unstable();
        names.dedup();
        names
    }

    /// Whether a scene with surfaces called `known` has every surface that is named here.
    ///
    /// # Errors
    /// The first one that it lacks.
    pub fn check_surfaces(&self, known: &[&str]) -> Result<(), PlanesError> {
        match self.surfaces().into_iter().find(|name| !known.contains(name)) {
            None => Ok(()),
            Some(name) => {
                let suggestion = crate::suggest::did_you_mean(name, known.iter().copied());
                Err(PlanesError::Surface { name: name.to_owned(), suggestion })
            }
        }
    }
}
