//! Straight rays from a position on the face to a point on a beam's axis, for flat and curved faces.

/// Shape of the face: radius of curvature, mm; infinite for a flat face.
#[derive(Debug, Clone, Copy)]
pub(super) struct Face {
    pub(super) radius_mm: f64,
}

impl Face {
    /// Width of a sector at a depth over its width at the face; 1 for a flat face.
    pub(super) fn spread(self, depth_mm: f64) -> f64 {
        1.0 + depth_mm / self.radius_mm
    }

    /// Length of the ray from `across_mm` along the face, counted from the axis, to `depth_mm` on the axis; mm.
    pub(super) fn distance_mm(self, across_mm: f64, depth_mm: f64) -> f64 {
        if self.radius_mm.is_infinite() {
            return across_mm.hypot(depth_mm);
        }
        // Law of cosines about the centre of curvature, without cancellation.
        let half_sin = (0.5 * across_mm / self.radius_mm).sin();
        (depth_mm * depth_mm + 4.0 * self.radius_mm * (self.radius_mm + depth_mm) * half_sin * half_sin).sqrt()
    }

    /// Sine of the angle between that ray and the face's normal: wave number along the face over the whole one.
    pub(super) fn slope(self, across_mm: f64, depth_mm: f64) -> f64 {
        let distance_mm = self.distance_mm(across_mm, depth_mm).max(1e-9);
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
        let (flat, curved) = (Face { radius_mm: f64::INFINITY }, Face { radius_mm: 1.0e6 });
        for (across, depth) in [(0.0, 50.0), (8.0, 30.0), (10.0, 2.0)] {
            assert!((flat.distance_mm(across, depth) - curved.distance_mm(across, depth)).abs() < 1e-3);
            assert!((flat.slope(across, depth) - curved.slope(across, depth)).abs() < 1e-4);
        }
    }

    #[test]
    fn a_ray_along_the_axis_has_no_slope() {
        let face = Face { radius_mm: 40.0 };
        assert_eq!(face.slope(0.0, 60.0), 0.0);
        assert!((face.distance_mm(0.0, 60.0) - 60.0).abs() < 1e-12);
    }
}
