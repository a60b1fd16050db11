//! Triangulation of flat regions with holes.

use std::collections::hash_map::Entry;
use std::collections::{HashMap, HashSet, VecDeque};

use glam::{DVec2, DVec3};
use spade::handles::FixedFaceHandle;
use spade::{ConstrainedDelaunayTriangulation, Point2, Triangulation};

use super::edges::{of, undirected};
use super::planes::Plane;

/// Coordinates smaller than this are set to zero, as the triangulation requires.
const TINY: f64 = 1e-30;

/// Border edge of a region in a plane.
#[derive(Debug, Clone, Copy)]
pub(super) struct Border {
    pub(super) from: u32,
    pub(super) to: u32,
    /// Whether the triangle at this edge must run from `from` to `to`; otherwise either direction will do.
    pub(super) directed: bool,
}

/// Triangles of the region of `plane` inside the `borders`, which form closed outlines. An outline within another is a
/// hole.
///
/// No vertices are added. `None` if the outlines cross or touch each other, so that they enclose no clear region.
pub(super) fn triangulate(borders: &[Border], plane: &Plane, at: impl Fn(u32) -> DVec3) -> Option<Vec<[u32; 3]>> {
    let across = plane.normal.any_orthonormal_vector();
    let up = plane.normal.cross(across);
    let mut cdt = ConstrainedDelaunayTriangulation::<Point2<f64>>::new();
    let mut handle_of = HashMap::new();
    let mut vertex_of = HashMap::new();
    let origin = at(borders.first()?.from);
    for vertex in borders.iter().flat_map(|border| [border.from, border.to]) {
        if handle_of.contains_key(&vertex) {
            continue;
        }
        let out = at(vertex) - origin;
        let flat = DVec2::new(out.dot(across), out.dot(up));
        let [x, y] = flat.to_array().map(|c| if c.abs() < TINY { 0.0 } else { c });
        let handle = cdt.insert(Point2::new(x, y)).ok()?;
        // Two coincident vertices: the outline touches itself.
        if vertex_of.insert(handle, vertex).is_some() {
            return None;
        }
        handle_of.insert(vertex, handle);
    }
    let mut outline = HashSet::new();
    for border in borders {
        let (from, to) = (*handle_of.get(&border.from)?, *handle_of.get(&border.to)?);
        if !outline.insert(undirected([border.from, border.to])) || !cdt.can_add_constraint(from, to) {
            return None;
        }
        cdt.add_constraint(from, to);
    }
    if cdt.num_constraints() != outline.len() {
        // An edge of the outline passes through a vertex.
        return None;
    }
    let triangles = inside(&cdt).into_iter().map(|face| {
        let corners = cdt.face(face).vertices().map(|v| vertex_of.get(&v.fix()).copied());
        Some([corners[0]?, corners[1]?, corners[2]?])
    });
    let triangles = triangles.collect::<Option<Vec<[u32; 3]>>>()?;
    let triangles = along(borders, triangles);
    is_bordered_by(&triangles, &outline).then_some(triangles)
}

/// Faces inside the outlines. A path to them from outside crosses an odd number of outline edges.
fn inside(cdt: &ConstrainedDelaunayTriangulation<Point2<f64>>) -> Vec<FixedFaceHandle<spade::handles::InnerTag>> {
    let mut is_inside = HashMap::new();
    let mut queue = VecDeque::new();
    for edge in cdt.convex_hull() {
        // On one side of a hull edge is the outer face; the face on its other side is taken.
        let edge = if edge.face().is_outer() { edge.rev() } else { edge };
        if let Some(face) = edge.face().as_inner() {
            let odd = edge.is_constraint_edge();
            if is_inside.insert(face.fix(), odd).is_none() {
                queue.push_back(face.fix());
            }
        }
    }
    while let Some(face) = queue.pop_front() {
        let odd = is_inside.get(&face).copied().unwrap_or(false);
        for edge in cdt.face(face).adjacent_edges() {
            let Some(next) = edge.rev().face().as_inner() else { continue };
            if let Entry::Vacant(slot) = is_inside.entry(next.fix()) {
                slot.insert(odd != edge.is_constraint_edge());
                queue.push_back(next.fix());
            }
        }
    }
    // Faces are listed in the order of the triangulation, not of the hash map.
    let faces = cdt.inner_faces().map(|face| face.fix());
    faces.filter(|face| is_inside.get(face).copied().unwrap_or(false)).collect()
}

