//! Order of the steering angles of a compounded picture while the probe moves.
//!
//! A picture is the mean of pictures of several steering angles, made one after another. Those from poses that the probe has
//! left would smear it. They are left out. While the probe moves fast only the inner angles are made, which show more of
//! the sector.

use glam::DVec3;

use insonify_core::pose::Pose;
use insonify_core::settings::LookSettings;

/// Distance across the slice at which a registered picture weighs about 1/e, mm. Speckle has decorrelated by then (its power
/// by half at 0.5 mm, at all depths); structures have not.
pub(super) const ACROSS_SIGMA_MM: f64 = 1.2;
/// Distance across the slice within which registered pictures count, mm: beyond it they weigh next to nothing.
const ACROSS_MM: f64 = 2.0 * ACROSS_SIGMA_MM;
/// Motion within the slice that registered pictures may span, in parts of the reach. They are brought to the present pose,
/// but a steered picture doesn't show what has just come into the sector.
const WITHIN: f64 = 3.0;

/// Place of a picture.
#[derive(Debug, Clone, Copy, PartialEq)]
pub(super) struct Place {
    /// Pose relative to the scene.
    pub(super) pose: Pose,
    /// Point of the central scanline at full depth, mm.
    deep_mm: DVec3,
    /// Whether any of the face touches the body.
    coupled: bool,
}

impl Place {
    /// Place of a picture of `depth_mm` at `pose`.
    pub(super) fn new(pose: Pose, depth_mm: f64, coupled: bool) -> Self {
        Self { pose, deep_mm: pose.position_mm + depth_mm * pose.transform_vector(DVec3::Z), coupled }
    }

    /// Displacements from another place, of the face's centre and in the depth, mm.
    fn moved_mm(&self, other: &Self) -> [DVec3; 2] {
        [self.pose.position_mm - other.pose.position_mm, self.deep_mm - other.deep_mm]
    }

    /// Largest displacement from another place, mm.
    fn distance_mm(&self, other: &Self) -> f64 {
        let [face, deep] = self.moved_mm(other);
        face.length().max(deep.length())
    }

    /// Largest distance of another place from this one's slice, mm.
    fn across_mm(&self, other: &Self) -> f64 {
        let normal = self.pose.transform_vector(DVec3::Y);
        let [face, deep] = self.moved_mm(other);
        face.dot(normal).abs().max(deep.dot(normal).abs())
    }
}

/// Selection of the pictures in a live mean.
#[derive(Debug, Clone, Copy, PartialEq)]
pub(super) struct Rules {
    /// Whether pictures are brought to the present pose.
    pub(super) registration: bool,
    /// Displacement from which pictures are left out, mm; of registered ones, across the slice.
    pub(super) reach_mm: f64,
}

impl Rules {
    /// Rules of a station's look.
    pub(super) fn of(look: &LookSettings) -> Self {
        Self { registration: look.registration, reach_mm: look.reach_mm }
    }

    /// Whether a picture that was made at `kept` is part of a picture at `place`.
    pub(super) fn keep(&self, kept: &Place, place: &Place) -> bool {
        let moved_mm = if self.registration { place.across_mm(kept) } else { place.distance_mm(kept) };
        kept.coupled == place.coupled && moved_mm <= self.reach_mm
    }

    /// Number of frames that a picture may span with such steps.
    fn frames(&self, last: &Place, place: &Place) -> f64 {
        let moved_mm = place.distance_mm(last);
        if !self.registration {
            return self.reach_mm / moved_mm;
        }
        (WITHIN * self.reach_mm / moved_mm).min(self.reach_mm.min(ACROSS_MM) / place.across_mm(last))
    }
}

/// Chooses the angle of each frame.
#[derive(Debug, Default)]
pub(super) struct AngleOrder {
    /// Number of the frame that each angle was last asked for in, from 1; 0: never.
    asked: Vec<u64>,
    frames: u64,
    last: Option<Place>,
}

