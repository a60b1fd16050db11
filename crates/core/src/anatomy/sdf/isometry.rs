//! Rigid transforms.

use glam::{Mat3, Quat, Vec3};

use super::Bounds;

/// `outer_from_local`: a rotation, then a translation in mm.
#[derive(Debug, Clone, Copy, PartialEq)]
pub struct Isometry {
    /// Rotation from local to outer axes.
    pub rotation: Quat,
    /// Local origin in outer coordinates, mm.
    pub translation: Vec3,
}

impl Isometry {
    /// Identity transform.
    pub const IDENTITY: Self = Self { rotation: Quat::IDENTITY, translation: Vec3::ZERO };

    /// Frame at `origin` whose y axis is along `y`, and whose z axis is as near as possible to `z`.
    pub fn from_axes(origin: Vec3, y: Vec3, z: Vec3) -> Self {
        let y = y.normalize_or(Vec3::Y);
        let z = (z - y * z.dot(y)).normalize_or(y.any_orthonormal_vector());
        Self { rotation: Quat::from_mat3(&Mat3::from_cols(y.cross(z), y, z)).normalize(), translation: origin }
    }

    /// A local point in outer coordinates.
    pub fn point(&self, local: Vec3) -> Vec3 {
        self.rotation * local + self.translation
    }

    /// A local direction in outer coordinates.
    pub fn vector(&self, local: Vec3) -> Vec3 {
        self.rotation * local
    }

    /// An outer point in local coordinates.
    pub fn local_point(&self, outer: Vec3) -> Vec3 {
        self.rotation.conjugate() * (outer - self.translation)
    }

    /// Composition `outer_from_inner` of this `outer_from_middle` and `inner`, a `middle_from_inner`.
    pub fn then(&self, inner: &Self) -> Self {
        Self { rotation: (self.rotation * inner.rotation).normalize(), translation: self.point(inner.translation) }
    }

    /// Smallest outer box that contains the box `local`.
    pub fn bounds(&self, local: Bounds) -> Bounds {
        local.corners().into_iter().fold(Bounds::EMPTY, |all, corner| all.with(self.point(corner)))
    }
}
