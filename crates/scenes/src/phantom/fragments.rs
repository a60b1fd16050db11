//! Removal of fragments from a mesh: parts too small for its grid, and parts turned inside out by a fold.

use rayon::slice::ParallelSliceMut;

use insonify_core::anatomy::groups::Groups;
use insonify_core::anatomy::{Bounds, Mesh};

/// Volume below which a part is a fragment, in grid cells.
const FRAGMENT_CELLS: f64 = 0.25;

/// A connected component of the mesh.
#[derive(Debug, Clone)]
struct Part {
    signed_volume_mm3: f64,
    bounds: Bounds,
}

/// `mesh` without its fragments. The mesh was made from a grid of cells of `cell_mm`. Fragments are parts smaller than
/// a quarter of a cell, and inward-facing parts that no other part encloses. Cavities stay.
pub(super) fn without_fragments(mesh: Mesh, cell_mm: f32) -> Mesh {
    let part_of = parts_of_triangles(&mesh);
    let count = part_of.iter().max().map_or(0, |&last| last as usize + 1);
    let mut parts = vec![Part { signed_volume_mm3: 0.0, bounds: Bounds::EMPTY }; count];
    for (corners, &part) in mesh.corners_mm().zip(&part_of) {
        let part = &mut parts[part as usize];
        part.bounds = corners.into_iter().fold(part.bounds, Bounds::with);
        let [a, b, c] = corners.map(|v| v.as_dvec3());
        part.signed_volume_mm3 += a.dot(b.cross(c)) / 6.0;
    }
    let least_mm3 = FRAGMENT_CELLS * f64::from(cell_mm).powi(3);
    let large: Vec<&Part> = parts.iter().filter(|p| p.signed_volume_mm3 >= least_mm3).collect();
    let stays = |part: &Part| {
        part.signed_volume_mm3 >= least_mm3
            || part.signed_volume_mm3 <= -least_mm3 && large.iter().any(|outer| outer.bounds.holds(part.bounds))
    };
    let kept: Vec<bool> = parts.iter().map(stays).collect();
    // A surface that has only fragments is kept: otherwise an organ would vanish.
    if large.is_empty() || kept.iter().all(|&kept| kept) {
        return mesh;
    }
    let mut triangles = mesh.triangles;
    let mut part = part_of.iter();
    triangles.retain(|_| part.next().is_some_and(|&part| kept[part as usize]));
    let mut renumbered = vec![None; mesh.vertices_mm.len()];
    for i in triangles.iter().flatten() {
        renumbered[*i as usize] = Some(0);
    }
    let mut vertices_mm = Vec::with_capacity(mesh.vertices_mm.len());
    for (number, &vertex) in renumbered.iter_mut().zip(&mesh.vertices_mm) {
        if let Some(number) = number {
            *number = vertices_mm.len() as u32;
            vertices_mm.push(vertex);
        }
    }
    for i in triangles.iter_mut().flatten() {
        *i = renumbered[*i as usize].unwrap_or(0);
    }
    Mesh { vertices_mm, triangles }
}

/// For each triangle, the index of its part. Triangles that share an edge belong to one part; a shared vertex alone
/// does not connect them.
fn parts_of_triangles(mesh: &Mesh) -> Vec<u32> {
    let mut edges: Vec<([u32; 2], u32)> = (0u32..)
        .zip(&mesh.triangles)
        .flat_map(|(n, &[a, b, c])| [[a, b], [b, c], [c, a]].map(|[i, j]| ([i.min(j), i.max(j)], n)))
        .collect();
    edges.par_sort_unstable();
    let mut groups = Groups::new(mesh.triangles.len());
    for pair in edges.windows(2).filter(|pair| pair[0].0 == pair[1].0) {
        groups.join(pair[0].1, pair[1].1);
    }
    groups.numbered()
}

#[cfg(test)]
mod tests {
    use glam::Vec3;
    use insonify_core::anatomy::analytic::{joined, sphere};

    use super::*;

    fn inward(mut mesh: Mesh) -> Mesh {
        mesh.flip();
        mesh
    }

    #[test]
    fn fragments_and_folds_are_removed_and_cavities_and_small_parts_kept() {
        let ball = sphere(Vec3::ZERO, 10.0, 3);
        let cavity = inward(sphere(Vec3::new(2.0, 0.0, 0.0), 4.0, 2));
        let small = sphere(Vec3::new(30.0, 0.0, 0.0), 0.6, 2);
        let fragment = sphere(Vec3::new(0.0, 20.0, 0.0), 0.3, 2);
        let hollow_fragment = inward(sphere(Vec3::new(-5.0, 0.0, 0.0), 0.3, 2));
        let fold = inward(sphere(Vec3::new(0.0, 0.0, 40.0), 5.0, 2));
        let sound = [ball.clone(), cavity, small];
        let all = joined([std::slice::from_ref(&fragment), &sound[..], &[hollow_fragment, fold]].concat());
        assert_eq!(without_fragments(all, 1.0), joined(sound.clone()));
        assert_eq!(without_fragments(joined(sound.clone()), 1.0), joined(sound.clone()));
        // A fragment attached to the ball at one vertex.
        let mut hung = joined([ball.clone(), fragment.clone()]);
        let first = ball.vertices_mm.len() as u32;
        let meets = |i: u32| if i == first { 7 } else { i };
        hung.triangles.iter_mut().for_each(|t| *t = t.map(meets));
        assert_eq!(without_fragments(hung, 1.0), ball);
        // With finer cells the same part is no fragment.
        assert_eq!(without_fragments(joined([ball.clone(), fragment.clone()]), 0.5), joined([ball, fragment.clone()]));
        // Only a fragment.
        assert_eq!(without_fragments(fragment.clone(), 1.0), fragment);
        assert_eq!(without_fragments(Mesh::default(), 1.0), Mesh::default());
    }
}
