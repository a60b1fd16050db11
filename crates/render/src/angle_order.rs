//! Order in which the steering angles of a compounded picture are rendered while the probe moves.
//!
//! A compounded picture is the mean of pictures of several steering angles, made one after another. Pictures from poses
//! that the probe has left would smear the mean, so they are excluded. While the probe moves fast, only the inner
//! angles are rendered, which show more of the sector.

use glam::DVec3;

use insonify_core::pose::Pose;
use insonify_core::settings::LookSettings;

/// Distance across the slice at which a registered picture weighs about 1/e, mm. Speckle has decorrelated at that
/// distance (its power by half at 0.5 mm, at all depths); structures have not.
pub(super) const ACROSS_SIGMA_MM: f64 = 1.2;
/// Largest distance across the slice at which registered pictures are averaged, mm: farther pictures weigh almost 0.
const ACROSS_MM: f64 = 2.0 * ACROSS_SIGMA_MM;
/// Largest motion within the slice between registered pictures, as a multiple of `look.reach_mm`. Registration moves
/// pictures to the present pose, but a steered picture doesn't show tissue that has just entered the sector.
const WITHIN: f64 = 3.0;

/// Pose at which a picture was made, and its contact.
#[derive(Debug, Clone, Copy, PartialEq)]
pub(super) struct Place {
    /// Pose relative to the scene.
    pub(super) pose: Pose,
    /// Point of the central scanline at full depth, mm.
    deep_mm: DVec3,
    /// Whether any part of the face is coupled to the body.
    coupled: bool,
}

impl Place {
    /// Position of a picture made at `pose`. `depth_mm` is the depth of the image.
    pub(super) fn new(pose: Pose, depth_mm: f64, coupled: bool) -> Self {
        Self { pose, deep_mm: pose.position_mm + depth_mm * pose.transform_vector(DVec3::Z), coupled }
    }

    /// Displacements of the face's centre and of the central scanline's deepest point since `other`, mm.
    fn moved_mm(&self, other: &Self) -> [DVec3; 2] {
        [self.pose.position_mm - other.pose.position_mm, self.deep_mm - other.deep_mm]
    }

    /// Larger of the two displacements since `other`, mm.
    fn distance_mm(&self, other: &Self) -> f64 {
        let [face, deep] = self.moved_mm(other);
        face.length().max(deep.length())
    }

    /// Larger of the two displacements since `other` along the normal of this slice, mm.
    fn across_mm(&self, other: &Self) -> f64 {
        let normal = self.pose.transform_vector(DVec3::Y);
        let [face, deep] = self.moved_mm(other);
        face.dot(normal).abs().max(deep.dot(normal).abs())
    }
}

/// Rules that select the pictures of a live mean.
#[derive(Debug, Clone, Copy, PartialEq)]
pub(super) struct Rules {
    /// Whether pictures are resampled at the present pose before they are averaged.
    pub(super) registration: bool,
    /// Largest displacement of an included picture, mm; with registration, only the part across the slice counts.
    pub(super) reach_mm: f64,
}

impl Rules {
    /// Rules from the settings `look`.
    pub(super) fn of(look: &LookSettings) -> Self {
        Self { registration: look.registration, reach_mm: look.reach_mm }
    }

    /// Whether the mean at `place` includes a picture made at `kept`.
    pub(super) fn keep(&self, kept: &Place, place: &Place) -> bool {
        let moved_mm = if self.registration { place.across_mm(kept) } else { place.distance_mm(kept) };
        kept.coupled == place.coupled && moved_mm <= self.reach_mm
    }

    /// Number of frames that one mean may include if each frame moves the probe as far as from `last` to `place`.
    fn frames(&self, last: &Place, place: &Place) -> f64 {
        let moved_mm = place.distance_mm(last);
        if !self.registration {
            return self.reach_mm / moved_mm;
        }
        (WITHIN * self.reach_mm / moved_mm).min(self.reach_mm.min(ACROSS_MM) / place.across_mm(last))
    }
}

/// Chooses the steering angle of each live frame.
#[derive(Debug, Default)]
pub(super) struct AngleOrder {
    /// For each angle, the number of the latest frame that rendered it, counted from 1; 0 if none did.
    asked: Vec<u64>,
    frames: u64,
    last: Option<Place>,
}

impl AngleOrder {
    /// Starts over with `angles` angles, none of them rendered.
    pub(super) fn restart(&mut self, angles: usize) {
        self.asked.clear();
        self.asked.resize(angles, 0);
        (self.frames, self.last) = (0, None);
    }

    /// Index of the steering angle for a frame at `place`. It is the angle rendered longest ago, among the angles that
    /// the probe's speed leaves time for.
    ///
    /// The first frame, and the first after contact is made or lost, gets the straight angle: it alone shows the whole
    /// sector.
    pub(super) fn next(&mut self, place: Place, rules: Rules) -> usize {
        let angles = self.asked.len();
        let straight = angles.saturating_sub(1);
        if self.last.is_some_and(|last| last.coupled != place.coupled) {
            self.restart(angles);
        }
        let frames = self.last.map_or(f64::INFINITY, |last| rules.frames(&last, &place));
        self.last = Some(place);
        self.frames += 1;
        // An odd number: the straight angle, and pairs from the inside outward. For a probe at rest, `frames` is
        // infinite or NaN.
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

    /// Angles chosen for `frames` frames, each `step_mm` from the previous one.
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
        // A reach of 2 mm allows two frames at this speed; rounded down to an odd number, one.
        assert!(angles(9, 1.0, 20).iter().all(|&angle| angle == 8));
        let three = angles(9, 0.6, 20);
        assert_eq!(three[..7], [8, 6, 7, 8, 6, 7, 8]);
        assert!(angles(9, 0.22, 40)[1..].contains(&0));
        // As the probe comes to rest, the outer angles return.
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
