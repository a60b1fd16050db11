//! Decimation of a complex, the surfaces of all labels: edges are collapsed in the order of their error (Garland and
//! Heckbert 1997), to a sixteenth of it.
//!
//! A collapse changes no topology (link condition of Dey et al. 1999) and turns no face over. Junction lines, where
//! several surfaces join, stay in position. Vertices on a face of the grid stay in the plane of that face.

use glam::DVec3;
use rayon::prelude::*;

use super::bucket_queue::BucketQueue;
use super::complex::Complex;
use super::quadric::Quadric;
use super::smooth::Kind;

/// Smallest cosine of the angle between a face's normals before and after a collapse.
const TURN_MIN: f64 = 0.35;
/// Smallest quality of a face: 4√3 × area over the sum of its squared edges, 1 for an equilateral triangle.
const QUALITY_MIN: f64 = 0.08;
/// Weight of the planes that hold junction lines in position.
const LINE_WEIGHT: f64 = 4.0;

/// Edge in the queue, with the versions of its vertices at the time of queueing.
struct Candidate {
    edge: [u32; 2],
    versions: [u32; 2],
}

/// A possible collapse of an edge to a point.
struct Collapse {
    /// Vertex that stays and moves to `to_mm`, and vertex that is removed.
    stays: u32,
    goes: u32,
    to_mm: DVec3,
    cost: f64,
}

struct Decimation<'a> {
    complex: &'a mut Complex,
    quadrics: Vec<Quadric>,
    /// A third of the area of the faces around each vertex, mm².
    weights: Vec<f64>,
    /// Indices of the triangles at each vertex.
    around: Vec<Vec<u32>>,
    versions: Vec<u32>,
    gone: Vec<bool>,
    error_mm: f64,
}

impl Complex {
    /// Collapses edges until at most `triangles` are left, or every remaining collapse would move a surface by more
    /// than about `error_mm`. `progress` receives the completed share, 0..=1.
    pub fn decimate(&mut self, triangles: usize, error_mm: f64, progress: &dyn Fn(f64)) {
        let before = self.triangles.len();
        if before <= triangles {
            return;
        }
        let mut decimation = Decimation::of(self, error_mm);
        let mut queue = decimation.queue();
        let mut left = before;
        let mut scratch = Vec::new();
        while left > triangles {
            let Some(Candidate { edge, versions }) = queue.pop() else { break };
            let current = edge.map(|v| decimation.versions[v as usize]);
            if current != versions {
                continue;
            }
            let Some(collapse) = decimation.collapse(edge) else { continue };
            if !decimation.is_allowed(&collapse) {
                continue;
            }
            left -= decimation.apply(&collapse);
            decimation.neighbours(collapse.stays, &mut scratch);
            for &other in &scratch {
                decimation.push(&mut queue, [collapse.stays.min(other), collapse.stays.max(other)]);
            }
            if left % 8192 < 2 {
                progress((before - left) as f64 / (before - triangles) as f64);
            }
        }
        decimation.finish();
    }
}

impl<'a> Decimation<'a> {
    fn of(complex: &'a mut Complex, error_mm: f64) -> Self {
        let count = complex.vertices_mm.len();
        let mut around = vec![Vec::new(); count];
        for (n, triangle) in (0u32..).zip(&complex.triangles) {
            for &v in &triangle.corners {
                around[v as usize].push(n);
            }
        }
        let gone = vec![false; complex.triangles.len()];
        let mut this = Self {
            quadrics: Vec::new(),
            weights: Vec::new(),
            around,
            versions: vec![0; count],
            gone,
            error_mm,
            complex,
        };
        let sums: Vec<(Quadric, f64)> = (0..count).into_par_iter().map(|v| this.quadric_of(v as u32)).collect();
        (this.quadrics, this.weights) = sums.into_iter().unzip();
        this
    }

    fn at(&self, v: u32) -> DVec3 {
        self.complex.vertices_mm[v as usize]
    }

    fn area_vector(&self, triangle: u32) -> DVec3 {
        let [a, b, c] = self.complex.triangles[triangle as usize].corners.map(|v| self.at(v));
        0.5 * (b - a).cross(c - a)
    }

    /// Quadric of a vertex, and its weight. The quadric sums the planes of the faces. At a junction it also has planes
    /// along the junction lines, perpendicular to the faces.
    fn quadric_of(&self, v: u32) -> (Quadric, f64) {
        let mut sum = Quadric::default();
        let mut weight = 0.0;
        let point = self.at(v);
        for &n in &self.around[v as usize] {
            let area = self.area_vector(n);
            let length = area.length();
            if length <= 0.0 {
                continue;
            }
            let normal = area / length;
            sum += Quadric::plane(point, normal, length / 3.0);
            weight += length / 3.0;
            if self.complex.kinds[v as usize] == Kind::Surface {
                continue;
            }
            for &other in &self.complex.triangles[n as usize].corners {
                if other != v && self.is_junction([v, other]) {
                    let along = self.at(other) - point;
                    let across = along.cross(normal).normalize_or_zero();
                    sum += Quadric::plane(point, across, LINE_WEIGHT * along.length_squared() / 3.0);
                }
            }
        }
        (sum, weight)
    }

