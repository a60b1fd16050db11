//! Straight rays from a position on the face to a point on a beam's axis, for flat and curved faces and phased arrays.

/// Shape of the face.
#[derive(Debug, Clone, Copy)]
pub(super) struct Face {
    /// Radius of curvature, mm; infinite for a flat face. Of a phased array, the radius of the arc about its middle from
    /// which waves are computed.
    pub(super) radius_mm: f64,
    /// Depth from which waves are computed, mm: `radius_mm` of a phased array, else 0.
    pub(super) start_mm: f64,
}

impl Face {
    /// A flat or curved face, from which all beams leave side by side.
    pub(super) fn of_radius(radius_mm: f64) -> Self {
        Self { radius_mm, start_mm: 0.0 }
    }

    /// A phased array, whose beams turn about its middle, with waves from an arc of `radius_mm` on.
    pub(super) fn phased(radius_mm: f64) -> Self {
        Self { radius_mm, start_mm: radius_mm }
    }

    pub(super) fn is_phased(self) -> bool {
        self.start_mm > 0.0
    }

    /// Width of a sector at a depth over its width where waves begin; 1 for a flat face.
    pub(super) fn spread(self, depth_mm: f64) -> f64 {
        1.0 + (depth_mm - self.start_mm).max(0.0) / self.radius_mm
    }

    /// Length of the ray from `across_mm` along the face, counted from the axis, to `depth_mm` on the axis; mm.
    pub(super) fn distance_mm(self, across_mm: f64, depth_mm: f64) -> f64 {
        if self.radius_mm.is_infinite() || self.is_phased() {
            return across_mm.hypot(depth_mm);
        }
        // Law of cosines about the centre of curvature, without cancellation.
        let half_sin = (0.5 * across_mm / self.radius_mm).sin();
        (depth_mm * depth_mm + 4.0 * self.radius_mm * (self.radius_mm + depth_mm) * half_sin * half_sin).sqrt()
    }

    /// Sine of the angle between that ray and the face's normal: wave number along the face over the whole one. Of a
    /// phased array, that between the ray and the normal of the arc where waves begin.
    pub(super) fn slope(self, across_mm: f64, depth_mm: f64) -> f64 {
        let distance_mm = self.distance_mm(across_mm, depth_mm).max(1e-9);
        if self.is_phased() {
            return across_mm.abs() * depth_mm / (distance_mm * self.radius_mm);
        }
        if self.radius_mm.is_infinite() {
            return across_mm.abs() / distance_mm;
        }
        (across_mm / self.radius_mm).sin().abs() * (self.radius_mm + depth_mm) / distance_mm
    }
}

#[cfg(test)]
mod tests {
    use super::*;

    #[test]
    fn a_face_of_a_large_radius_is_flat() {
        let (flat, curved) = (Face::of_radius(f64::INFINITY), Face::of_radius(1.0e6));
        for (across, depth) in [(0.0, 50.0), (8.0, 30.0), (10.0, 2.0)] {
            assert!((flat.distance_mm(across, depth) - curved.distance_mm(across, depth)).abs() < 1e-3);
            assert!((flat.slope(across, depth) - curved.slope(across, depth)).abs() < 1e-4);
        }
    }

    #[test]
    fn a_ray_along_the_axis_has_no_slope() {
        let face = Face::of_radius(40.0);
        assert_eq!(face.slope(0.0, 60.0), 0.0);
        assert!((face.distance_mm(0.0, 60.0) - 60.0).abs() < 1e-12);
    }

    #[test]
    fn rays_of_a_phased_array_cross_the_arc_at_their_angle() {
        let face = Face::phased(12.0);
        // From the position 9 mm beside the middle to the depth 40 mm: where the ray crosses the arc, its sine.
        let (a, z) = (9.0_f64, 40.0_f64);
        let along = glam::DVec2::new(-a, z).normalize();
        let from = glam::DVec2::new(a, 0.0);
        let b = from.dot(along);
        let crossing = from + along * (-b + (b * b - from.length_squared() + 144.0).sqrt());
        let sine = crossing.normalize().perp_dot(along).abs();
        assert!((face.slope(a, z) - sine).abs() < 1e-12, "{} {sine}", face.slope(a, z));
        assert_eq!([face.spread(3.0), face.spread(12.0), face.spread(60.0)], [1.0, 1.0, 5.0]);
    }
}