/// Turns over each connected region of triangles that runs against most of its directed borders.
fn along(borders: &[Border], mut triangles: Vec<[u32; 3]>) -> Vec<[u32; 3]> {
    let directed: HashSet<[u32; 2]> = borders.iter().filter(|b| b.directed).map(|b| [b.from, b.to]).collect();
    let edges = super::edges::sorted(&triangles);
    let region = super::edges::components(triangles.len(), &edges);
    let mut votes = vec![0i64; region.iter().max().map_or(0, |&last| last as usize + 1)];
    for (triangle, &index) in triangles.iter().zip(&region) {
        for [from, to] in of(*triangle) {
            votes[index as usize] += i64::from(directed.contains(&[from, to]));
            votes[index as usize] -= i64::from(directed.contains(&[to, from]));
        }
    }
    for (triangle, &index) in triangles.iter_mut().zip(&region) {
        if votes[index as usize] < 0 {
            triangle.swap(1, 2);
        }
    }
    triangles
}

/// Whether the open edges of the triangles are exactly the edges of the outline.
fn is_bordered_by(triangles: &[[u32; 3]], outline: &HashSet<[u32; 2]>) -> bool {
    let rim: Vec<[u32; 2]> = super::edges::open(triangles).into_iter().map(undirected).collect();
    rim.len() == outline.len() && rim.iter().all(|edge| outline.contains(edge))
}

#[cfg(test)]
mod tests {
    use super::*;

    fn square(first: u32, turned: bool) -> Vec<Border> {
        let edge = move |i: u32| {
            let (from, to) = (first + i, first + (i + 1) % 4);
            if turned { Border { from: to, to: from, directed: true } } else { Border { from, to, directed: true } }
        };
        (0..4).map(edge).collect()
    }

    fn corner(vertex: u32) -> DVec3 {
        let half = [2.0, 1.0][vertex as usize / 4];
        let [x, y] = [[-half, -half], [half, -half], [half, half], [-half, half]][vertex as usize % 4];
        DVec3::new(x, y, 5.0)
    }

    #[test]
    fn an_outline_in_another_is_a_hole() {
        let borders = [square(0, false), square(4, true)].concat();
        let plane = Plane { normal: DVec3::Z, offset_mm: 5.0 };
        let ring = triangulate(&borders, &plane, corner).unwrap();
        let area: f64 = ring.iter().map(|t| super::super::work::area(t.map(corner))).sum();
        assert!((area - 12.0).abs() < 1e-12, "{area}");
        let normal = |t: &[u32; 3]| (corner(t[1]) - corner(t[0])).cross(corner(t[2]) - corner(t[0])).z;
        assert!(ring.iter().all(|t| normal(t) > 0.0));
    }

    #[test]
    fn points_on_a_straight_border_stay_corners() {
        let at = |i: u32| [[0.0, 0.0], [1.0, 0.0], [2.0, 0.0], [3.0, 0.0], [3.0, 1.0], [0.0, 1.0]][i as usize];
        let borders: Vec<Border> = (0..6).map(|i| Border { from: i, to: (i + 1) % 6, directed: true }).collect();
        let plane = Plane { normal: DVec3::Z, offset_mm: 0.0 };
        let cap = triangulate(&borders, &plane, |i| DVec3::new(at(i)[0], at(i)[1], 0.0)).unwrap();
        assert_eq!(cap.len(), 4);
    }

    #[test]
    fn outlines_that_cross_are_refused() {
        let shifted = |vertex: u32| corner(vertex) + if vertex >= 4 { DVec3::X * 2.0 } else { DVec3::ZERO };
        let borders = [square(0, false), square(4, false)].concat();
        let plane = Plane { normal: DVec3::Z, offset_mm: 5.0 };
        assert!(triangulate(&borders, &plane, shifted).is_none());
    }
}
