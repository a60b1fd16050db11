//! Smooth displacement fields of bounded reach.

use glam::{Quat, Vec3};
use serde::{Deserialize, Serialize};

/// Width of the margin over which a field fades out, relative to the field's radius.
pub const FADE: f32 = 0.6;
/// Movement of the heart's outer wall relative to the movement of the chambers' walls, as the muscle keeps its volume.
pub const OUTER_WALL: f32 = 0.45;
/// Contraction of the atria relative to the contraction of the ventricles.
pub const ATRIA: f32 = 0.6;

/// Spatial form of a displacement field, scene frame, mm.
#[derive(Debug, Clone, Copy, PartialEq, Serialize, Deserialize)]
#[serde(rename_all = "snake_case", deny_unknown_fields)]
pub enum Shape {
    /// A heart: it narrows about its long axis, and its valve plane moves towards the apex.
    Beat {
        /// Centre of the valve plane.
        centre_mm: Vec3,
        /// Direction from the base to the apex; any non-zero length.
        axis: Vec3,
        /// Radius of the heart.
        radius_mm: f32,
        /// Fraction of its radius by which a chamber narrows, 0 to 0.35.
        squeeze: f32,
        /// Displacement of the valve plane relative to the radius, 0 to 0.3.
        shorten: f32,
    },
    /// A breathing trunk: it widens (or narrows) about an axis, and its interior moves along the axis.
    Breath {
        /// Centre of the moving trunk.
        centre_mm: Vec3,
        /// Direction in which the interior moves; any non-zero length.
        axis: Vec3,
        /// Half of the moving trunk's length along the axis, mm.
        half_length_mm: f32,
        /// Radius of the trunk.
        radius_mm: f32,
        /// Relative increase of the radius, −0.15 to 0.15.
        widen: f32,
        /// Displacement of the interior along the axis, mm; at most a fifth of `half_length_mm`.
        shift_mm: f32,
    },
    /// A limb that rotates about a joint.
    Swing {
        /// Position of the joint.
        joint_mm: Vec3,
        /// Far end of the limb at rest.
        end_mm: Vec3,
        /// Axis of rotation; any non-zero length.
        axis: Vec3,
        /// Distance from the limb's axis within which everything moves with the limb, mm.
        radius_mm: f32,
        /// Largest rotation, degrees, −25 to 25.
        angle_deg: f32,
    },
}

/// Smooth step of `x`: 0 up to `low`, 1 from `high` on, smooth in between.
fn smooth_step(low: f32, high: f32, x: f32) -> f32 {
    let t = ((x - low) / (high - low)).clamp(0.0, 1.0);
    t * t * (3.0 - 2.0 * t)
}

