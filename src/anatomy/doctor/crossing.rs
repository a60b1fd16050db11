//! Triangles of one surface that pass through each other.

use glam::{DVec3, Vec3};
use rayon::prelude::*;

use super::RESOLUTION_MM;
use super::finding::Place;
use super::tree::Tree;

/// Crossings found in a surface.
pub(super) struct Crossings {
    pub(super) pairs: usize,
    /// Where all of them are, and one of them.
    pub(super) places: Vec<Place>,
}

/// Pairs of triangles that pass through each other by more than the tracer resolves.
pub(super) fn find(tree: &Tree<'_>) -> Crossings {
    let mesh = tree.mesh();
    let corners = |t: usize| mesh.triangles[t].map(|i| mesh.vertices_mm[i as usize]);
    let found: Vec<(u32, Vec3)> = (0..mesh.triangles.len())
        .into_par_iter()
        .with_min_len(256)
        .flat_map_iter(|t| {
            let mut points = Vec::new();
            tree.near(corners(t), |u| {
                let u = u as usize;
                if u > t
                    && let Some(point) = cross(mesh.triangles[t], mesh.triangles[u], corners(t), corners(u))
                {
                    points.push((t as u32, point));
                }
            });
            points
        })
        .collect();
    let mut places = Vec::new();
    if let Some(&(_, first)) = found.first() {
        places.push(Place::of(found.iter().map(|(_, point)| *point)));
        if found.len() > 1 {
            places.push(Place::of([first]));
        }
    }
    Crossings { pairs: found.len(), places }
}

/// Where two triangles cross, if they do.
fn cross(a: [u32; 3], b: [u32; 3], at: [Vec3; 3], bt: [Vec3; 3]) -> Option<Vec3> {
    let shared = a.iter().filter(|i| b.contains(i)).count();
    // Neighbours over an edge meet there alone.
    if shared > 1 {
        return None;
    }
    let (at, bt) = (at.map(|v| v.as_dvec3()), bt.map(|v| v.as_dvec3()));
    let through = |edges: [DVec3; 3], edge_of: [u32; 3], other: [u32; 3], triangle: [DVec3; 3]| {
        let normal = (triangle[1] - triangle[0]).cross(triangle[2] - triangle[0]).try_normalize()?;
        let height = edges.map(|p| normal.dot(p - triangle[0]));
        (0..3).find_map(|i| {
            let j = (i + 1) % 3;
            // An edge from a shared corner starts on the other triangle.
            if other.contains(&edge_of[i]) || other.contains(&edge_of[j]) {
                return None;
            }
            let (low, high) = (height[i].min(height[j]), height[i].max(height[j]));
            if low > -RESOLUTION_MM || high < RESOLUTION_MM {
                return None;
            }
            let point = edges[i].lerp(edges[j], height[i] / (height[i] - height[j]));
            is_within(point, triangle, normal).then_some(point)
        })
    };
    through(at, a, b, bt).or_else(|| through(bt, b, a, at)).map(|p| p.as_vec3())
}

/// Whether a point of a triangle's plane is within it, farther from its edges than the tracer resolves.
fn is_within(point: DVec3, corners: [DVec3; 3], normal: DVec3) -> bool {
    (0..3).all(|i| {
        let (from, to) = (corners[i], corners[(i + 1) % 3]);
        (to - from).try_normalize().is_some_and(|along| normal.cross(along).dot(point - from) > RESOLUTION_MM)
    })
}