    /// Indices of the triangles at an edge.
    fn at_edge(&self, [a, b]: [u32; 2]) -> impl Iterator<Item = u32> + '_ {
        let holds = move |&n: &u32| self.complex.triangles[n as usize].corners.contains(&b);
        self.around[a as usize].iter().copied().filter(holds)
    }

    /// Whether surfaces between different pairs of labels join at the edge.
    fn is_junction(&self, edge: [u32; 2]) -> bool {
        let mut triangles = self.at_edge(edge);
        let (Some(first), Some(second), None) = (triangles.next(), triangles.next(), triangles.next()) else {
            return true;
        };
        let sorted = |n: u32| {
            let [a, b] = self.complex.triangles[n as usize].sides;
            [a.min(b), a.max(b)]
        };
        sorted(first) != sorted(second)
    }

    /// Puts the neighbours of a vertex into `found`, ascending.
    fn neighbours(&self, v: u32, found: &mut Vec<u32>) {
        found.clear();
        for &n in &self.around[v as usize] {
            found.extend(self.complex.triangles[n as usize].corners.iter().filter(|&&other| other != v));
        }
        found.sort_unstable();
        found.dedup();
    }

    fn queue(&self) -> BucketQueue<Candidate> {
        let edges = |v: u32| {
            let mut others = Vec::new();
            self.neighbours(v, &mut others);
            others.into_iter().filter(move |&other| other > v).map(move |other| [v, other])
        };
        let candidates: Vec<(f32, Candidate)> = (0..self.around.len() as u32)
            .into_par_iter()
            .flat_map_iter(edges)
            .filter_map(|edge| self.candidate(edge))
            .collect();
        let mut queue = BucketQueue::new();
        candidates.into_iter().for_each(|(cost, candidate)| queue.push(cost, candidate));
        queue
    }

    /// An edge that may be collapsed, with the cost of its collapse.
    fn candidate(&self, edge: [u32; 2]) -> Option<(f32, Candidate)> {
        let cost = self.collapse(edge)?.cost as f32;
        Some((cost, Candidate { edge, versions: edge.map(|v| self.versions[v as usize]) }))
    }

    fn push(&self, queue: &mut BucketQueue<Candidate>, edge: [u32; 2]) {
        if let Some((cost, candidate)) = self.candidate(edge) {
            queue.push(cost, candidate);
        }
    }

    /// The collapse of an edge; `None` if neither vertex may be removed, or the error is too large.
    fn collapse(&self, [a, b]: [u32; 2]) -> Option<Collapse> {
        let kind = |v: u32| self.complex.kinds[v as usize];
        let border = |v: u32| self.complex.borders[v as usize];
        let rank = |v: u32| kind(v) as u8;
        let (stays, goes) = if rank(a) >= rank(b) && border(a) & border(b) == border(b) {
            (a, b)
        } else if rank(b) >= rank(a) && border(a) & border(b) == border(a) {
            (b, a)
        } else {
            return None;
        };
        if kind(goes) == Kind::Corner || (kind(goes) == Kind::Line && !self.is_junction([a, b])) {
            return None;
        }
        let sum = self.quadrics[a as usize] + self.quadrics[b as usize];
        let free = kind(stays) == kind(goes) && border(stays) == border(goes);
        let mut to_mm = self.at(stays);
        if free {
            let middle = 0.5 * (self.at(a) + self.at(b));
            let mut best = sum.minimum(middle);
            // If the planes are nearly parallel, their common point may be far from the edge, and is not used.
            if best.distance(middle) > self.at(a).distance(self.at(b)) {
                best = middle;
            }
            let fixed = border(stays) | border(stays) >> 3;
            for axis in 0..3 {
                if fixed >> axis & 1 == 1 {
                    best[axis] = to_mm[axis];
                }
            }
            to_mm = best;
        }
        let weight = self.weights[a as usize] + self.weights[b as usize];
        let error = sum.at(to_mm);
        if error > self.error_mm * self.error_mm * weight {
            return None;
        }
        // In flat regions the error is zero, so short edges are collapsed first.
        let cost = error + 1e-4 * weight.min(1.0) * self.at(a).distance_squared(self.at(b));
        Some(Collapse { stays, goes, to_mm, cost })
    }

    /// Whether a collapse keeps the topology and turns no face over.
    fn is_allowed(&self, collapse: &Collapse) -> bool {
        let Collapse { stays, goes, to_mm, .. } = *collapse;
        let (mut of_stays, mut of_goes) = (Vec::new(), Vec::new());
        self.neighbours(stays, &mut of_stays);
        self.neighbours(goes, &mut of_goes);
        let common: Vec<u32> = of_goes.iter().copied().filter(|v| of_stays.binary_search(v).is_ok()).collect();
        let mut opposite: Vec<u32> = self
            .at_edge([stays, goes])
            .flat_map(|n| self.complex.triangles[n as usize].corners)
            .filter(|&v| v != stays && v != goes)
            .collect();
        let edges = opposite.len();
        opposite.sort_unstable();
        opposite.dedup();
        if opposite.len() != edges || common != opposite {
            return false;
        }
        // The collapse would merge two junction lines.
        if opposite.iter().any(|&v| self.is_junction([goes, v]) && self.is_junction([stays, v])) {
            return false;
        }
        // The collapse would fold a tetrahedron onto itself.
        let folds = self.around[goes as usize].iter().any(|&n| {
            let others = self.complex.triangles[n as usize].corners;
            let rim = others.iter().filter(|v| common.binary_search(v).is_ok()).count();
            rim == 2 && !others.contains(&stays) && {
                let rim: Vec<u32> = others.into_iter().filter(|&v| v != goes).collect();
                self.around[stays as usize]
                    .iter()
                    .any(|&m| rim.iter().all(|v| self.complex.triangles[m as usize].corners.contains(v)))
            }
        });
        !folds && self.keeps_sense(stays, goes, to_mm) && self.keeps_sense(goes, stays, to_mm)
    }

    /// Whether a move of `v` to `to_mm` keeps the orientation and enough quality of the faces at `v`, except the faces
    /// that contain `other`.
    fn keeps_sense(&self, v: u32, other: u32, to_mm: DVec3) -> bool {
        self.around[v as usize].iter().all(|&n| {
            let corners = self.complex.triangles[n as usize].corners;
            if corners.contains(&other) {
                return true;
            }
            let [a, b, c] = corners.map(|w| self.at(w));
            let [p, q, r] = corners.map(|w| if w == v { to_mm } else { self.at(w) });
            let before = (b - a).cross(c - a);
            let after = (q - p).cross(r - p);
            let edges =
                |a: DVec3, b: DVec3, c: DVec3| a.distance_squared(b) + b.distance_squared(c) + c.distance_squared(a);
            // Quality as in `QUALITY_MIN`: 2√3 × |cross| over the sum of the squared edges.
            let quality = |cross: DVec3, edges: f64| 3.464 * cross.length() / edges.max(1e-300);
            let (old, new) = (quality(before, edges(a, b, c)), quality(after, edges(p, q, r)));
            before.dot(after) > TURN_MIN * before.length() * after.length() && (new > QUALITY_MIN || new > old)
        })
    }

    /// Applies a collapse; returns the number of triangles removed.
    fn apply(&mut self, collapse: &Collapse) -> usize {
        let Collapse { stays, goes, to_mm, .. } = *collapse;
        let moved = std::mem::take(&mut self.around[goes as usize]);
        let mut went = 0;
        for n in moved {
            let corners = self.complex.triangles[n as usize].corners;
            if corners.contains(&stays) {
                self.gone[n as usize] = true;
                went += 1;
                for v in corners.into_iter().filter(|&v| v != goes) {
                    self.around[v as usize].retain(|&m| m != n);
                }
            } else {
                self.complex.triangles[n as usize].corners = corners.map(|v| if v == goes { stays } else { v });
                self.around[stays as usize].push(n);
            }
        }
        self.complex.vertices_mm[stays as usize] = to_mm;
        self.quadrics[stays as usize] = self.quadrics[stays as usize] + self.quadrics[goes as usize];
        self.weights[stays as usize] += self.weights[goes as usize];
        self.versions[stays as usize] += 1;
        self.versions[goes as usize] += 1;
        went
    }

    /// Removes the triangles and vertices that the collapses left unused.
    fn finish(self) {
        let Self { complex, gone, .. } = self;
        let mut gone = gone.into_iter();
        complex.triangles.retain(|_| !gone.next().unwrap_or(false));
        complex.drop_unused();
    }
}

impl Complex {
    /// Drops vertices without a triangle.
    fn drop_unused(&mut self) {
        let mut numbers = vec![u32::MAX; self.vertices_mm.len()];
        let mut kept = 0u32;
        for triangle in &self.triangles {
            for &v in &triangle.corners {
                numbers[v as usize] = 0;
            }
        }
        for (v, number) in numbers.iter_mut().enumerate() {
            if *number == 0 {
                *number = kept;
                self.vertices_mm[kept as usize] = self.vertices_mm[v];
                self.kinds[kept as usize] = self.kinds[v];
                self.borders[kept as usize] = self.borders[v];
                kept += 1;
            }
        }
        self.vertices_mm.truncate(kept as usize);
        self.kinds.truncate(kept as usize);
        self.borders.truncate(kept as usize);
        for triangle in &mut self.triangles {
            triangle.corners = triangle.corners.map(|v| numbers[v as usize]);
        }
    }
}
