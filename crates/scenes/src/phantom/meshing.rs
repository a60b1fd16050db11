//! Meshing: from a solid to a closed triangle mesh.
//!
//! The solid is sampled on a regular grid: once per block first, then completely in blocks that may contain the
//! surface. Naive surface nets (`fast-surface-nets`) give one vertex per cell that the surface passes through. Newton
//! steps along the gradient then move each vertex onto the surface, which removes the staircase of the grid.

use fast_surface_nets::ndshape::RuntimeShape;
use fast_surface_nets::{SurfaceNetsBuffer, surface_nets};
use glam::{UVec3, Vec3};
use insonify_core::anatomy::Mesh;
use insonify_core::anatomy::sdf::Solid;
use rayon::prelude::*;

use super::fragments::without_fragments;

/// Cells along a block's edge.
const BLOCK: u32 = 4;
/// Number of cells between the solid's bounding box and the grid's border, so that surfaces close.
const MARGIN_CELLS: f32 = 2.5;
/// A block is skipped if the distance at its centre exceeds this multiple of its half diagonal. The multiple exceeds
/// one because signed distances of solids are not exact: some have a slope above one.
const LIPSCHITZ: f32 = 3.0;
/// Newton steps per vertex.
const NEWTON_STEPS: usize = 4;

/// Signed distances on a regular grid.
struct Samples {
    values: Vec<f32>,
    size: UVec3,
    origin: Vec3,
    cell_mm: f32,
}

/// Closed mesh of `solid` with cells of `cell_mm`, without fragments; empty if the solid contains no grid point.
pub(super) fn mesh(solid: &Solid, cell_mm: f32) -> Mesh {
    let samples = Samples::of(solid, cell_mm);
    let shape = RuntimeShape::<u32, 3>::new(samples.size.to_array());
    let mut net = SurfaceNetsBuffer::default();
    surface_nets(&samples.values, &shape, [0; 3], (samples.size - 1).to_array(), &mut net);
    let vertices_mm =
        net.positions.par_iter().map(|&p| project(solid, samples.origin + Vec3::from(p) * cell_mm, cell_mm)).collect();
    let triangles = net.indices.chunks_exact(3).map(|t| [t[0], t[1], t[2]]).collect();
    without_fragments(Mesh { vertices_mm, triangles }, cell_mm)
}

/// Number of triangles of [`mesh`], fragments included, without computing the vertices.
pub(super) fn count_triangles(solid: &Solid, cell_mm: f32) -> usize {
    let samples = Samples::of(solid, cell_mm);
    let strides = samples.strides();
    let crossings: usize = (0..3)
        .map(|axis| {
            let values = &samples.values;
            // At the end of a row, the stride leads to the next row. Both samples are at the grid's border, outside the
            // solid, so they count as no crossing.
            (0..values.len() - strides[axis])
                .filter(|&i| (values[i] < 0.0) != (values[i + strides[axis]] < 0.0))
                .count()
        })
        .sum();
    2 * crossings
}

impl Samples {
    fn of(solid: &Solid, cell_mm: f32) -> Self {
        let bounds = solid.bounds().grown(MARGIN_CELLS * cell_mm);
        let blocks = (bounds.size() / (cell_mm * BLOCK as f32)).ceil().max(Vec3::ONE).as_uvec3();
        let size = blocks * BLOCK;
        let origin = bounds.min;
        let half_diagonal = 0.5 * BLOCK as f32 * cell_mm * 3f32.sqrt();
        let layer = (size.x * size.y) as usize;
        let mut values = vec![0.0; layer * size.z as usize];
        values.par_chunks_mut(layer * BLOCK as usize).enumerate().for_each(|(bz, slab)| {
            for by in 0..blocks.y {
                for bx in 0..blocks.x {
                    let first = UVec3::new(bx, by, bz as u32) * BLOCK;
                    // A block's BLOCK samples span BLOCK - 1 cells.
                    let centre = origin + (first.as_vec3() + 0.5 * (BLOCK - 1) as f32) * cell_mm;
                    let at_centre = solid.distance_mm(centre);
                    let near = at_centre.abs() < LIPSCHITZ * half_diagonal;
                    for z in 0..BLOCK {
                        for y in by * BLOCK..(by + 1) * BLOCK {
                            let row = z as usize * layer + (y * size.x + first.x) as usize;
                            for x in 0..BLOCK {
                                let p = origin + UVec3::new(first.x + x, y, first.z + z).as_vec3() * cell_mm;
                                slab[row + x as usize] = if near { solid.distance_mm(p) } else { at_centre };
                            }
                        }
                    }
                }
            }
        });
        let mut samples = Self { values, size, origin, cell_mm };
        samples.make_manifold();
        samples
    }

