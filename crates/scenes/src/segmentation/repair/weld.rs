//! Joining of coincident vertices.

use glam::DVec3;

use super::edges::{self, undirected};
use super::report::ActionKind;
use super::work::{Work, region};

/// Direction along which vertices are sorted. It is parallel to no axis and no common diagonal, so few vertices of a
/// grid have the same coordinate along it.
const SLANTED: DVec3 = DVec3::new(0.361, 0.829, 0.427);

/// Joins all vertices at most `within_mm` apart, then vertices of rims at most `rims_within_mm` apart. The latter
/// distance is limited to a quarter of the mean rim edge.
pub(super) fn weld(work: &mut Work, within_mm: f64, rims_within_mm: f64) {
    let all: Vec<u32> = (0..work.mesh.vertices_mm.len() as u32).collect();
    join(work, all, within_mm, &[]);
    let open = edges::open(&work.mesh.triangles);
    if open.is_empty() {
        return;
    }
    let mean = open.iter().map(|&[a, b]| work.at(a).distance(work.at(b))).sum::<f64>() / open.len() as f64;
    let mut joined: Vec<[u32; 2]> = open.iter().copied().map(undirected).collect();
    joined.sort_unstable();
    let mut rim: Vec<u32> = open.into_iter().flatten().collect();
    rim.sort_unstable();
    rim.dedup();
    join(work, rim, rims_within_mm.min(0.25 * mean), &joined);
}

/// Joins each of the vertices `candidates` with the first one at most `within_mm` away. The two ends of an edge in
/// `apart` (sorted) are not joined: short edges along a rim are part of its shape.
fn join(work: &mut Work, candidates: Vec<u32>, within_mm: f64, apart: &[[u32; 2]]) {
    let mut along: Vec<(f64, u32)> = candidates.into_iter().map(|v| (work.at(v).dot(SLANTED), v)).collect();
    along.sort_unstable_by(|a, b| a.0.total_cmp(&b.0).then(a.1.cmp(&b.1)));
    // `SLANTED` is not exactly of unit length.
    let reach = within_mm * 1.01;
    let mut target: Vec<u32> = (0..work.mesh.vertices_mm.len() as u32).collect();
    let mut joined = Vec::new();
    let mut farthest: f64 = 0.0;
    for (i, &(height, vertex)) in along.iter().enumerate() {
        if target[vertex as usize] != vertex {
            continue;
        }
        for &(next, other) in &along[i + 1..] {
            if next - height > reach {
                break;
            }
            let distance = work.at(vertex).distance(work.at(other));
            let is_apart = || apart.binary_search(&undirected([vertex, other])).is_ok();
            if target[other as usize] == other && distance <= within_mm && !is_apart() {
                target[other as usize] = vertex;
                joined.push(other);
                farthest = farthest.max(distance);
            }
        }
    }
    if joined.is_empty() {
        return;
    }
    work.joined_mm += farthest as f32;
    work.mesh.triangles.iter_mut().flatten().for_each(|vertex| *vertex = target[*vertex as usize]);
    let region = region(joined.iter().map(|&vertex| work.mesh.vertices_mm[vertex as usize]));
    work.log(ActionKind::Joined, joined.len(), [region]);
}
