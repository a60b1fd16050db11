//! Contact of a probe's face with the skin.

use serde::Serialize;

use super::Probe;
use super::placement::{Misplacement, misplacement};
use crate::anatomy::Skin;
use crate::pose::Pose;
use crate::settings::ContactSettings;

/// Constant k in the one-way amplitude loss of a gap of e mm beyond the film of gel: k·e²/(1 + e), nepers. The loss
/// begins quadratically, because the meniscus of the gel bridges about half a millimetre.
pub const GAP_NP_MM: f64 = 4.0;
/// Width of the gap beyond the film of gel from which on nothing is coupled, mm; the loss there is 28 nepers.
pub const GAP_MAX_MM: f64 = 8.0;

/// Number of positions on the face at which contact is measured.
const POSITIONS: u32 = 33;

/// Contact of a probe's face with the skin.
#[derive(Debug, Clone, Copy, PartialEq, Serialize)]
pub struct Contact {
    /// Coupled fraction of the face, 0..=1: mean two-way amplitude over positions on the face.
    pub part: f64,
    /// Depth of the face's centre below the skin along the probe's axis, mm; negative for a gap. `None` if the skin is
    /// more than 30 mm away. It refers to the tracked pose, before [`shift_mm`](Self::shift_mm).
    pub press_mm: Option<f64>,
    /// Distance by which the pose was moved along the probe's axis to bring the face onto the skin, within the
    /// tolerance, mm; positive into the body.
    pub shift_mm: f64,
    /// Impossible placement of the tracked probe; `None` if a hand can hold the probe there.
    #[serde(skip_serializing_if = "Option::is_none")]
    pub misplaced: Option<Misplacement>,
}

impl Contact {
    /// Whether any part of the face is coupled to the body.
    pub fn coupled(&self) -> bool {
        self.part > 0.0
    }
}

/// Contact of `probe` at `pose` with `skin`, and the pose to render from.
///
/// A probe that hovers over the skin, or is sunk into it, by up to `contact.tolerance_mm` is put on the skin, along its
/// own axis. Farther away, it is moved by the tolerance, so that the rendered pose never jumps.
pub fn touch(skin: &Skin, probe: &Probe, pose: &Pose, contact: &ContactSettings) -> (Pose, Contact) {
    let press_mm = skin.press_mm(pose);
    let tolerance_mm = contact.tolerance_mm;
    let shift_mm = press_mm.map_or(0.0, |press_mm| -press_mm.clamp(-tolerance_mm, tolerance_mm));
    let into_body = pose.orientation * glam::DVec3::Z;
    let placed = Pose { position_mm: pose.position_mm + shift_mm * into_body, ..*pose };
    let fractions = (0..POSITIONS).map(|i| (f64::from(i) + 0.5) / f64::from(POSITIONS));
    let coupled: f64 = fractions.map(|fraction| coupling_at(skin, probe, &placed, fraction, contact.gel_mm)).sum();
    (placed, Contact { part: coupled / f64::from(POSITIONS), press_mm, shift_mm, misplaced: misplacement(skin, pose) })
}

/// Two-way amplitude coupling, 0..=1, at the position on the face given by a fraction of its width.
fn coupling_at(skin: &Skin, probe: &Probe, pose: &Pose, fraction: f64, gel_mm: f64) -> f64 {
    let (origin_mm, direction) = probe.ray(probe.lateral_coordinate(fraction));
    let there = Pose {
        position_mm: pose.transform_point(origin_mm),
        orientation: pose.orientation * glam::DQuat::from_rotation_arc(glam::DVec3::Z, direction),
    };
    // Depth of the skin below the foremost point of the face: skin yields to the curvature of the face.
    let skin_mm = skin.press_mm(&there).map(|press_mm| origin_mm.z - press_mm * direction.z);
    skin_mm.map_or(0.0, |skin_mm| coupling(skin_mm - gel_mm).powi(2))
}

/// One-way amplitude that passes a gap of `gap_mm` beyond the film of gel, 0..=1.
pub fn coupling(gap_mm: f64) -> f64 {
    let gap_mm = gap_mm.max(0.0);
    if gap_mm >= GAP_MAX_MM { 0.0 } else { (-GAP_NP_MM * gap_mm * gap_mm / (1.0 + gap_mm)).exp() }
}

#[cfg(test)]
mod tests {
    use glam::{DVec3, Vec3};

    use super::*;
    use crate::anatomy::{TissueTable, analytic};

    /// A flat body below z = 0.
    fn skin() -> Skin {
        let mesh = analytic::cuboid(Vec3::new(-100.0, -100.0, -200.0), Vec3::new(100.0, 100.0, 0.0));
        let part = analytic::Part { name: "skin", tissue: "skin", priority: 1, mesh };
        Skin::of_scene(&analytic::scene(vec![part], &TissueTable::builtin().unwrap(), "gel").unwrap()).unwrap()
    }

    fn at(height_mm: f64, tilt_deg: f64) -> Pose {
        let tilt = tilt_deg.to_radians();
        let down = DVec3::new(tilt.sin(), 0.0, -tilt.cos());
        Pose::looking(DVec3::new(0.3, 0.2, height_mm), down, DVec3::Y.cross(down))
    }

    #[test]
    fn gel_couples_and_air_does_not() {
        let (skin, probe, settings) = (skin(), Probe::default(), ContactSettings::default());
        let part = |height_mm: f64| touch(&skin, &probe, &at(height_mm, 0.0), &settings).1.part;
        for height_mm in [-10.0, 0.0, 2.0] {
            assert!((part(height_mm) - 1.0).abs() < 1e-6, "{height_mm} mm: {}", part(height_mm));
        }
        assert!(part(5.0) < 0.01 && part(40.0) == 0.0);
        let (pose, contact) = touch(&skin, &probe, &at(5.0, 0.0), &settings);
        assert_eq!(pose, at(5.0, 0.0));
        assert!((contact.press_mm.unwrap() + 5.0).abs() < 1e-2 && contact.shift_mm == 0.0);
    }

    #[test]
    fn a_tilted_probe_touches_with_one_side() {
        let contact = touch(&skin(), &Probe::default(), &at(0.0, 15.0), &ContactSettings::default()).1;
        // The plane at the foremost point of the face rises by sin 15° per mm. The film reaches 11.6 mm beyond the
        // middle of a face 46 mm wide.
        assert!((0.65..0.85).contains(&contact.part), "{}", contact.part);
    }

    #[test]
    fn a_tolerance_puts_the_probe_on_the_skin_without_a_jump() {
        let (skin, probe) = (skin(), Probe::default());
        let settings = ContactSettings { tolerance_mm: 4.0, ..ContactSettings::default() };
        let mut last = f64::NAN;
        for step in -100..=100 {
            let height_mm = 0.1 * f64::from(step);
            let (pose, contact) = touch(&skin, &probe, &at(height_mm, 0.0), &settings);
            let placed_mm = pose.position_mm.z;
            assert!((placed_mm - (height_mm - contact.shift_mm)).abs() < 1e-9);
            if height_mm.abs() <= 4.0 {
                assert!(placed_mm.abs() < 1e-2, "{height_mm}: {placed_mm}");
                assert!((contact.part - 1.0).abs() < 1e-6);
            }
            assert!(last.is_nan() || (placed_mm - last).abs() < 0.11, "{height_mm}");
            last = placed_mm;
        }
        assert!((touch(&skin, &probe, &at(10.0, 0.0), &settings).0.position_mm.z - 6.0).abs() < 1e-2);
    }
}