    fn strides(&self) -> [usize; 3] {
        [1, self.size.x as usize, (self.size.x * self.size.y) as usize]
    }

    /// Adds inside samples until no square of four neighbours has alternating signs. At such a square the net would
    /// join four sheets along one edge.
    fn make_manifold(&mut self) {
        let strides = self.strides();
        let inside = -1e-3 * self.cell_mm;
        loop {
            let values = &self.values;
            let last = values.len() - strides[2] - strides[1] - 1;
            let crossed: Vec<usize> = (0..last)
                .into_par_iter()
                .flat_map_iter(|i| {
                    [(0, 1), (0, 2), (1, 2)].into_iter().filter_map(move |(u, v)| {
                        let square = [i, i + strides[u], i + strides[u] + strides[v], i + strides[v]];
                        let s = square.map(|k| values[k] < 0.0);
                        // Filling only adds inside samples, so the loop terminates.
                        (s[0] == s[2] && s[1] == s[3] && s[0] != s[1])
                            .then(|| square.into_iter().filter(|&k| values[k] >= 0.0))
                            .and_then(|outside| outside.min_by(|&a, &b| values[a].total_cmp(&values[b])))
                    })
                })
                .collect();
            if crossed.is_empty() {
                return;
            }
            for k in crossed {
                self.values[k] = inside;
            }
        }
    }
}

/// Moves a vertex from `start` onto the surface by Newton steps. It stays within 0.7 cells of `start`.
fn project(solid: &Solid, start: Vec3, cell_mm: f32) -> Vec3 {
    let mut p = start;
    for _ in 0..NEWTON_STEPS {
        let d = solid.distance_mm(p);
        if d.abs() < 1e-3 {
            break;
        }
        let g = solid.gradient(p);
        let step = g * (d / g.length_squared().max(0.04));
        p -= step.clamp_length_max(0.5 * cell_mm);
        // A vertex that leaves its cell's neighbourhood would fold the surface.
        p = start + (p - start).clamp_length_max(0.7 * cell_mm);
    }
    p
}

#[cfg(test)]
mod tests {
    use insonify_core::anatomy::sdf::{capsule, sphere, union};

    use super::*;

    #[test]
    fn a_ball_has_its_volume_and_its_count() {
        let ball = sphere(Vec3::new(3.0, -2.0, 1.0), 10.0);
        let mesh = mesh(&ball, 0.8);
        let exact = 4.0 / 3.0 * std::f64::consts::PI * 1000.0;
        assert!((mesh.signed_volume_mm3() / exact - 1.0).abs() < 0.01);
        assert_eq!(mesh.triangles.len(), count_triangles(&ball, 0.8));
        assert!(mesh.vertices_mm.iter().all(|&v| ball.distance_mm(v).abs() < 2e-3));
    }

    #[test]
    fn sheets_that_meet_in_a_cell_share_no_edge() {
        // Two crossing rods with a small gap between them, at 40 offsets against the grid.
        for i in 0..40 {
            let shift = Vec3::new(0.13, 0.29, 0.37) * i as f32;
            let a = capsule(shift, shift + Vec3::new(10.0, 10.0, 1.0), 1.1);
            let b = capsule(shift + Vec3::new(0.0, 10.0, 2.3), shift + Vec3::new(10.0, 0.0, 2.6), 1.1);
            let both = union([a, b]);
            let mesh = mesh(&both, 1.0);
            assert_eq!(mesh.triangles.len(), count_triangles(&both, 1.0));
            let mut edges = std::collections::HashMap::new();
            for &[a, b, c] in &mesh.triangles {
                for edge in [[a, b], [b, c], [c, a]] {
                    *edges.entry(edge).or_insert(0) += 1;
                }
            }
            assert!(edges.iter().all(|(&[a, b], &n)| n == 1 && edges.get(&[b, a]) == Some(&1)), "shift {i}");
        }
    }
}
