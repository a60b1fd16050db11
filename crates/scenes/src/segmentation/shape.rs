//! Centre, extent and long axis of a closed surface.

use glam::{DMat3, DVec3};
use nalgebra::Matrix3;

use insonify_core::anatomy::Mesh;

/// Volume, centre and principal axes of the solid within a closed surface.
#[derive(Debug, Clone, Copy, PartialEq)]
pub struct Shape {
    /// Volume, mm³.
    pub volume_mm3: f64,
    /// Centre of mass, mm.
    pub centre_mm: DVec3,
    /// Principal axes, the longest first; unit vectors.
    pub axes: [DVec3; 3],
    /// For each principal axis, the lowest and highest coordinate of the surface along it, relative to the centre, mm.
    pub extent_mm: [[f64; 2]; 3],
}

impl Shape {
    /// Shape of a closed mesh; `None` if it has no volume.
    pub fn of(mesh: &Mesh) -> Option<Self> {
        let about = mesh.vertices_mm.first()?.as_dvec3();
        let (mut volume, mut first, mut second) = (0.0, DVec3::ZERO, DMat3::ZERO);
        for corners in mesh.corners_mm() {
            let [a, b, c] = corners.map(|v| v.as_dvec3() - about);
            let v = a.dot(b.cross(c)) / 6.0;
            let sum = a + b + c;
            volume += v;
            first += 0.25 * v * sum;
            // Second moments of the tetrahedron between a triangle and the origin.
            let outer = |p: DVec3| DMat3::from_cols(p * p.x, p * p.y, p * p.z);
            second += (outer(a) + outer(b) + outer(c) + outer(sum)) * (v / 20.0);
        }
        if volume.abs() < 1e-9 {
            return None;
        }
        let mean = first / volume;
        let covariance = second * volume.recip() - DMat3::from_cols(mean * mean.x, mean * mean.y, mean * mean.z);
        let matrix = Matrix3::from_fn(|r, c| covariance.col(c)[r]);
        let eigen = matrix.symmetric_eigen();
        let mut order = [0, 1, 2];
        order.sort_by(|&a, &b| eigen.eigenvalues[b].total_cmp(&eigen.eigenvalues[a]));
        let axis = |n: usize| {
            let v = eigen.eigenvectors.column(n);
            DVec3::new(v[0], v[1], v[2]).normalize_or(DVec3::Z)
        };
        let axes = order.map(axis);
        let centre_mm = about + mean;
        let extent_mm = axes.map(|axis| {
            let along = mesh.vertices_mm.iter().map(|v| (v.as_dvec3() - centre_mm).dot(axis));
            along.fold([f64::INFINITY, f64::NEG_INFINITY], |[low, high], x| [low.min(x), high.max(x)])
        });
        Some(Self { volume_mm3: volume, centre_mm, axes, extent_mm })
    }

    /// Length along the longest axis, mm.
    pub fn length_mm(&self) -> f64 {
        self.extent_mm[0][1] - self.extent_mm[0][0]
    }

    /// Unit vector along the longest axis, with its sign chosen to point towards `direction`.
    pub fn long_axis(&self, direction: DVec3) -> DVec3 {
        if self.axes[0].dot(direction) < 0.0 { -self.axes[0] } else { self.axes[0] }
    }
}

/// Smallest volume of a piece that counts, relative to its mesh.
const PIECE: f64 = 0.15;

/// Index of the connected piece of each triangle, and the volume within each piece, mm³. The volume of a cavity is negative.
pub(super) fn pieces_mm3(mesh: &Mesh) -> (Vec<u32>, Vec<f64>) {
    let (piece_of, count) = mesh.pieces();
    let mut volumes = vec![0.0; count];
    for (corners, &piece) in mesh.corners_mm().zip(&piece_of) {
        let [a, b, c] = corners.map(|v| v.as_dvec3());
        volumes[piece as usize] += a.dot(b.cross(c)) / 6.0;
    }
    (piece_of, volumes)
}

/// Volumes of the larger pieces of a mesh, ml, largest first. Pieces share no vertex with each other; those below 15 % of the
/// mesh are left out.
pub(super) fn pieces_ml(mesh: &Mesh) -> Vec<f64> {
    let (_, volumes) = pieces_mm3(mesh);
    let whole = mesh.signed_volume_mm3();
    let mut large: Vec<f64> = volumes.into_iter().filter(|v| *v > PIECE * whole).map(|v| v * 1e-3).collect();
    large.sort_by(|a, b| b.total_cmp(a));
    large
}

#[cfg(test)]
mod tests {
    use glam::Vec3;
    use insonify_core::anatomy::analytic::{cuboid, sphere};

    use super::*;

    #[test]
    fn a_box_has_its_centre_axes_and_extent() {
        let shape = Shape::of(&cuboid(Vec3::new(100.0, 0.0, 0.0), Vec3::new(110.0, 20.0, 60.0))).unwrap();
        assert!((shape.volume_mm3 - 12_000.0).abs() < 1e-3, "{shape:?}");
        assert!(shape.centre_mm.distance(DVec3::new(105.0, 10.0, 30.0)) < 1e-4, "{shape:?}");
        assert!(shape.axes[0].z.abs() > 0.9999 && shape.axes[1].y.abs() > 0.9999, "{shape:?}");
        assert!((shape.length_mm() - 60.0).abs() < 1e-4 && shape.long_axis(DVec3::NEG_Z).z < -0.99);
        let ball = Shape::of(&sphere(Vec3::new(-3.0, 4.0, 5.0), 10.0, 5)).unwrap();
        assert!(ball.centre_mm.distance(DVec3::new(-3.0, 4.0, 5.0)) < 0.05 && (ball.length_mm() - 20.0).abs() < 0.1);
        assert_eq!(Shape::of(&Mesh::default()), None);
    }
}
