//! Line of the fetal spine and the frames along it.

use glam::Vec3;

use insonify_core::anatomy::sdf::{Isometry, catmull_rom};

/// Number of vertebrae from C1 to S5. A *level* counts vertebrae from 0 at the cranial side of C1: level 7 is the top
/// of T1, 19 the top of L1, 24 the top of S1.
pub(crate) const VERTEBRAE: usize = 29;

/// Number of vertebrae, and relative height of a vertebra with its disc: cervical, thoracic, lumbar and sacral spine.
const HEIGHTS: [(usize, f32); 4] = [(7, 2.9), (12, 3.95), (5, 4.7), (5, 3.5)];

/// Points (y, z) of the spine's midsagittal curve as drawn, from C1 to S5, mm at 22 weeks.
const KNOTS: [(f32, f32); 11] = [
    (36.9, -17.5),
    (29.5, -24.0),
    (21.0, -29.0),
    (10.0, -33.5),
    (-2.0, -36.8),
    (-14.0, -38.0),
    (-26.0, -37.4),
    (-38.0, -34.0),
    (-47.5, -29.0),
    (-55.0, -22.5),
    (-61.5, -15.0),
];
const STEPS: usize = 12;
/// Index of the point that stays fixed while the spine is bent: `KNOTS[5]`.
const FIXED: usize = 5 * STEPS;

/// Spine in the fetal frame.
#[derive(Debug, Clone)]
pub(super) struct Spine {
    /// Centres of the vertebral bodies, finely spaced, cranial to caudal, mm.
    points: Vec<Vec3>,
    /// Level at each point, in vertebrae from C1: see [`VERTEBRAE`].
    levels: Vec<f32>,
}

impl Spine {
    /// Spine as drawn: half curled, at 22 weeks.
    pub(super) fn drawn() -> Self {
        let knots = KNOTS.map(|(y, z)| (Vec3::new(0.0, y, z), 0.0));
        let points: Vec<Vec3> = catmull_rom(&knots, STEPS).into_iter().map(|(p, _)| p).collect();
        let levels = levels_along(&points);
        Self { points, levels }
    }

    /// Spine whose angles to the y axis are multiplied by `bend` and whose size is multiplied by `scale`.
    pub(super) fn bent(&self, bend: f32, scale: f32) -> Self {
        let step = |from: Vec3, to: Vec3| {
            let d = to - from;
            let angle = bend * d.z.atan2(-d.y);
            d.length() * Vec3::new(0.0, -angle.cos(), angle.sin())
        };
        let mut points = self.points.clone();
        for i in FIXED + 1..points.len() {
            points[i] = points[i - 1] + step(self.points[i - 1], self.points[i]);
        }
        for i in (0..FIXED).rev() {
            points[i] = points[i + 1] - step(self.points[i], self.points[i + 1]);
        }
        Self { points: points.into_iter().map(|p| p * scale).collect(), levels: self.levels.clone() }
    }

    pub(super) fn length_mm(&self) -> f32 {
        self.points.windows(2).map(|p| p[0].distance(p[1])).sum()
    }

    /// Isometry from the frame of the vertebra at `level` to the fetal frame, mm: y cranial along the spine, z ventral.
    pub(super) fn vertebra(&self, level: f32) -> Isometry {
        let last = self.points.len() - 1;
        let i = self.levels.partition_point(|&l| l < level).clamp(1, last);
        let (a, b) = (self.levels[i - 1], self.levels[i]);
        let t = ((level - a) / (b - a)).clamp(0.0, 1.0);
        let origin = self.points[i - 1].lerp(self.points[i], t);
        // The tangent is taken over several points, so that frames rotate evenly.
        let cranial = self.points[i.saturating_sub(4)] - self.points[(i + 3).min(last)];
        Isometry::from_axes(origin, cranial, Vec3::X.cross(cranial))
    }
}

/// Level at each point of `spine`, from C1 to S5, by the vertebrae's relative heights.
fn levels_along(spine: &[Vec3]) -> Vec<f32> {
    let mut borders = vec![0.0f32];
    for (count, height) in HEIGHTS {
        for _ in 0..count {
            borders.push(borders[borders.len() - 1] + height);
        }
    }
    let mut lengths = vec![0.0f32];
    for pair in spine.windows(2) {
        lengths.push(lengths[lengths.len() - 1] + pair[0].distance(pair[1]));
    }
    let scale = borders[VERTEBRAE] / lengths[lengths.len() - 1];
    lengths
        .iter()
        .map(|&length| {
            let at = length * scale;
            let i = borders.partition_point(|&b| b < at).clamp(1, VERTEBRAE);
            (i - 1) as f32 + (at - borders[i - 1]) / (borders[i] - borders[i - 1])
        })
        .collect()
}

#[cfg(test)]
mod tests {
    use super::*;

    #[test]
    fn bending_keeps_length_and_the_drawing() {
        let drawn = Spine::drawn();
        assert!((100.0..125.0).contains(&drawn.length_mm()), "{} mm", drawn.length_mm());
        let same = drawn.bent(1.0, 1.0);
        assert!(drawn.points.iter().zip(&same.points).all(|(a, b)| a.distance(*b) < 1e-3));
        let curled = drawn.bent(1.3, 2.0);
        assert!((curled.length_mm() / drawn.length_mm() - 2.0).abs() < 1e-3);
        let ends = |s: &Spine| s.points[0].distance(s.points[s.points.len() - 1]) / s.length_mm();
        assert!(ends(&curled) < ends(&drawn) - 0.02);
    }
}
