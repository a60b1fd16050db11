//! Filling of holes one by one.

use std::collections::HashSet;

use glam::DVec3;

use super::edges::{of, undirected};
use super::planes::Plane;
use super::polygon::{self, Border};
use super::work::{Work, area};

/// Largest number of edges of a hole that is filled with the least area.
const LEAST_AREA_EDGES: usize = 300;

/// Penalty of an edge that exists already, mm: more than any distance.
const TAKEN_MM: f64 = 1e9;

/// Fills holes, each with triangles between its own corners where possible.
pub(super) struct Filler {
    /// Existing edges between corners of holes. New triangles must not use them again.
    taken: HashSet<[u32; 2]>,
}

impl Filler {
    /// A filler for `holes`, each given by its vertices.
    pub(super) fn new(work: &Work, holes: &[Vec<u32>]) -> Self {
        let mut is_rim = vec![false; work.mesh.vertices_mm.len()];
        holes.iter().flatten().for_each(|&vertex| is_rim[vertex as usize] = true);
        let edges = work.mesh.triangles.iter().flat_map(|t| of(*t));
        let taken = edges.filter(|edge| edge.iter().all(|v| is_rim[*v as usize])).map(undirected).collect();
        Self { taken }
    }

    /// Whether an edge exists already.
    pub(super) fn is_taken(&self, edge: [u32; 2]) -> bool {
        self.taken.contains(&undirected(edge))
    }

    /// Fills one hole.
    pub(super) fn fill(&mut self, work: &mut Work, hole: &[u32]) {
        let points: Vec<DVec3> = hole.iter().map(|&vertex| work.at(vertex)).collect();
        let is_taken = |a: usize, b: usize| self.is_taken([hole[a], hole[b]]);
        let filled = if hole.len() <= LEAST_AREA_EDGES {
            least_area(&points, &is_taken).map(|triangles| triangles.into_iter().map(|t| t.map(|i| hole[i])).collect())
        } else {
            self.in_plane(work, hole, &points).or_else(|| Some(self.ears(hole, &points)))
        };
        let triangles: Vec<[u32; 3]> = filled.unwrap_or_else(|| fan(work, hole, &points));
        self.taken.extend(triangles.iter().flat_map(|t| of(*t)).map(undirected));
        work.mesh.triangles.extend(triangles);
    }

    /// Triangulation in the hole's mean plane; `None` if the projected outline crosses itself, or it needs an edge that
    /// exists.
    fn in_plane(&self, work: &Work, hole: &[u32], points: &[DVec3]) -> Option<Vec<[u32; 3]>> {
        let plane = Plane { normal: newell(points).try_normalize()?, offset_mm: 0.0 };
        let triangles = polygon::triangulate(&borders(hole), &plane, |vertex| work.at(vertex))?;
        let rim: HashSet<[u32; 2]> = borders(hole).iter().map(|b| undirected([b.from, b.to])).collect();
        let mut inner = triangles.iter().flat_map(|t| of(*t)).map(undirected).filter(|edge| !rim.contains(edge));
        (!inner.any(|edge| self.taken.contains(&edge))).then_some(triangles)
    }

    /// Triangulation by ear clipping: repeatedly cuts off the corner whose new edge is shortest.
    fn ears(&self, hole: &[u32], points: &[DVec3]) -> Vec<[u32; 3]> {
        let mut left: Vec<usize> = (0..hole.len()).collect();
        let around = |left: &[usize], i: usize| {
            let count = left.len();
            [left[(i + count - 1) % count], left[i], left[(i + 1) % count]]
        };
        let cost = |[a, _, c]: [usize; 3]| {
            points[a].distance(points[c]) + if self.is_taken([hole[a], hole[c]]) { TAKEN_MM } else { 0.0 }
        };
        let mut costs: Vec<f64> = (0..hole.len()).map(|i| cost(around(&left, i))).collect();
        let mut triangles = Vec::with_capacity(hole.len());
        while left.len() > 3 {
            let best = (0..costs.len()).min_by(|a, b| costs[*a].total_cmp(&costs[*b])).unwrap_or(0);
            triangles.push(around(&left, best).map(|i| hole[i]));
            left.remove(best);
            costs.remove(best);
            for i in [(best + left.len() - 1) % left.len(), best % left.len()] {
                costs[i] = cost(around(&left, i));
            }
        }
        if let [a, b, c] = left[..] {
            triangles.push([a, b, c].map(|i| hole[i]));
        }
        triangles
    }
}

/// Edges of a hole as directed borders.
pub(super) fn borders(hole: &[u32]) -> Vec<Border> {
    let next = hole.iter().cycle().skip(1);
    hole.iter().zip(next).map(|(&from, &to)| Border { from, to, directed: true }).collect()
}

