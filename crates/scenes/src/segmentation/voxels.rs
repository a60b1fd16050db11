//! Voxels within closed surfaces.

use glam::{DAffine3, DVec3};
use insonify_core::anatomy::{Bounds, Mesh};
use rayon::prelude::*;

use super::grid::Grid;

/// Offset of the test lines from voxel centres, in voxels. With this offset, the lines miss the corners and edges of
/// most meshes.
const ASIDE: [f64; 2] = [0.017_31, 0.023_77];

/// Largest number of voxels of a grid.
const VOXELS_MAX: f64 = 5e8;

/// Grid with voxels of `voxel_mm` around `meshes` (LPS), with a margin of `margin` voxels, and the mask of the voxels
/// that any of the meshes encloses. `None` without a vertex, or for more than 500 million voxels.
pub fn voxels_within(meshes: &[&Mesh], voxel_mm: f64, margin: usize) -> Option<(Grid, Vec<bool>)> {
    let bounds = meshes.iter().filter_map(|mesh| mesh.bounds_mm()).reduce(|a, b| Bounds::with(a.with(b.min), b.max))?;
    let low = bounds.min.as_dvec3() - voxel_mm * margin as f64;
    let span = (bounds.max - bounds.min).as_dvec3() / voxel_mm;
    let size: [usize; 3] = std::array::from_fn(|n| span[n].ceil() as usize + 2 * margin + 1);
    if size.iter().map(|&n| n as f64).product::<f64>() > VOXELS_MAX {
        return None;
    }
    let grid =
        Grid { size, lps_from_voxel: DAffine3::from_translation(low) * DAffine3::from_scale(DVec3::splat(voxel_mm)) };
    let inside = inside_of(meshes, &grid);
    Some((grid, inside))
}

/// Mask of the voxels of `grid` that any of `meshes` encloses.
pub fn inside_of(meshes: &[&Mesh], grid: &Grid) -> Vec<bool> {
    let mut inside = vec![false; grid.len()];
    for mesh in meshes {
        let columns = crossings(mesh, grid);
        let layer = grid.size[0] * grid.size[1];
        inside.par_chunks_mut(layer).enumerate().for_each(|(z, slice)| {
            let height = z as f64;
            for (voxel, column) in slice.iter_mut().zip(&columns) {
                let turns: i32 = column.iter().filter(|(at, _)| *at > height).map(|(_, turn)| turn).sum();
                *voxel |= turns != 0;
            }
        });
    }
    inside
}

/// Crossings of the mesh by the test line of each column of voxels along k: height in voxels, and 1 if the upward line
/// leaves the mesh or −1 if the line enters.
fn crossings(mesh: &Mesh, grid: &Grid) -> Vec<Vec<(f64, i32)>> {
    let [nx, ny, _] = grid.size;
    let mut columns = vec![Vec::new(); nx * ny];
    let voxel_from_lps = grid.lps_from_voxel.inverse();
    for corners in mesh.corners_mm() {
        let [a, b, c] = corners.map(|v| voxel_from_lps.transform_point3(v.as_dvec3()));
        let cross = (b - a).truncate().perp_dot((c - a).truncate());
        if cross == 0.0 {
            continue;
        }
        let (low, high) = (a.min(b).min(c), a.max(b).max(c));
        let range = |axis: usize, count: usize| {
            let from = (low[axis] - ASIDE[axis]).ceil().max(0.0) as usize;
            let to = (high[axis] - ASIDE[axis]).floor().min(count as f64 - 1.0);
            from..(to + 1.0).max(0.0) as usize
        };
        for y in range(1, ny) {
            for x in range(0, nx) {
                let p = DVec3::new(x as f64 + ASIDE[0], y as f64 + ASIDE[1], 0.0).truncate();
                let side = |u: DVec3, v: DVec3| (v.truncate() - u.truncate()).perp_dot(p - u.truncate()) / cross;
                let [wa, wb, wc] = [side(b, c), side(c, a), side(a, b)];
                if wa >= 0.0 && wb >= 0.0 && wc > 0.0 {
                    let turn = if cross > 0.0 { 1 } else { -1 };
                    columns[y * nx + x].push((wa * a.z + wb * b.z + wc * c.z, turn));
                }
            }
        }
    }
    columns
}

#[cfg(test)]
mod tests {
    use glam::Vec3;
    use insonify_core::anatomy::analytic::{cuboid, sphere};

    use super::*;

    #[test]
    fn voxels_lie_within_a_ball_and_a_box() {
        let (ball, block) =
            (sphere(Vec3::new(5.0, -3.0, 40.0), 20.0, 5), cuboid(Vec3::splat(-30.0), Vec3::splat(-20.0)));
        let (grid, inside) = voxels_within(&[&ball, &block], 1.5, 3).unwrap();
        let mut wrong = 0;
        for (i, &inside) in inside.iter().enumerate() {
            let p = grid.lps_from_voxel.transform_point3(DVec3::from_array(grid.at(i).map(|v| v as f64)));
            let from_ball = p.distance(DVec3::new(5.0, -3.0, 40.0)) - 20.0;
            let from_block = (p - DVec3::splat(-25.0)).abs().max_element() - 5.0;
            let distance = from_ball.min(from_block);
            wrong += usize::from(distance.abs() > 0.15 && inside != (distance < 0.0));
        }
        assert_eq!(wrong, 0);
        assert!(voxels_within(&[&Mesh::default()], 1.0, 1).is_none());
    }
}
