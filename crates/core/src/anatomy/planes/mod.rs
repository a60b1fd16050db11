//! Standard planes of a scene: the image planes that a trainee should find, with tolerances and measurements.
//!
//! The obstetric phantom has built-in planes. Any other scene has them in a file next to its glTF file: `belly.glb` has
//! `belly.planes.json` ([`read_planes`]). `insonify planes STATION --json` prints a complete file.
//!
//! Points are in mm and directions are unit vectors, both in the scene frame, written `[x, y, z]`; a pose is `[x, y, z,
//! qw, qx, qy, qz]`, as in a station file.

mod file;
mod pose;
mod table;

use std::path::Path;

use glam::DVec3;
use serde::{Deserialize, Serialize};

pub use file::{PlanesError, WrongValue, planes_path, read_planes};

use super::Skin;
use crate::pose::Pose;

/// Version of the file's format; a reader refuses any other.
pub const PLANES_VERSION: u32 = 1;

/// All standard planes of a scene.
#[derive(Debug, Clone, PartialEq, Serialize, Deserialize)]
#[serde(deny_unknown_fields)]
pub struct StandardPlanes {
    /// Version of the file's format: [`PLANES_VERSION`].
    pub version: u32,
    /// Planes, in the usual order of an examination; at least one.
    pub planes: Vec<StandardPlane>,
}

/// A standard plane: an image plane that a trainee should find.
#[derive(Debug, Clone, PartialEq, Serialize, Deserialize)]
#[serde(deny_unknown_fields)]
pub struct StandardPlane {
    /// Short name without spaces, unique in the scene: `head`.
    pub name: String,
    /// Display name.
    pub title: String,
    /// Guideline that defines the plane; may be empty.
    #[serde(default, skip_serializing_if = "String::is_empty")]
    pub source: String,
    /// Tolerances within which the plane counts as found.
    pub tolerances: Tolerances,
    /// Views of the plane, at least one. Finding any of them suffices, for example either femur.
    pub views: Vec<View>,
}

/// Tolerances within which an image shows a standard plane.
#[derive(Debug, Clone, PartialEq, Serialize, Deserialize)]
#[serde(deny_unknown_fields)]
pub struct Tolerances {
    /// Largest angle between the image plane and the standard plane, degrees.
    pub angle_deg: f64,
    /// Largest distance of the standard plane's centre from the image plane, mm.
    pub distance_mm: f64,
    /// Largest angle in the image between [`View::lateral`] and the horizontal, degrees; `None` accepts any.
    #[serde(default, skip_serializing_if = "Option::is_none")]
    pub in_plane_deg: Option<f64>,
    /// Largest distance of the standard plane's centre from the image's middle line, mm.
    pub centring_mm: f64,
    /// Smallest and largest depth of the standard plane's centre below the probe's face, mm.
    pub depth_mm: [f64; 2],
    /// Source of these tolerances; may be empty.
    #[serde(default, skip_serializing_if = "String::is_empty")]
    pub source: String,
}

/// A view of a standard plane.
#[derive(Debug, Clone, PartialEq, Serialize, Deserialize)]
#[serde(deny_unknown_fields)]
pub struct View {
    /// Name of the view, for example `left`; empty if there is only one.
    #[serde(default, skip_serializing_if = "String::is_empty")]
    pub name: String,
    /// Centre of the anatomy to show, in the plane.
    pub centre_mm: DVec3,
    /// Normal of the plane; its sign is irrelevant.
    pub normal: DVec3,
    /// Direction in the plane across the beam; horizontal in an ideal image.
    pub lateral: DVec3,
    /// Whether a plane at any angle about the line along [`View::lateral`] is accepted, as for a long bone.
    #[serde(default, skip_serializing_if = "std::ops::Not::not")]
    pub any_turn_about_lateral: bool,
    /// Direction from the centre to the probe on the skin; in the plane, perpendicular to `lateral`.
    pub to_probe: DVec3,
    /// `scene_from_probe` of a probe on the skin that shows the view, for display; `None` if there is none.
    #[serde(default, skip_serializing_if = "Option::is_none", with = "pose")]
    pub pose: Option<Pose>,
    /// Names of the glTF nodes whose outlines in the plane are displayed for orientation.
    #[serde(default, skip_serializing_if = "Vec::is_empty")]
    pub outlines: Vec<String>,
    /// Points of the anatomy that the image must show.
    #[serde(default, skip_serializing_if = "Vec::is_empty")]
    pub landmarks: Vec<PlaneLandmark>,
    /// Measurements in the plane.
    #[serde(default, skip_serializing_if = "Vec::is_empty")]
    pub calipers: Vec<Caliper>,
}

