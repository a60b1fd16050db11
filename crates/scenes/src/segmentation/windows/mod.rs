//! Acoustic windows of a patient: standard planes placed from the organs, with a probe on the skin.
//!
//! A window has an organ in its centre and a usual direction to the probe. Directions near it are searched for one from
//! which neither bone nor gas hides the organ. Patient frame: LPS, x left, y posterior, z superior, mm.

mod sight;
mod standard;

use glam::{DQuat, DVec3};
use serde::Serialize;

pub use sight::Sight;
pub use standard::{look_at, windows};

use insonify_core::anatomy::planes::View;

/// Rings of directions that are searched about the usual one, and directions in a ring.
const RINGS: usize = 6;
const SPOKES: usize = 16;

/// A place to put a probe.
#[derive(Debug, Clone, Copy, PartialEq)]
pub struct Place {
    /// Point of the skin, mm.
    pub contact_mm: DVec3,
    /// Direction from the target to the probe.
    pub to_probe: DVec3,
    /// Share of the target that bone or gas hides, 0..=1.
    pub hidden: f64,
}

/// Window on the patient: a standard plane and how well it is seen.
#[derive(Debug, Clone, PartialEq, Serialize)]
pub struct WindowRow {
    /// Name of the plane.
    pub name: String,
    /// Title.
    pub title: String,
    /// Depth of its centre below the skin, mm.
    pub depth_mm: f64,
    /// Share that bone or gas hides, 0..=1.
    pub hidden: f64,
}

impl WindowRow {
    /// Row of a plane whose probe is at `place`.
    pub fn new(name: &str, title: &str, centre_mm: DVec3, place: &Place) -> Self {
        let depth_mm = place.contact_mm.distance(centre_mm);
        Self { name: name.to_owned(), title: title.to_owned(), depth_mm, hidden: place.hidden }
    }
}

/// Best place of a probe within `cone_deg` of the usual direction of `view`, for a target of `radius_mm`; `None` if no
/// line from its centre meets skin.
pub(crate) fn best_place(sight: &Sight, view: &View, radius_mm: f64, cone_deg: f64) -> Option<Place> {
    let mut best: Option<(f64, Place)> = None;
    for ring in 0..=RINGS {
        let turn = cone_deg.to_radians() * ring as f64 / RINGS as f64;
        let spokes = if ring == 0 { 1 } else { SPOKES };
        for spoke in 0..spokes {
            let around = std::f64::consts::TAU * spoke as f64 / spokes as f64;
            let axis = DQuat::from_axis_angle(view.to_probe, around) * view.lateral;
            let to_probe = DQuat::from_axis_angle(axis, turn) * view.to_probe;
            let Some(contact_mm) = sight.contact(view.centre_mm, to_probe) else { continue };
            let lateral = view.lateral.reject_from(to_probe).normalize_or_zero();
            let hidden = sight.hidden(contact_mm, view.centre_mm, lateral * radius_mm);
            let depth_mm = contact_mm.distance(view.centre_mm);
            // What is hidden counts most, then how far from the usual direction, then depth.
            let cost = 4.0 * hidden + ring as f64 / RINGS as f64 + depth_mm / 150.0;
            if best.is_none_or(|(least, _)| cost < least) {
                best = Some((cost, Place { contact_mm, to_probe, hidden }));
            }
        }
    }
    best.map(|(_, place)| place)
}
