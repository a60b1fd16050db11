//! A session for a first look at a scene: the probe slides across a view's plane and back.

use glam::DVec3;

use super::session::{RATE_HZ, Session};
use super::{ExamError, on_skin};
use crate::anatomy::Skin;
use crate::anatomy::planes::View;
use crate::pose::Pose;

/// Depth of the face in the skin, mm.
const PRESS_MM: f64 = 4.0;
/// Largest step of the contact point in the search for the slide's ends, mm. A longer step would reach another side
/// of the body.
const STEP_MM: f64 = 2.0;
const JUMP_MM: f64 = 12.0;

/// A session of `duration_s` in which the probe slides along the normal of `view` and back. It reaches up to
/// `reach_mm` in both directions, as far as there is skin. Deterministic.
///
/// # Errors
/// There is no skin above the view's centre.
pub fn slide(view: &View, skin: &Skin, reach_mm: f64, duration_s: f64) -> Result<Session, ExamError> {
    let orientation = Pose::looking(DVec3::ZERO, -view.to_probe, view.lateral).orientation;
    let end = |side: f64| {
        let contact = |way_mm: f64| skin.exit(view.centre_mm + view.normal * (side * way_mm), view.to_probe);
        let (mut way_mm, mut last) = (0.0, contact(0.0));
        while way_mm + STEP_MM <= reach_mm {
            let next = contact(way_mm + STEP_MM);
            match (last, next) {
                (Some(a), Some(b)) if a.distance(b) < JUMP_MM => (way_mm, last) = (way_mm + STEP_MM, next),
                _ => break,
            }
        }
        way_mm
    };
    let (ahead, behind) = (end(1.0), end(-1.0));
    let count = (duration_s.max(1.0) * f64::from(RATE_HZ)) as u64;
    let poses = (0..count).map(|n| {
        let phase = std::f64::consts::TAU * n as f64 / count as f64;
        let shift_mm = phase.sin() * if phase.sin() > 0.0 { ahead } else { behind };
        let time_us = n * 1_000_000 / u64::from(RATE_HZ);
        let target = view.centre_mm + view.normal * shift_mm;
        on_skin(time_us, (target, orientation), DVec3::ZERO, PRESS_MM, |from, along| skin.exit(from, along))
    });
    Ok(Session { poses: poses.collect::<Result<_, _>>()?, events: Vec::new() })
}

#[cfg(test)]
mod tests {
    use glam::Vec3;

    use super::*;
    use crate::anatomy::analytic::sphere;

    #[test]
    fn the_probe_stays_on_the_skin_and_comes_back() {
        let skin = Skin::of_triangles(sphere(Vec3::ZERO, 60.0, 5).corners_mm().collect::<Vec<_>>()).unwrap();
        let view = View::new("", DVec3::ZERO, DVec3::X, DVec3::NEG_Y);
        let session = slide(&view, &skin, 100.0, 10.0).unwrap();
        assert_eq!(session.poses.len(), 600);
        let along: Vec<f64> = session.poses.iter().map(|p| p.pose.position_mm.z).collect();
        let most = along.iter().copied().fold(0.0, f64::max);
        assert!((30.0..60.0).contains(&most) && along[0].abs() < 1e-9 && along[599].abs() < 1.0, "{most}");
        for timed in &session.poses {
            assert!(skin.press_mm(&timed.pose).is_some_and(|mm| (mm - PRESS_MM).abs() < 0.5));
        }
        let away = View { centre_mm: DVec3::X * 500.0, ..view };
        assert!(matches!(slide(&away, &skin, 50.0, 5.0), Err(ExamError::NoSkin { .. })));
    }
}