impl AngleOrder {
    /// Begins anew with `angles` angles.
    pub(super) fn restart(&mut self, angles: usize) {
        self.asked.clear();
        self.asked.resize(angles, 0);
        (self.frames, self.last) = (0, None);
    }

    /// The angle of a frame at `place`: of those that the probe's speed leaves time for, the one that was made the longest ago.
    /// The first, and the first with or without contact, is straight: it alone shows the whole sector.
    pub(super) fn next(&mut self, place: Place, rules: Rules) -> usize {
        let angles = self.asked.len();
        let straight = angles.saturating_sub(1);
        if self.last.is_some_and(|last| last.coupled != place.coupled) {
            self.restart(angles);
        }
        let frames = self.last.map_or(f64::INFINITY, |last| rules.frames(&last, &place));
        self.last = Some(place);
        self.frames += 1;
        // An odd number: the straight angle, and pairs from the inside outward. A probe at rest gives infinity, or NaN.
        let in_time = if frames < angles as f64 { frames as usize } else { angles };
        let most = (in_time.clamp(1, angles.max(1)) - 1) / 2 * 2 + 1;
        let inner = angles.saturating_sub(most)..angles;
        let first = self.asked.iter().all(|&asked| asked == 0);
        let angle = if first { straight } else { inner.min_by_key(|&angle| self.asked[angle]).unwrap_or(straight) };
        if let Some(asked) = self.asked.get_mut(angle) {
            *asked = self.frames;
        }
        angle
    }
}

#[cfg(test)]
mod tests {
    use super::*;
    use glam::DQuat;

    const RULES: Rules = Rules { registration: false, reach_mm: 2.0 };

    fn at(x: f64) -> Place {
        Place::new(Pose { position_mm: DVec3::X * x, orientation: DQuat::IDENTITY }, 100.0, true)
    }

    /// Angles of frames that move by `step_mm` each.
    fn angles(count: usize, step_mm: f64, frames: usize) -> Vec<usize> {
        let mut order = AngleOrder::default();
        order.restart(count);
        (0..frames).map(|i| order.next(at(step_mm * i as f64), RULES)).collect()
    }

    #[test]
    fn a_probe_at_rest_gets_all_angles_in_turn_and_begins_with_the_straight_one() {
        assert_eq!(angles(5, 0.0, 11), [4, 0, 1, 2, 3, 4, 0, 1, 2, 3, 4]);
        assert_eq!(angles(1, 0.0, 3), [0, 0, 0]);
        assert_eq!(angles(0, 0.0, 2), [0, 0]);
    }

    #[test]
    fn a_fast_probe_gets_the_inner_angles_alone() {
        // 2 mm are two frames: an odd number is one.
        assert!(angles(9, 1.0, 20).iter().all(|&angle| angle == 8));
        let three = angles(9, 0.6, 20);
        assert_eq!(three[..7], [8, 6, 7, 8, 6, 7, 8]);
        assert!(angles(9, 0.22, 40)[1..].contains(&0));
        // As it comes to rest, the outer ones return.
        let mut order = AngleOrder::default();
        order.restart(9);
        (0..10).for_each(|i| assert_eq!(order.next(at(5.0 * f64::from(i)), RULES), 8));
        let rest: Vec<usize> = (0..10).map(|_| order.next(at(45.0), RULES)).collect();
        assert_eq!(rest, [0, 1, 2, 3, 4, 5, 6, 7, 8, 0]);
    }

    #[test]
    fn turning_moves_what_lies_deep() {
        let turned = Pose { position_mm: DVec3::ZERO, orientation: DQuat::from_rotation_y(0.01) };
        let place = |pose| Place::new(pose, 100.0, true);
        let moved = place(Pose::IDENTITY).distance_mm(&place(turned));
        assert!((moved - 1.0).abs() < 0.01, "{moved}");
    }
}
