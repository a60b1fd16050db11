//! Edges of a mesh: open ones, edges of too many triangles, and inconsistently wound ones.

use std::collections::HashMap;

use glam::Vec3;
use rayon::slice::ParallelSliceMut;

use super::finding::{Defect, Finding, Region};
use crate::anatomy::Mesh;
use crate::anatomy::groups::Groups;

/// Largest gap, mm, between rims that were meant to be joined; at most a quarter of the open edges' mean length.
const SEAM_MM: f32 = 0.01;

/// Edge of a triangle, with its vertices in order of index.
#[derive(Clone, Copy, PartialEq, Eq, PartialOrd, Ord)]
struct Edge {
    low: u32,
    high: u32,
    triangle: u32,
    /// Whether the triangle runs along the edge from the higher vertex to the lower.
    back: bool,
}

/// Result of [`examine`].
pub(super) struct Edges {
    pub(super) findings: Vec<Finding>,
    /// Whether the surface has an inside: no edge is open and the winding is consistent.
    pub(super) closed: bool,
    /// Number of edges that are open, inconsistently wound, or shared by too many triangles.
    pub(super) unpaired: usize,
    /// Open edges as pairs of vertices, in the direction of their triangles.
    pub(super) open: Vec<[u32; 2]>,
    /// Index of each triangle's part: a component connected over edges of two triangles.
    pub(super) part: Vec<u32>,
}

/// Examines all edges of a mesh whose coincident vertices are merged.
pub(super) fn examine(mesh: &Mesh) -> Edges {
    let mut edges: Vec<Edge> = Vec::with_capacity(3 * mesh.triangles.len());
    for (&[a, b, c], triangle) in mesh.triangles.iter().zip(0u32..) {
        let edge = |(from, to): (u32, u32)| Edge { low: from.min(to), high: from.max(to), triangle, back: from > to };
        edges.extend([(a, b), (b, c), (c, a)].map(edge));
    }
    edges.par_sort_unstable();
    let mut parts = Groups::new(mesh.triangles.len());
    let (mut open, mut crowded, mut turned) = (Vec::new(), Vec::new(), Vec::new());
    let mut unbalanced = 0;
    for group in edges.chunk_by(|a, b| (a.low, a.high) == (b.low, b.high)) {
        let balanced = 2 * group.iter().filter(|e| e.back).count() == group.len();
        match group {
            [edge] => open.push(if edge.back { [edge.high, edge.low] } else { [edge.low, edge.high] }),
            [a, b] => {
                parts.join(a.triangle, b.triangle);
                if !balanced {
                    turned.push([a.low, a.high]);
                }
            }
            [first, ..] => {
                unbalanced += usize::from(!balanced);
                crowded.push([first.low, first.high]);
            }
            [] => {}
        }
    }
    let unpaired = open.len() + turned.len() + unbalanced;
    let mut findings = Vec::new();
    let seam = seam(mesh, &open);
    if seam.len() < open.len() {
        let joined: std::collections::HashSet<_> = seam.iter().collect();
        let gone: Vec<_> = open.iter().filter(|edge| !joined.contains(edge)).copied().collect();
        let what = format!("{} rim edges lie on others within {SEAM_MM} mm and are not joined to them", gone.len());
        findings.push(Finding::new(Defect::Unwelded, what).at(regions(mesh, &gone)));
    }
    if !seam.is_empty() {
        let holes = regions(mesh, &seam);
        let what = format!("not closed: {} open edges about {} holes", seam.len(), holes.len());
        findings.push(Finding::new(Defect::Open, what).at(holes));
    }
    if !turned.is_empty() {
        let what = format!("{} edges between triangles of which one is turned over", turned.len());
        findings.push(Finding::new(Defect::MixedOrientation, what).at(regions(mesh, &turned)));
    }
    if unbalanced > 0 {
        let what =
            format!("{} edges of three or more triangles, {unbalanced} of them with no clear inside", crowded.len());
        let mut finding = Finding::new(Defect::NonManifold, what).at(regions(mesh, &crowded));
        finding.severity = super::Severity::Error;
        findings.push(finding);
    } else if !crowded.is_empty() {
        let what = format!("{} edges of four or more triangles", crowded.len());
        findings.push(Finding::new(Defect::NonManifold, what).at(regions(mesh, &crowded)));
    }
    Edges { findings, closed: unpaired == 0, unpaired, open, part: parts.numbered() }
}

/// Edges of `open` that have no partner even after nearly coincident rim vertices are merged.
fn seam(mesh: &Mesh, open: &[[u32; 2]]) -> Vec<[u32; 2]> {
    let at = |i: u32| mesh.vertices_mm[i as usize];
    let mean = open.iter().map(|&[a, b]| f64::from(at(a).distance(at(b)))).sum::<f64>() / open.len().max(1) as f64;
    let tolerance = SEAM_MM.min(0.25 * mean as f32).max(f32::MIN_POSITIVE);
    let mut rim: Vec<u32> = open.iter().flatten().copied().collect();
    rim.sort_unstable();
    rim.dedup();
    let cell = |v: Vec3| (v / tolerance).floor().as_i64vec3();
    let mut cells: HashMap<_, Vec<u32>> = HashMap::new();
    let mut same: HashMap<u32, u32> = HashMap::with_capacity(rim.len());
    for vertex in rim {
        let here = cell(at(vertex));
        let around = (0..27).map(|i| here + glam::I64Vec3::new(i % 3 - 1, i / 3 % 3 - 1, i / 9 - 1));
        let near = |&&other: &&u32| at(other).distance(at(vertex)) <= tolerance;
        let found = around.filter_map(|key| cells.get(&key)?.iter().find(near).copied()).next();
        same.insert(vertex, found.unwrap_or(vertex));
        if found.is_none() {
            cells.entry(here).or_default().push(vertex);
        }
    }
    let joined = |[a, b]: [u32; 2]| [same.get(&a).copied().unwrap_or(a), same.get(&b).copied().unwrap_or(b)];
    let mut balance: HashMap<[u32; 2], i32> = HashMap::with_capacity(open.len());
    for &edge in open {
        let [a, b] = joined(edge);
        *balance.entry([a.min(b), a.max(b)]).or_default() += if a < b { 1 } else { -1 };
    }
    let stays = |edge: &&[u32; 2]| {
        let [a, b] = joined(**edge);
        a != b && balance.get(&[a.min(b), a.max(b)]).is_some_and(|&n| n != 0)
    };
    open.iter().filter(stays).copied().collect()
}

/// Region of each connected group of edges, the largest first.
fn regions(mesh: &Mesh, edges: &[[u32; 2]]) -> Vec<Region> {
    let mut index_of = HashMap::new();
    for &vertex in edges.iter().flatten() {
        let next = index_of.len() as u32;
        index_of.entry(vertex).or_insert(next);
    }
    let mut groups = Groups::new(index_of.len());
    edges.iter().for_each(|[a, b]| groups.join(index_of[a], index_of[b]));
    let group = groups.numbered();
    let mut points: HashMap<u32, Vec<Vec3>> = HashMap::new();
    for (vertex, &index) in &index_of {
        points.entry(group[index as usize]).or_default().push(mesh.vertices_mm[*vertex as usize]);
    }
    let mut regions: Vec<Region> = points.into_values().map(Region::of).collect();
    // Sorted, since a hash map has no defined order.
    let key = |p: &Region| (p.size_mm, p.at_mm);
    regions.sort_by(|a, b| key(b).partial_cmp(&key(a)).unwrap_or(std::cmp::Ordering::Equal));
    regions
}
