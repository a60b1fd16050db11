//! Tubes along curves.

use glam::Vec3;

use super::primitives::round_cone_distance;
use super::{Bounds, Solid, union};

/// Number of segments that share a bounding box.
const CHUNK: usize = 6;

/// Tube of straight segments between `points`, each a centre and a radius in mm.
pub fn sweep(points: &[(Vec3, f32)]) -> Solid {
    let ball = |&(c, r): &(Vec3, f32)| Bounds::around(c, Vec3::splat(r));
    // Chunks overlap by one point; each segment is in exactly one chunk.
    union((0..points.len().saturating_sub(1).max(1)).step_by(CHUNK).map(|start| {
        let chunk = points[start..points.len().min(start + CHUNK + 1)].to_vec();
        let bounds = chunk.iter().fold(Bounds::EMPTY, |hull, point| hull.hull(ball(point)));
        Solid::new(bounds, move |p| {
            let segments = chunk.windows(2).map(|pair| (pair[0], pair[1]));
            segments.map(|((a, ra), (b, rb))| round_cone_distance(p, a, b, ra, rb)).fold(f32::MAX, f32::min)
        })
    }))
}

/// Smooth tube through `knots`: [`sweep`] along [`catmull_rom`].
pub fn smooth_sweep(knots: &[(Vec3, f32)], steps: usize) -> Solid {
    sweep(&catmull_rom(knots, steps))
}

/// Smooth curve through `knots` (centre and radius), each interval divided into `steps`: a uniform Catmull-Rom spline
/// with repeated end knots.
pub fn catmull_rom(knots: &[(Vec3, f32)], steps: usize) -> Vec<(Vec3, f32)> {
    let Some(&last) = knots.last() else { return Vec::new() };
    let mut points = Vec::with_capacity(knots.len() * steps + 1);
    for i in 0..knots.len() - 1 {
        let knot = |k: isize| knots[k.clamp(0, knots.len() as isize - 1) as usize];
        let i = i as isize;
        let [a, b, c, d] = [knot(i - 1), knot(i), knot(i + 1), knot(i + 2)];
        for step in 0..steps {
            let t = step as f32 / steps as f32;
            // Weights of the uniform Catmull-Rom spline.
            let w = [
                ((-t + 2.0) * t - 1.0) * t * 0.5,
                ((3.0 * t - 5.0) * t * t + 2.0) * 0.5,
                ((-3.0 * t + 4.0) * t + 1.0) * t * 0.5,
                (t - 1.0) * t * t * 0.5,
            ];
            let centre = a.0 * w[0] + b.0 * w[1] + c.0 * w[2] + d.0 * w[3];
            points.push((centre, a.1 * w[0] + b.1 * w[1] + c.1 * w[2] + d.1 * w[3]));
        }
    }
    points.push(last);
    points
}