/// Normal of a polygon, with twice its area as the length (Newell).
pub(super) fn newell(points: &[DVec3]) -> DVec3 {
    let origin = points.first().copied().unwrap_or_default();
    let next = points.iter().cycle().skip(1);
    points.iter().zip(next).map(|(a, b)| (*a - origin).cross(*b - origin)).sum()
}

/// Triangulation of a closed polygon in space with the least area, by dynamic programming (Barequet & Sharir, Comput
/// Aided Geom Des 12:207, 1995). `None` if every triangulation needs an edge that is taken.
fn least_area(points: &[DVec3], is_taken: &dyn Fn(usize, usize) -> bool) -> Option<Vec<[usize; 3]>> {
    let n = points.len();
    let at = |i: usize, k: usize| i * n + k;
    let mut cost = vec![0.0f64; n * n];
    let mut middle = vec![0usize; n * n];
    for length in 2..n {
        for i in 0..n - length {
            let k = i + length;
            // The longest chord is an edge of the polygon, so it may exist.
            if length < n - 1 && is_taken(i, k) {
                cost[at(i, k)] = f64::INFINITY;
                continue;
            }
            let through = |m: usize| cost[at(i, m)] + cost[at(m, k)] + area([points[i], points[m], points[k]]);
            let mut best = (f64::INFINITY, i + 1);
            for m in i + 1..k {
                let total = through(m);
                if total < best.0 {
                    best = (total, m);
                }
            }
            (cost[at(i, k)], middle[at(i, k)]) = best;
        }
    }
    if !cost[at(0, n - 1)].is_finite() {
        return None;
    }
    let mut triangles = Vec::with_capacity(n);
    let mut open = vec![(0, n - 1)];
    while let Some((i, k)) = open.pop() {
        if k - i < 2 {
            continue;
        }
        let m = middle[at(i, k)];
        triangles.push([i, m, k]);
        open.extend([(i, m), (m, k)]);
    }
    Some(triangles)
}

/// Triangles from each edge of the hole to a new vertex in its middle.
fn fan(work: &mut Work, hole: &[u32], points: &[DVec3]) -> Vec<[u32; 3]> {
    let centre = work.push(points.iter().sum::<DVec3>() / points.len() as f64);
    borders(hole).iter().map(|border| [border.from, border.to, centre]).collect()
}

#[cfg(test)]
mod tests {
    use insonify_core::anatomy::Mesh;

    use super::super::edges;
    use super::*;

    #[test]
    fn a_bent_square_is_filled_over_its_shorter_diagonal() {
        let points = [[0.0, 0.0, 0.0], [1.0, 0.0, 1.0], [1.0, 1.0, 0.0], [0.0, 1.0, 1.0]].map(DVec3::from_array);
        let free = least_area(&points, &|_, _| false).unwrap();
        assert_eq!(free.len(), 2);
        // If one diagonal of a quadrilateral is taken, the other is used; if both are, there is no triangulation.
        let first = least_area(&points, &|a, b| (a.min(b), a.max(b)) == (0, 2)).unwrap();
        assert!(first.iter().all(|t| t.contains(&1) && t.contains(&3)));
        assert!(least_area(&points, &|_, _| true).is_none());
    }

    #[test]
    fn a_hole_whose_diagonals_are_taken_gets_a_new_middle() {
        let vertices_mm = [[0.0, 0.0, 0.0], [1.0, 0.0, 0.0], [1.0, 1.0, 0.0], [0.0, 1.0, 0.0]].map(glam::Vec3::from);
        let mut work = Work::new(Mesh { vertices_mm: vertices_mm.to_vec(), triangles: vec![] });
        let mut filler = Filler { taken: HashSet::from([[0, 2], [1, 3]]) };
        filler.fill(&mut work, &[0, 1, 2, 3]);
        assert_eq!((work.mesh.triangles.len(), work.mesh.vertices_mm.len()), (4, 5));
    }

    #[test]
    fn a_long_wavy_rim_is_filled_completely() {
        let count = 1000u32;
        let point = |i: u32| {
            let angle = std::f64::consts::TAU * f64::from(i) / f64::from(count);
            DVec3::new(angle.cos() * 50.0, angle.sin() * 50.0, (5.0 * angle).sin() * 20.0)
        };
        let vertices_mm = (0..count).map(|i| point(i).as_vec3()).collect();
        let mut work = Work::new(Mesh { vertices_mm, triangles: vec![] });
        let hole: Vec<u32> = (0..count).collect();
        Filler { taken: HashSet::new() }.fill(&mut work, &hole);
        assert_eq!(work.mesh.triangles.len(), 998);
        let rim: HashSet<[u32; 2]> = edges::open(&work.mesh.triangles).into_iter().collect();
        assert!(borders(&hole).iter().all(|b| rim.contains(&[b.from, b.to])));
    }
}