impl Shape {
    /// Current position of the point with the rest position `p`, at these amounts of movement; exactly `p` if both
    /// amounts are 0.
    pub fn moved(&self, p: Vec3, amounts: [f32; 2]) -> Vec3 {
        if amounts == [0.0; 2] {
            return p;
        }
        match *self {
            Self::Beat { centre_mm, axis, radius_mm, squeeze, shorten } => {
                let axis = axis.normalize_or_zero();
                let q = p - centre_mm;
                let reach = q.length() / radius_mm;
                let fade = 1.0 - smooth_step(1.0, 1.0 + FADE, reach);
                if fade == 0.0 {
                    return p;
                }
                let along = q.dot(axis) / radius_mm;
                let ventricular = smooth_step(-0.25, 0.15, along);
                let amount = amounts[0] * ventricular + ATRIA * amounts[1] * (1.0 - ventricular);
                let depth = 1.0 - (1.0 - OUTER_WALL) * smooth_step(0.3, 1.0, reach);
                let about_axis = q - axis * (along * radius_mm);
                let valves = (-(along / 0.5).powi(2)).exp();
                p + fade
                    * (axis * (amounts[0] * shorten * radius_mm * valves) - about_axis * (amount * squeeze * depth))
            }
            Self::Breath { centre_mm, axis, half_length_mm, radius_mm, widen, shift_mm } => {
                let axis = axis.normalize_or_zero();
                let q = p - centre_mm;
                let along = q.dot(axis);
                let about_axis = q - axis * along;
                let fade = (1.0 - smooth_step(0.3, 1.0 + FADE, along.abs() / half_length_mm))
                    * (1.0 - smooth_step(1.0, 1.0 + FADE, about_axis.length() / radius_mm));
                // The shift along the axis fades out towards the skin.
                let inside = 1.0 - smooth_step(0.3, 1.0, about_axis.length() / radius_mm);
                p + amounts[0] * fade * (widen * about_axis + axis * (shift_mm * inside))
            }
            Self::Swing { joint_mm, end_mm, axis, radius_mm, angle_deg } => {
                let limb = end_mm - joint_mm;
                let length = limb.length();
                let q = p - joint_mm;
                let along = (q.dot(limb) / (length * length)).clamp(0.0, 1.0);
                let aside = (q - limb * along).length() / radius_mm;
                // Points on the limb's side of the joint rotate; the weight rises from 0 at the joint to 1 at one
                // radius from it.
                let weight = (1.0 - smooth_step(1.0, 1.0 + FADE, aside))
                    * smooth_step(0.0, 1.0, q.dot(limb) / (length * radius_mm.min(length)));
                if weight == 0.0 {
                    return p;
                }
                let turn =
                    Quat::from_axis_angle(axis.normalize_or(Vec3::X), weight * amounts[0] * angle_deg.to_radians());
                joint_mm + turn * q
            }
        }
    }

    /// Upper bound of the displacement of any point, mm.
    pub fn reach_mm(&self) -> f32 {
        match *self {
            Self::Beat { radius_mm, squeeze, shorten, .. } => radius_mm * (1.0 + FADE) * (squeeze + shorten),
            Self::Breath { radius_mm, widen, shift_mm, .. } => radius_mm * (1.0 + FADE) * widen.abs() + shift_mm.abs(),
            Self::Swing { joint_mm, end_mm, radius_mm, angle_deg, .. } => {
                (joint_mm.distance(end_mm) + (1.0 + FADE) * radius_mm) * angle_deg.to_radians().abs()
            }
        }
    }

    /// First value outside its range: key, value and accepted values.
    pub(super) fn wrong(&self) -> Option<(&'static str, f64, &'static str)> {
        let check = |name, value: f32, low: f32, high: f32, right| {
            (!(low..=high).contains(&value)).then_some((name, f64::from(value), right))
        };
        let axis_of = |axis: Vec3| check("axis", axis.length(), 1e-6, 1e6, "a vector longer than 0");
        let size = |name, value| check(name, value, 0.1, 1e4, "0.1 to 10000");
        let position = |name, v: Vec3| check(name, v.length(), 0.0, 1e5, "finite and within 100 m");
        match *self {
            Self::Beat { centre_mm, axis, radius_mm, squeeze, shorten } => position("centre_mm", centre_mm)
                .or(axis_of(axis))
                .or(size("radius_mm", radius_mm))
                .or(check("squeeze", squeeze, 0.0, 0.35, "0 to 0.35"))
                .or(check("shorten", shorten, 0.0, 0.3, "0 to 0.3")),
            Self::Breath { centre_mm, axis, half_length_mm, radius_mm, widen, shift_mm } => {
                let most = 0.2 * half_length_mm;
                position("centre_mm", centre_mm)
                    .or(axis_of(axis))
                    .or(size("half_length_mm", half_length_mm))
                    .or(size("radius_mm", radius_mm))
                    .or(check("widen", widen, -0.15, 0.15, "-0.15 to 0.15"))
                    .or(check("shift_mm", shift_mm, -most, most, "at most a fifth of half_length_mm"))
            }
            Self::Swing { joint_mm, end_mm, axis, radius_mm, angle_deg } => position("joint_mm", joint_mm)
                .or(position("end_mm", end_mm))
                .or(check("end_mm", joint_mm.distance(end_mm), 0.1, 1e4, "at least 0.1 mm from joint_mm"))
                .or(axis_of(axis))
                .or(size("radius_mm", radius_mm))
                .or(check("angle_deg", angle_deg, -25.0, 25.0, "-25 to 25")),
        }
    }
}

