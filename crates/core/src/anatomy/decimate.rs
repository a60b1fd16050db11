//! Mesh simplification for pictures by vertex clustering on a grid (Rossignac and Borrel 1993).
//!
//! Vertices move by less than a cell's diagonal, but the result may be open: never render ultrasound from it.

use std::collections::{HashMap, HashSet};

use glam::{DVec3, Vec3};

use super::Mesh;

/// Meshes of fewer triangles than this are left unchanged.
const SMALL: usize = 400;

/// `mesh` with all vertices in the same cubic cell of side `cell_mm` merged into their mean.
pub fn cluster(mesh: &Mesh, cell_mm: f32) -> Mesh {
    if mesh.triangles.len() < SMALL || cell_mm <= 0.0 {
        return mesh.clone();
    }
    let mut cells: HashMap<[i32; 3], u32> = HashMap::new();
    let mut sums: Vec<(DVec3, f64)> = Vec::new();
    let cell_of = |v: Vec3| (v / cell_mm).floor().as_ivec3().to_array();
    let merged: Vec<u32> = mesh
        .vertices_mm
        .iter()
        .map(|&v| {
            let index = *cells.entry(cell_of(v)).or_insert_with(|| {
                sums.push((DVec3::ZERO, 0.0));
                (sums.len() - 1) as u32
            });
            let (sum, count) = &mut sums[index as usize];
            *sum += v.as_dvec3();
            *count += 1.0;
            index
        })
        .collect();
    let mut known = HashSet::new();
    let mut triangles = Vec::new();
    for &triangle in &mesh.triangles {
        let [a, b, c] = triangle.map(|i| merged[i as usize]);
        // The lowest index comes first, so that repeated triangles list their corners in the same order.
        let mut turned = [a, b, c];
        let first = turned.iter().position(|&i| i == a.min(b).min(c));
        turned.rotate_left(first.unwrap_or(0));
        if a != b && b != c && c != a && known.insert(turned) {
            triangles.push(turned);
        }
    }
    Mesh { vertices_mm: sums.into_iter().map(|(sum, count)| (sum / count).as_vec3()).collect(), triangles }
}

/// Clusters all meshes on one grid, down to approximately `triangles_max` triangles in total. Returns the meshes and
/// the side of the cells, mm; 0 if no mesh was changed.
pub fn cluster_to(meshes: &[&Mesh], triangles_max: usize) -> (Vec<Mesh>, f32) {
    let count = |meshes: &mut dyn Iterator<Item = &Mesh>| meshes.map(|m| m.triangles.len()).sum::<usize>();
    if count(&mut meshes.iter().copied()) <= triangles_max {
        return (meshes.iter().map(|&m| m.clone()).collect(), 0.0);
    }
    // Area per triangle gives the length of an edge; cells of that size about halve the number of triangles.
    let area: f64 = meshes
        .iter()
        .flat_map(|m| m.corners_mm())
        .map(|[a, b, c]| f64::from((b - a).cross(c - a).length()) / 2.0)
        .sum();
    let mut cell_mm = (area / triangles_max.max(1) as f64).sqrt().max(1e-3) as f32;
    loop {
        let fewer: Vec<Mesh> = meshes.iter().map(|m| cluster(m, cell_mm)).collect();
        // The number of triangles may stop falling, since small meshes are never clustered.
        if count(&mut fewer.iter()) <= triangles_max || cell_mm > 1e4 {
            return (fewer, cell_mm);
        }
        cell_mm *= 1.25;
    }
}

#[cfg(test)]
mod tests {
    use super::*;
    use crate::anatomy::analytic::{cuboid, sphere};

    #[test]
    fn a_clustered_sphere_keeps_its_position_and_volume() {
        let (round, block) = (sphere(Vec3::new(5.0, 0.0, 70.0), 20.0, 5), cuboid(Vec3::ZERO, Vec3::ONE));
        let (fewer, cell_mm) = cluster_to(&[&round, &block], 3000);
        assert!(cell_mm > 0.0 && fewer[0].triangles.len() <= 3000 && fewer[0].triangles.len() > 500);
        assert!(fewer[1] == block, "small meshes stay");
        let far = |v: &Vec3| ((*v - Vec3::new(5.0, 0.0, 70.0)).length() - 20.0).abs();
        assert!(fewer[0].vertices_mm.iter().all(|v| far(v) < cell_mm));
        assert!((fewer[0].signed_volume_mm3() / round.signed_volume_mm3() - 1.0).abs() < 0.05);
        assert!(cluster_to(&[&round, &block], 1_000_000) == (vec![round, block], 0.0));
    }
}
