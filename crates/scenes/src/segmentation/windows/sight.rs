//! Lines of sight from the skin to a target, and their obstruction by bone and gas.

use glam::DVec3;
use insonify_core::anatomy::Skin;

use crate::segmentation::from_labels::Made;
use crate::segmentation::grid::CutPlane;

/// Distance from a cut plane, mm, within which the outer surface counts as the end of the scan and not as skin.
const CUT_MM: f64 = 6.0;
/// Positions of sampled points across the target, relative to its half width.
const ACROSS: [f64; 5] = [-0.8, -0.4, 0.0, 0.4, 0.8];
/// Positions of sampled points on the probe's face, relative to the part of it that sees the target.
const FACE: [f64; 3] = [-1.0, 0.0, 1.0];
/// Half of the face that sees a wide target, mm. A small one, such as pleura between two ribs, is seen by a part twice as
/// wide as the target.
const FACE_MM: f64 = 18.0;
/// Length at both ends of a line of sight that is not checked for bone and gas, mm.
const ENDS_MM: f64 = 1.0;

/// Skin of a patient, and surfaces that ultrasound does not pass, for lines of sight.
#[derive(Debug)]
pub struct Sight {
    skin: Skin,
    hard: Option<Skin>,
    cuts: Vec<CutPlane>,
}

impl Sight {
    /// Lines of sight through `surfaces`. The scan ends at the planes `cuts`. Surfaces for which `is_hard` is true hide
    /// the target. `None` if the surfaces have no triangle.
    pub fn new(surfaces: &[Made], cuts: Vec<CutPlane>, is_hard: impl Fn(&Made) -> bool) -> Option<Self> {
        let outer = surfaces.iter().flat_map(|s| s.mesh.corners_mm());
        let skin = Skin::of_triangles(outer).ok()?;
        let hard = Skin::of_triangles(surfaces.iter().filter(|s| is_hard(s)).flat_map(|s| s.mesh.corners_mm())).ok();
        Some(Self { skin, hard, cuts })
    }

    /// The outer surface of the patient.
    pub fn skin(&self) -> &Skin {
        &self.skin
    }

    /// Outermost point of bone or gas on the line from `from_mm` along `direction`.
    pub fn hard_exit(&self, from_mm: DVec3, direction: DVec3) -> Option<DVec3> {
        self.hard.as_ref()?.exit(from_mm, direction)
    }

    /// Point where the line from `from_mm` along `direction` leaves the skin; `None` if it leaves the body where the
    /// scan ends.
    pub fn contact(&self, from_mm: DVec3, direction: DVec3) -> Option<DVec3> {
        let contact_mm = self.skin.exit(from_mm, direction)?;
        let at_cut = |cut: &CutPlane| (contact_mm - cut.point_mm).dot(cut.normal).abs() < CUT_MM;
        (!self.cuts.iter().any(at_cut)).then_some(contact_mm)
    }

    /// Share of lines of sight that bone or gas blocks, 0..=1. The lines run from a probe at `contact_mm` to points
    /// within `centre_mm` ± `half_width_mm`.
    pub fn hidden(&self, contact_mm: DVec3, centre_mm: DVec3, half_width_mm: DVec3) -> f64 {
        let Some(hard) = &self.hard else { return 0.0 };
        let along_face = half_width_mm.normalize_or_zero();
        let face_mm = FACE_MM.min(2.0 * half_width_mm.length());
        let is_hidden = |&(share, aside_mm): &(f64, f64)| {
            let point = centre_mm + half_width_mm * share;
            let way = contact_mm + along_face * aside_mm - point;
            let length_mm = way.length();
            let along = way / length_mm.max(1e-9);
            // `exit` finds the outermost hard surface on the line; beyond the contact, there are no surfaces.
            let hit = hard.exit(point, along);
            hit.is_some_and(|hit| (ENDS_MM..length_mm - ENDS_MM).contains(&hit.distance(point)))
        };
        let lines = || ACROSS.iter().flat_map(|&share| FACE.iter().map(move |&aside| (share, aside * face_mm)));
        lines().filter(is_hidden).count() as f64 / lines().count() as f64
    }
}