#[cfg(test)]
mod tests {
    use super::*;

    pub(crate) const SHAPES: [Shape; 3] = [
        Shape::Beat {
            centre_mm: Vec3::new(5.0, 0.0, 2.0),
            axis: Vec3::X,
            radius_mm: 10.0,
            squeeze: 0.35,
            shorten: 0.3,
        },
        Shape::Breath {
            centre_mm: Vec3::ZERO,
            axis: Vec3::NEG_Y,
            half_length_mm: 20.0,
            radius_mm: 15.0,
            widen: -0.15,
            shift_mm: 4.0,
        },
        Shape::Swing {
            joint_mm: Vec3::ZERO,
            end_mm: Vec3::new(0.0, 40.0, 0.0),
            axis: Vec3::Z,
            radius_mm: 8.0,
            angle_deg: 25.0,
        },
    ];

    fn grid() -> impl Iterator<Item = Vec3> {
        (0..21 * 21 * 21).map(|i| Vec3::new((i % 21) as f32, (i / 21 % 21) as f32, (i / 441) as f32) * 6.0 - 60.0)
    }

    #[test]
    fn nothing_moves_at_rest_and_distant_points_never_move() {
        for shape in SHAPES {
            assert_eq!(shape.wrong(), None);
            let mut moved = 0;
            for p in grid() {
                assert_eq!(shape.moved(p, [0.0; 2]), p);
                let way = shape.moved(p, [1.0; 2]).distance(p);
                assert!(way <= shape.reach_mm() * 1.0001, "{shape:?}: {p} moves by {way}");
                moved += usize::from(way > 0.1);
            }
            assert!(moved > 10, "{shape:?} moves nothing");
            for far in [Vec3::X * 500.0, Vec3::NEG_Y * 500.0, Vec3::Z * 500.0] {
                assert_eq!(shape.moved(far, [1.0; 2]), far);
            }
        }
    }

    #[test]
    fn no_field_folds_space() {
        for shape in SHAPES {
            for p in grid() {
                // Next to a swinging limb the field is sheared; only fluid is there.
                if matches!(shape, Shape::Swing { radius_mm, .. } if p.with_y(0.0).length() > 0.9 * radius_mm || p.y > 40.0)
                {
                    continue;
                }
                for amounts in [[1.0, 0.0], [0.0, 1.0], [0.5, 0.5]] {
                    let h = 0.05;
                    let d = |v: Vec3| (shape.moved(p + v * h, amounts) - shape.moved(p - v * h, amounts)) / (2.0 * h);
                    let volume = d(Vec3::X).dot(d(Vec3::Y).cross(d(Vec3::Z)));
                    assert!(volume > 0.1, "{shape:?} at {p}: {volume}");
                }
            }
        }
    }

    #[test]
    fn a_heart_narrows_in_systole_and_a_limb_rotates_by_its_angle() {
        let apex_side = Vec3::new(8.0, 5.0, 2.0);
        assert!(SHAPES[0].moved(apex_side, [1.0, 0.0]).y < 4.0);
        let base_side = Vec3::new(1.0, 5.0, 2.0);
        assert!(SHAPES[0].moved(base_side, [0.0, 1.0]).y < 4.5);
        let foot = SHAPES[2].moved(Vec3::new(0.0, 40.0, 0.0), [1.0, 0.0]);
        assert!((Vec3::Y.angle_between(foot).to_degrees() - 25.0).abs() < 0.01);
        assert!((foot.length() - 40.0).abs() < 1e-3);
    }
}
