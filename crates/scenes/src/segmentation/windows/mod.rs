//! Acoustic windows of a patient: standard planes through the organs, with a probe on the skin.
//!
//! A window has an organ at its centre and a usual direction to the probe. A search around the usual direction finds
//! a direction in which bone and gas hide little of the organ. Patient frame: LPS, x left, y posterior, z superior, mm.

mod contact;
mod sight;
mod standard;

use glam::{DQuat, DVec3};
use serde::Serialize;

pub use contact::Touch;
use contact::touch;
pub use sight::Sight;
pub use standard::{look_at, windows};

use super::probe_choice::{ProbeChoice, ProbeKind};
use insonify_core::anatomy::planes::View;

/// Distance from a window's centre to the bottom of the image, mm.
pub(super) const BELOW_MM: f64 = 25.0;

/// Number of rings of search directions around the usual direction, and number of directions per ring.
const RINGS: usize = 6;
const SPOKES: usize = 16;

/// Position of a probe on the skin, and how much of the target it sees.
#[derive(Debug, Clone, Copy, PartialEq)]
pub struct ProbeSite {
    /// Point of contact on the skin, mm.
    pub contact_mm: DVec3,
    /// Unit direction from the target to the probe.
    pub to_probe: DVec3,
    /// Share of the target that bone or gas hides, 0..=1.
    pub hidden: f64,
    /// How the probe's face lies on the skin.
    pub touch: Touch,
}

/// Row of a table of windows: a standard plane on the patient, and how much of its target is hidden.
#[derive(Debug, Clone, PartialEq, Serialize)]
pub struct WindowRow {
    /// Name of the standard plane.
    pub name: String,
    /// Title of the standard plane.
    pub title: String,
    /// Depth of the plane's centre below the skin, mm.
    pub depth_mm: f64,
    /// Share of the target that bone or gas hides, 0..=1.
    pub hidden: f64,
    /// Share of the probe's face that touches skin, 0..=1.
    pub touching: f64,
}

impl WindowRow {
    /// Row of a plane whose probe is at `site`.
    pub fn new(name: &str, title: &str, centre_mm: DVec3, site: &ProbeSite) -> Self {
        let depth_mm = site.contact_mm.distance(centre_mm);
        let (hidden, touching) = (site.hidden, site.touch.share);
        Self { name: name.to_owned(), title: title.to_owned(), depth_mm, hidden, touching }
    }

    /// Shadow and missing contact in words, for the end of a sentence; empty without either.
    pub fn faults(&self) -> String {
        let mut words = String::new();
        if self.hidden > 0.0 {
            words += &format!(", {:.0} % shadowed by bone or gas", 100.0 * self.hidden);
        }
        if self.touching < 1.0 {
            words += &format!(", {:.0} % of the face without contact", 100.0 * (1.0 - self.touching));
        }
        words
    }
}

/// Best position of a probe of `kind`, or of the depth's kind, within `cone_deg` of the usual direction of `view`, for a target
/// of `radius_mm`, with its cost. `None` if no line from the target's centre reaches skin.
pub(crate) fn best_site(
    sight: &Sight,
    view: &View,
    kind: Option<ProbeKind>,
    radius_mm: f64,
    cone_deg: f64,
) -> Option<(f64, ProbeSite)> {
    let mut best: Option<(f64, ProbeSite)> = None;
    let rings = if cone_deg > 0.0 { RINGS } else { 0 };
    for ring in 0..=rings {
        let turn = cone_deg.to_radians() * ring as f64 / RINGS as f64;
        let spokes = if ring == 0 { 1 } else { SPOKES };
        for spoke in 0..spokes {
            let around = std::f64::consts::TAU * spoke as f64 / spokes as f64;
            let axis = DQuat::from_axis_angle(view.to_probe, around) * view.lateral;
            let to_probe = DQuat::from_axis_angle(axis, turn) * view.to_probe;
            let Some(contact_mm) = sight.contact(view.centre_mm, to_probe) else { continue };
            let lateral = view.lateral.reject_from(to_probe).normalize_or(to_probe.any_orthonormal_vector());
            let hidden = sight.hidden(contact_mm, view.centre_mm, lateral * radius_mm);
            let depth_mm = contact_mm.distance(view.centre_mm);
            let face = ProbeChoice::of_depth(kind, depth_mm + BELOW_MM).face();
            let touch = touch(&face, sight, contact_mm, to_probe, lateral);
            // The hidden share and the face without contact count most, then the angle to the usual direction, then the
            // press and the depth.
            let away = ring as f64 / RINGS as f64;
            let cost = 4.0 * hidden + 4.0 * (1.0 - touch.share) + away + touch.press_mm / 30.0 + depth_mm / 150.0;
            if best.is_none_or(|(least, _)| cost < least) {
                best = Some((cost, ProbeSite { contact_mm, to_probe, hidden, touch }));
            }
        }
    }
    best
}
