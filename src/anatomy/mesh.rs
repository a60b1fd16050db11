//! Indexed triangle meshes in mm.

use glam::Vec3;

/// Triangles over shared vertices. A sound mesh is closed and its triangles turn counter-clockwise seen from outside.
#[derive(Debug, Clone, Default, PartialEq)]
pub struct Mesh {
    /// Vertices, scene frame, mm.
    pub vertices_mm: Vec<Vec3>,
    /// Vertex indices, each below `vertices_mm.len()`.
    pub triangles: Vec<[u32; 3]>,
}

impl Mesh {
    /// Corners of every triangle, mm.
    pub fn corners_mm(&self) -> impl Iterator<Item = [Vec3; 3]> + '_ {
        self.triangles.iter().map(|t| t.map(|i| self.vertices_mm[i as usize]))
    }

    /// Six times the signed volume over six, mm³: positive where the surface faces outward.
    pub fn signed_volume_mm3(&self) -> f64 {
        self.corners_mm().map(|[a, b, c]| a.as_dvec3().dot(b.as_dvec3().cross(c.as_dvec3())) / 6.0).sum()
    }

    /// Least and greatest vertex coordinates, mm; None for an empty mesh.
    pub fn bounds_mm(&self) -> Option<(Vec3, Vec3)> {
        let first = *self.vertices_mm.first()?;
        Some(self.vertices_mm.iter().fold((first, first), |(lo, hi), &v| (lo.min(v), hi.max(v))))
    }
}
