//! Caliper measurements in images that may be off the standard plane.
//!
//! The scene's surfaces are cut with the image plane, and measured there as a careful observer would. So all
//! differences from the true values come from the plane: a tilted femur is too short, an oblique abdomen too large.
//!
//! - A **line** runs along its standard direction as it appears in the image. It ends at the outermost borders visible
//!   in the slice; a slice is as thick as the beam at that depth.
//! - An **ellipse** is fitted to the border by least squares; its circumference follows Ramanujan's approximation.

use glam::DVec2;
use nalgebra::{Matrix5, Vector5};

use crate::anatomy::Mesh;
use crate::anatomy::planes::{Caliper, CaliperKind};
use crate::anatomy::section::Section;
use crate::pose::Pose;
use crate::recording::ellipse_circumference_mm;

/// Number of section planes across the thickness of a slice.
const CUTS: u32 = 5;

/// Number of directions in which an ellipse's border is searched, and smallest number of these with a border.
const DIRECTIONS: usize = 120;
const DIRECTIONS_LEAST: usize = 72;

/// Smallest projected length of a caliper that is visible, relative to its true length.
const FORESHORTENED_LEAST: f64 = 0.3;

/// A measurement in an image.
#[derive(Debug, Clone, PartialEq)]
pub struct Measured {
    /// Length or circumference, mm.
    pub length_mm: f64,
    /// Ends of the line, or points of the ellipse: (x, z) in the probe frame, mm.
    pub points_mm: Vec<DVec2>,
}

/// Measures `caliper` in the image of a probe at `pose` with slices `slice_mm` thick.
///
/// `surface` is the caliper's surface, `far_surface` the surface at its end far from the probe. `None` if the image
/// does not show enough of the caliper.
pub fn measure(
    caliper: &Caliper,
    surface: &Mesh,
    far_surface: Option<&Mesh>,
    pose: &Pose,
    slice_mm: f64,
) -> Option<Measured> {
    let probe_from_scene = pose.inverse();
    let points: Vec<DVec2> = caliper
        .points_mm
        .iter()
        .map(|&p| {
            let local = probe_from_scene.transform_point(p);
            DVec2::new(local.x, local.z)
        })
        .collect();
    match (caliper.kind, points[..].as_ref()) {
        (CaliperKind::Line, &[a, b]) => {
            let true_mm = caliper.points_mm.first()?.distance(*caliper.points_mm.get(1)?);
            if a.distance(b) < FORESHORTENED_LEAST * true_mm {
                return None;
            }
            // Start from the end near the probe.
            let ends = if a.y <= b.y { [a, b] } else { [b, a] };
            line(ends, caliper.reach_mm, surface, far_surface.unwrap_or(surface), pose, slice_mm)
        }
        (CaliperKind::Ellipse, &[a, b, c, d]) => {
            let axes = [0.5 * (b - a), 0.5 * (d - c)];
            ellipse(0.25 * (a + b + c + d), axes, caliper.reach_mm, &Section::of(surface, pose, 0.0))
        }
        _ => None,
    }
}

fn line(
    [near, far]: [DVec2; 2],
    reach_mm: f64,
    surface: &Mesh,
    far_surface: &Mesh,
    pose: &Pose,
    slice_mm: f64,
) -> Option<Measured> {
    let length = near.distance(far);
    let along = (far - near) / length;
    let extent = |mesh: &Mesh| {
        let mut range: Option<[(f64, DVec2); 2]> = None;
        for cut in 0..CUTS {
            let offset_mm = slice_mm * (f64::from(cut) / f64::from(CUTS - 1) - 0.5);
            for &p in Section::of(mesh, pose, offset_mm).segments_mm.iter().flatten() {
                let t = (p - near).dot(along);
                let aside = (p - near).perp_dot(along).abs();
                if aside > reach_mm || t < -reach_mm || t > length + reach_mm {
                    continue;
                }
                let [low, high] = range.unwrap_or([(t, p); 2]);
                range = Some([if t < low.0 { (t, p) } else { low }, if t > high.0 { (t, p) } else { high }]);
            }
        }
        range
    };
    let (low, high) = (extent(surface)?[0], extent(far_surface)?[1]);
    let length_mm = high.0 - low.0;
    (length_mm > 0.0).then(|| Measured { length_mm, points_mm: vec![low.1, high.1] })
}

fn ellipse(centre: DVec2, axes: [DVec2; 2], reach_mm: f64, section: &Section) -> Option<Measured> {
    let border: Vec<DVec2> = (0..DIRECTIONS)
        .filter_map(|i| {
            let (sin, cos) = (std::f64::consts::TAU * i as f64 / DIRECTIONS as f64).sin_cos();
            let expected = axes[0] * cos + axes[1] * sin;
            let (radius, direction) = (expected.length(), expected.try_normalize()?);
            let nearest = section
                .crossings_mm(centre, direction)
                .min_by(|a, b| (a - radius).abs().total_cmp(&(b - radius).abs()))?;
            ((nearest - radius).abs() <= reach_mm).then(|| direction * nearest)
        })
        .collect();
    if border.len() < DIRECTIONS_LEAST {
        return None;
    }
    let (middle, [a, b], first) = fit_ellipse(&border)?;
    let second = first.perp();
    let point = |i: usize| {
        let (sin, cos) = (std::f64::consts::TAU * i as f64 / DIRECTIONS as f64).sin_cos();
        centre + middle + first * (a * cos) + second * (b * sin)
    };
    Some(Measured { length_mm: ellipse_circumference_mm(a, b), points_mm: (0..DIRECTIONS).map(point).collect() })
}

