//! Part: the closed surface of one label.

use glam::{DAffine3, DVec3};

use insonify_core::anatomy::Mesh;

/// Closed surface of one label, outward.
#[derive(Debug, Clone, Default, PartialEq)]
pub struct Part {
    /// Vertices, mm along the grid's axes.
    pub vertices_mm: Vec<DVec3>,
    /// Faces of the grid that each vertex lies on, as bits: 1, 2, 4 for the low faces along x, y, z; 8, 16, 32 for the
    /// high ones.
    pub borders: Vec<u8>,
    /// Vertex indices, counter-clockwise seen from outside.
    pub triangles: Vec<[u32; 3]>,
}

impl Part {
    /// Enclosed volume, mm³; negative if the surface faces inward.
    pub fn volume_mm3(&self) -> f64 {
        self.triangles
            .iter()
            .map(|t| t.map(|v| self.vertices_mm[v as usize]))
            .map(|[a, b, c]| a.dot(b.cross(c)) / 6.0)
            .sum()
    }

    /// The surface as a mesh in the patient frame (LPS), mm, facing outward.
    pub fn mesh(&self, lps_from_grid_mm: &DAffine3) -> Mesh {
        let vertices_mm = self.vertices_mm.iter().map(|&p| lps_from_grid_mm.transform_point3(p).as_vec3()).collect();
        let mut mesh = Mesh { vertices_mm, triangles: self.triangles.clone() };
        if lps_from_grid_mm.matrix3.determinant() < 0.0 {
            mesh.flip();
        }
        mesh
    }
}
