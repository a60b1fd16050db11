//! Order of the looks of a compounded picture while the probe moves.
//!
//! A picture is the mean of looks that were made one after another. Those from poses that the probe has left would smear it.
//! They are left out, and while the probe moves fast only the inner angles are made, which show more of the sector.

use glam::DVec3;

use crate::pose::Pose;

/// Place of a picture: the centre of the face, and the point of the central scanline at full depth, mm.
pub(super) type Place = [DVec3; 2];

/// Place of a picture at `pose`.
pub(super) fn place(pose: &Pose, depth_mm: f64) -> Place {
    [pose.position_mm, pose.position_mm + depth_mm * pose.transform_vector(DVec3::Z)]
}

/// Largest displacement between two places, mm.
pub(super) fn moved_mm(a: &Place, b: &Place) -> f64 {
    a[0].distance(b[0]).max(a[1].distance(b[1]))
}

/// Chooses the look of each frame.
#[derive(Debug, Default)]
pub(super) struct LookOrder {
    /// Number of the frame that each look was last asked for in, from 1; 0: never.
    asked: Vec<u64>,
    frames: u64,
    last: Option<Place>,
}

impl LookOrder {
    /// Begins anew with `looks` looks.
    pub(super) fn restart(&mut self, looks: usize) {
        self.asked.clear();
        self.asked.resize(looks, 0);
        (self.frames, self.last) = (0, None);
    }

    /// The look of a frame at `place`: of those that the probe's speed leaves time for within `limit_mm`, the one that was
    /// made the longest ago. The first is straight: it alone shows the whole sector.
    pub(super) fn next(&mut self, place: Place, limit_mm: f64) -> usize {
        let looks = self.asked.len();
        let straight = looks.saturating_sub(1);
        let step_mm = self.last.map_or(0.0, |last| moved_mm(&last, &place));
        self.last = Some(place);
        self.frames += 1;
        // An odd number: the straight look, and pairs from the inside outward.
        let in_time = if step_mm > 0.0 { (limit_mm / step_mm).min(1e6) as usize } else { looks };
        let most = (in_time.clamp(1, looks.max(1)) - 1) / 2 * 2 + 1;
        let inner = looks.saturating_sub(most)..looks;
        let first = self.asked.iter().all(|&asked| asked == 0);
        let look = if first { straight } else { inner.min_by_key(|&look| self.asked[look]).unwrap_or(straight) };
        if let Some(asked) = self.asked.get_mut(look) {
            *asked = self.frames;
        }
        look
    }
}

#[cfg(test)]
mod tests {
    use super::*;
    use glam::DQuat;

    fn at(x: f64) -> Place {
        place(&Pose { position_mm: DVec3::X * x, orientation: DQuat::IDENTITY }, 100.0)
    }

    /// Looks of frames that move by `step_mm` each.
    fn looks(count: usize, step_mm: f64, frames: usize) -> Vec<usize> {
        let mut order = LookOrder::default();
        order.restart(count);
        (0..frames).map(|i| order.next(at(step_mm * i as f64), 2.0)).collect()
    }

    #[test]
    fn a_probe_at_rest_gets_all_looks_in_turn_and_begins_with_the_straight_one() {
        assert_eq!(looks(5, 0.0, 11), [4, 0, 1, 2, 3, 4, 0, 1, 2, 3, 4]);
        assert_eq!(looks(1, 0.0, 3), [0, 0, 0]);
        assert_eq!(looks(0, 0.0, 2), [0, 0]);
    }

    #[test]
    fn a_fast_probe_gets_the_inner_looks_alone() {
        // 2 mm are two frames: an odd number is one.
        assert!(looks(9, 1.0, 20).iter().all(|&look| look == 8));
        let three = looks(9, 0.6, 20);
        assert_eq!(three[..7], [8, 6, 7, 8, 6, 7, 8]);
        assert!(looks(9, 0.22, 40)[1..].contains(&0));
        // As it comes to rest, the outer ones return.
        let mut order = LookOrder::default();
        order.restart(9);
        (0..10).for_each(|i| assert_eq!(order.next(at(5.0 * f64::from(i)), 2.0), 8));
        let rest: Vec<usize> = (0..10).map(|_| order.next(at(45.0), 2.0)).collect();
        assert_eq!(rest, [0, 1, 2, 3, 4, 5, 6, 7, 8, 0]);
    }

    #[test]
    fn turning_moves_what_lies_deep() {
        let turned = Pose { position_mm: DVec3::ZERO, orientation: DQuat::from_rotation_y(0.01) };
        let moved = moved_mm(&place(&Pose::IDENTITY, 100.0), &place(&turned, 100.0));
        assert!((moved - 1.0).abs() < 0.01, "{moved}");
    }
}
