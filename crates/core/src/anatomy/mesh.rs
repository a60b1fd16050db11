//! Indexed triangle meshes in mm.

use glam::Vec3;
use rayon::slice::ParallelSliceMut;

use super::Bounds;
use super::groups::Groups;

/// Triangles over shared vertices. A valid mesh is closed, and its triangles are counter-clockwise seen from outside.
#[derive(Debug, Clone, Default, PartialEq)]
pub struct Mesh {
    /// Vertices, scene frame, mm.
    pub vertices_mm: Vec<Vec3>,
    /// Vertex indices, each below `vertices_mm.len()`.
    pub triangles: Vec<[u32; 3]>,
}

impl Mesh {
    /// Corners of the triangle of this index, mm.
    pub fn corners_of(&self, triangle: u32) -> [Vec3; 3] {
        self.triangles[triangle as usize].map(|i| self.vertices_mm[i as usize])
    }

    /// Corners of every triangle, mm.
    pub fn corners_mm(&self) -> impl Iterator<Item = [Vec3; 3]> + '_ {
        self.triangles.iter().map(|t| t.map(|i| self.vertices_mm[i as usize]))
    }

    /// Signed volume, mm³; positive if the surface faces outward.
    pub fn signed_volume_mm3(&self) -> f64 {
        self.corners_mm().map(|[a, b, c]| a.as_dvec3().dot(b.as_dvec3().cross(c.as_dvec3())) / 6.0).sum()
    }

    /// Number of edges without an oppositely directed neighbour: 0 for a closed, consistently wound surface.
    pub fn unpaired_edges(&self) -> usize {
        let directed = |&[a, b, c]: &[u32; 3]| [(a, b), (b, c), (c, a)];
        // Both directions of an edge have keys that differ only in the lowest bit.
        let key = |(a, b): (u32, u32)| (u128::from(a.min(b)) << 33) | (u128::from(a.max(b)) << 1) | u128::from(a < b);
        let mut keys: Vec<u128> = self.triangles.iter().flat_map(directed).map(key).collect();
        keys.par_sort_unstable();
        let balance = |edge: &[u128]| edge.iter().map(|k| if k & 1 == 1 { 1_i64 } else { -1 }).sum::<i64>();
        keys.chunk_by(|a, b| a >> 1 == b >> 1).map(|edge| balance(edge).unsigned_abs() as usize).sum()
    }

    /// Index of the connected piece of each triangle, and the number of pieces. Triangles that share a vertex belong
    /// to one piece. Pieces are numbered in the order of their first triangles.
    pub fn pieces(&self) -> (Vec<u32>, usize) {
        let mut groups = Groups::new(self.triangles.len());
        let mut first_of = vec![u32::MAX; self.vertices_mm.len()];
        for (number, triangle) in (0..).zip(&self.triangles) {
            for &vertex in triangle {
                let first = &mut first_of[vertex as usize];
                match *first {
                    u32::MAX => *first = number,
                    first => groups.join(first, number),
                }
            }
        }
        let pieces = groups.numbered();
        let count = pieces.iter().max().map_or(0, |last| *last as usize + 1);
        (pieces, count)
    }

    /// Reverses the winding of every triangle.
    pub fn flip(&mut self) {
        for triangle in &mut self.triangles {
            triangle.swap(1, 2);
        }
    }

    /// Smallest box that contains all vertices, mm; `None` for an empty mesh.
    pub fn bounds_mm(&self) -> Option<Bounds> {
        Bounds::of(self.vertices_mm.iter().copied())
    }
}

#[cfg(test)]
mod tests {
    use super::*;

    #[test]
    fn pieces_are_numbered_in_the_order_of_their_first_triangles() {
        let triangles = vec![[3, 4, 5], [0, 1, 2], [6, 7, 8], [5, 9, 10], [10, 2, 11]];
        let mesh = Mesh { vertices_mm: vec![Vec3::ZERO; 13], triangles };
        assert_eq!(mesh.pieces(), (vec![0, 0, 1, 0, 0], 2));
        assert_eq!(Mesh::default().pieces(), (Vec::new(), 0));
    }
}
