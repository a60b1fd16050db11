//! Composition of rigid transforms: `a_from_b * b_from_c` is `a_from_c`.

use std::ops::Mul;

use glam::{DQuat, DVec3};

use super::Pose;

impl Pose {
    /// Identity transform.
    pub const IDENTITY: Self = Self { position_mm: DVec3::ZERO, orientation: DQuat::IDENTITY };

    /// Inverse transform: `b_from_a` of this `a_from_b`.
    pub fn inverse(&self) -> Self {
        let orientation = self.orientation.conjugate();
        Self { position_mm: -(orientation * self.position_mm), orientation }
    }
}

impl Mul for Pose {
    type Output = Self;

    /// Composition `a_from_c` of `a_from_b * b_from_c`.
    fn mul(self, b_from_c: Self) -> Self {
        Self {
            position_mm: self.transform_point(b_from_c.position_mm),
            orientation: (self.orientation * b_from_c.orientation).normalize(),
        }
    }
}

/// Rotation vector (axis × angle, rad) of a unit quaternion, on the shorter arc: at most π long.
///
/// Uses `atan2`, which is accurate for small angles and needs no clamp if rounding makes |w| exceed 1.
pub fn rotation_vector(q: DQuat) -> DVec3 {
    let v = if q.w < 0.0 { -q.xyz() } else { q.xyz() };
    let sine = v.length();
    if sine < 1e-12 {
        return 2.0 * v;
    }
    v * (2.0 * sine.atan2(q.w.abs()) / sine)
}

/// Angle between two orientations on the shorter arc, rad, 0..=π.
pub fn angle_between(a: DQuat, b: DQuat) -> f64 {
    rotation_vector(a * b.conjugate()).length()
}

/// Poses up to a metre from the origin in each direction, for property tests.
#[cfg(test)]
pub(super) fn any_pose() -> impl proptest::strategy::Strategy<Value = Pose> {
    use proptest::prelude::*;

    let three = || prop::array::uniform3(-1.0..1.0_f64).prop_map(DVec3::from_array);
    (three(), three(), -4.0..4.0_f64).prop_map(|(p, axis, angle)| Pose {
        position_mm: 1000.0 * p,
        orientation: DQuat::from_axis_angle(axis.normalize_or(DVec3::X), angle),
    })
}

#[cfg(test)]
mod tests {
    use proptest::prelude::*;

    use super::*;

    proptest! {
        #![proptest_config(ProptestConfig { failure_persistence: None, ..ProptestConfig::default() })]

        #[test]
        fn a_chain_equals_its_links_applied_in_turn(a in any_pose(), b in any_pose(), p in prop::array::uniform3(-100.0..100.0_f64)) {
            let p = DVec3::from_array(p);
            prop_assert!((a * b).transform_point(p).distance(a.transform_point(b.transform_point(p))) < 1e-9);
            prop_assert!((a * a.inverse()).transform_point(p).distance(p) < 1e-9);
            prop_assert!((Pose::IDENTITY * a).transform_point(p).distance(a.transform_point(p)) < 1e-9);
        }

        #[test]
        fn a_rotation_vector_gives_back_its_rotation(a in any_pose(), negate in any::<bool>()) {
            let q = if negate { -a.orientation } else { a.orientation };
            let v = rotation_vector(q);
            prop_assert!(v.length() <= std::f64::consts::PI + 1e-12);
            prop_assert!(angle_between(DQuat::from_scaled_axis(v), a.orientation) < 1e-9);
        }
    }

    #[test]
    fn half_turns_and_rounding_are_handled() {
        let half = DQuat::from_rotation_x(std::f64::consts::PI);
        assert!((rotation_vector(half).length() - std::f64::consts::PI).abs() < 1e-12);
        assert!((angle_between(half, DQuat::IDENTITY) - std::f64::consts::PI).abs() < 1e-12);
        assert_eq!(rotation_vector(DQuat::from_xyzw(0.0, 0.0, 0.0, 1.0 + 1e-15)), DVec3::ZERO);
        assert!((angle_between(DQuat::from_rotation_z(1e-9), DQuat::IDENTITY) - 1e-9).abs() < 1e-18);
    }
}