/// A point that the image must show.
#[derive(Debug, Clone, PartialEq, Serialize, Deserialize)]
#[serde(deny_unknown_fields)]
pub struct PlaneLandmark {
    /// Name of the anatomical structure.
    pub name: String,
    /// Position, mm.
    pub position_mm: DVec3,
    /// Largest distance from the image plane at which the point counts as visible, mm. If `None`, any
    /// point within the image's sector is accepted.
    #[serde(default, skip_serializing_if = "Option::is_none")]
    pub within_mm: Option<f64>,
}

/// A measurement in the plane.
#[derive(Debug, Clone, PartialEq, Serialize, Deserialize)]
#[serde(deny_unknown_fields)]
pub struct Caliper {
    /// Name of the measurement as in `caliper` events, for example `BPD`.
    pub name: String,
    /// Display name.
    pub title: String,
    /// Line or ellipse.
    pub kind: CaliperKind,
    /// Both ends of a line, or the ends of an ellipse's first axis, then of its second, mm.
    pub points_mm: Vec<DVec3>,
    /// Name of the glTF node whose border is measured.
    pub surface: String,
    /// Name of the surface measured at the end far from the probe; `None` if it is `surface`. For an outer-to-inner
    /// diameter of a skull, the far surface is the inside of the skull.
    #[serde(default, skip_serializing_if = "Option::is_none")]
    pub far_surface: Option<String>,
    /// Largest distance between the caliper and the border that it measures, mm.
    pub reach_mm: f64,
    /// True length or circumference, mm. If `None`, it is measured on the scene's surfaces in the plane.
    #[serde(default, skip_serializing_if = "Option::is_none")]
    pub true_mm: Option<f64>,
}

/// Kind of a measurement.
#[derive(Debug, Clone, Copy, PartialEq, Eq, Serialize, Deserialize)]
#[serde(rename_all = "lowercase")]
pub enum CaliperKind {
    /// Distance between two points.
    Line,
    /// Circumference of an ellipse.
    Ellipse,
}

impl CaliperKind {
    /// Number of points that define the measurement.
    pub fn points(self) -> usize {
        match self {
            Self::Line => 2,
            Self::Ellipse => 4,
        }
    }
}

impl StandardPlanes {
    /// Planes called `names`, in the order of the names; all planes if there are no names.
    ///
    /// # Errors
    /// The first unknown name.
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

    /// Sets the pose of a probe in each view, with the face `press_mm` below `skin`. The pose is `None` if the line
    /// from the view's centre to the probe does not hit the skin.
    #[must_use]
    pub fn with_poses(mut self, skin: &Skin, press_mm: f64) -> Self {
        for view in self.planes.iter_mut().flat_map(|plane| &mut plane.views) {
            view.pose = view.pose_on(skin, press_mm);
        }
        self
    }

    /// Names of the surfaces in calipers and outlines, each once.
    pub fn surfaces(&self) -> Vec<&str> {
        let mut names: Vec<_> = self.planes.iter().flat_map(StandardPlane::surfaces).collect();
        names.sort_unstable();
        names.dedup();
        names
    }

    /// Checks that a scene with surfaces called `known` has all surfaces named in these planes. Errors name `file`.
    ///
    /// # Errors
    /// The first missing surface.
    pub fn check_surfaces(&self, file: &Path, known: &[&str]) -> Result<(), PlanesError> {
        let mut named = self.planes.iter().flat_map(|plane| plane.surfaces().map(move |name| (plane, name)));
        match named.find(|(_, name)| !known.contains(name)) {
            None => Ok(()),
            Some((plane, name)) => Err(PlanesError::Surface {
                path: file.to_owned(),
                plane: plane.name.clone(),
                name: name.to_owned(),
                suggestion: crate::suggest::did_you_mean(name, known.iter().copied()),
            }),
        }
    }
}

impl StandardPlane {
    /// Names of the surfaces in the plane's calipers and outlines.
    fn surfaces(&self) -> impl Iterator<Item = &str> {
        self.views.iter().flat_map(|view| {
            let measured = view.calipers.iter().flat_map(|c| [&c.surface].into_iter().chain(&c.far_surface));
            measured.chain(&view.outlines).map(String::as_str)
        })
    }
}