/// Ellipse fitted to `points` about the origin: centre, half axes and unit direction of the first axis. It is the conic
/// Ax² + Bxy + Cy² + Dx + Ey = 1 with the smallest algebraic error. `None` if that conic is no ellipse.
fn fit_ellipse(points: &[DVec2]) -> Option<(DVec2, [f64; 2], DVec2)> {
    let scale = points.iter().map(|p| p.length()).fold(0.0, f64::max);
    if scale <= 0.0 {
        return None;
    }
    let (mut matrix, mut right) = (Matrix5::<f64>::zeros(), Vector5::<f64>::zeros());
    for p in points {
        let p = *p / scale;
        let row = Vector5::new(p.x * p.x, p.x * p.y, p.y * p.y, p.x, p.y);
        matrix += row * row.transpose();
        right += row;
    }
    let conic = matrix.cholesky()?.solve(&right);
    let [a, b, c, d, e] = [conic[0], conic[1], conic[2], conic[3], conic[4]];
    let det = 4.0 * a * c - b * b;
    if a <= 0.0 || det <= 1e-9 {
        return None;
    }
    let middle = DVec2::new(b * e - 2.0 * c * d, b * d - 2.0 * a * e) / det;
    // Relative to its centre, the conic is A'x² + Bxy + C'y² = level.
    let level = 1.0 - 0.5 * (d * middle.x + e * middle.y);
    let (mean, half) = (0.5 * (a + c), (0.5 * (a - c)).hypot(0.5 * b));
    let angle = 0.5 * b.atan2(a - c);
    let axes = [level / (mean + half), level / (mean - half)];
    if !axes.iter().all(|v| v.is_finite() && *v > 0.0) {
        return None;
    }
    Some((middle * scale, axes.map(|v| v.sqrt() * scale), DVec2::from_angle(angle)))
}

#[cfg(test)]
mod tests {
    use glam::{DVec3, Vec3};

    use super::*;
    use crate::anatomy::analytic;

    #[test]
    fn a_fitted_ellipse_is_the_one_its_points_lie_on() {
        let (first, middle) = (DVec2::from_angle(0.7), DVec2::new(3.0, -2.0));
        let points: Vec<DVec2> = (0..40)
            .map(|i| {
                let (sin, cos) = (f64::from(i) * 0.157).sin_cos();
                middle + first * (30.0 * cos) + first.perp() * (20.0 * sin)
            })
            .collect();
        let (found, [a, b], direction) = fit_ellipse(&points).unwrap();
        assert!(found.distance(middle) < 1e-6);
        let (long, along) = if a > b { (a, direction) } else { (b, direction.perp()) };
        assert!((long - 30.0).abs() < 1e-6 && (a * b - 600.0).abs() < 1e-4);
        assert!(along.perp_dot(first).abs() < 1e-6);
    }

    fn ball_caliper(points_mm: Vec<DVec3>) -> Caliper {
        let kind = if points_mm.len() == 2 { CaliperKind::Line } else { CaliperKind::Ellipse };
        Caliper {
            name: "D".into(),
            title: "diameter".into(),
            kind,
            points_mm,
            surface: "ball".into(),
            far_surface: None,
            reach_mm: 8.0,
            true_mm: None,
        }
    }

    #[test]
    fn off_its_middle_a_ball_is_smaller() {
        let ball = analytic::sphere(Vec3::new(0.0, 0.0, 60.0), 20.0, 5);
        let centre = DVec3::Z * 60.0;
        let ends = [DVec3::X, -DVec3::X, DVec3::Z, -DVec3::Z].map(|d| centre + 20.0 * d);
        for off in [0.0, 4.0, 10.0] {
            let pose = Pose::looking(DVec3::Y * off, DVec3::Z, DVec3::X);
            let radius = (400.0f64 - off * off).sqrt();
            let line = measure(&ball_caliper(ends[..2].to_vec()), &ball, None, &pose, 0.0).unwrap();
            assert!((line.length_mm - 2.0 * radius).abs() < 0.1, "{}", line.length_mm);
            let around = measure(&ball_caliper(ends.to_vec()), &ball, None, &pose, 0.0).unwrap();
            assert!((around.length_mm / (std::f64::consts::TAU * radius) - 1.0).abs() < 3e-3);
        }
        let past = Pose::looking(DVec3::Y * 21.0, DVec3::Z, DVec3::X);
        assert_eq!(measure(&ball_caliper(ends.to_vec()), &ball, None, &past, 0.0), None);
        // A slice of 4 mm extends to a larger cross-section of the ball.
        let line = measure(
            &ball_caliper(ends[..2].to_vec()),
            &ball,
            None,
            &Pose::looking(DVec3::Y * 10.0, DVec3::Z, DVec3::X),
            4.0,
        );
        assert!((line.unwrap().length_mm - 2.0 * (400.0f64 - 64.0).sqrt()).abs() < 0.1);
    }
}
