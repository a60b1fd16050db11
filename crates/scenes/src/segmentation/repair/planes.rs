//! Planes along which a surface was cut, found from its rims: loops of open edges.

use glam::DVec3;

/// Smallest sine of the angle between two planes that intersect in an edge of a box.
const SINE_MIN: f64 = 0.2;

/// Conditions for opposite faces of a box: largest sine of the angle between them, and smallest distance relative to
/// the size of the loop.
const PARALLEL_SINE: f64 = 1e-3;
const APART_PART: f64 = 0.05;

/// Largest number of planes of one loop: the six sides of a box.
const PLANES_MAX: usize = 6;

/// Fewest edges of a loop on each of its planes, and their smallest length relative to the loop's.
const EDGES_MIN: usize = 3;
const PLANE_PART: f64 = 0.03;

/// Largest number of known planes that a loop is compared with.
pub(super) const PLANES_REUSED: usize = 256;

/// Most arcs of a loop, runs of edges in one plane.
const ARCS_MAX: usize = 100;

/// Fewest edges of a loop with notches, and largest total length of its notches relative to the loop's.
const NOTCHED_EDGES_MIN: usize = 12;
const NOTCHED_PART: f64 = 0.3;

/// Number of positions along a loop at which runs of points for fitted planes begin.
const STARTS: usize = 48;

/// A plane: the points `p` with `normal · p = offset_mm`; the normal is a unit vector.
#[derive(Debug, Clone, Copy)]
pub(super) struct Plane {
    pub(super) normal: DVec3,
    pub(super) offset_mm: f64,
}

impl Plane {
    /// Plane through three distant points of `points`; `None` if all points lie nearly on a line.
    pub(super) fn through(points: &[DVec3], within_mm: f64) -> Option<Self> {
        let first = *points.first()?;
        let farthest = |from: &dyn Fn(DVec3) -> f64| {
            points.iter().copied().max_by(|a, b| from(*a).total_cmp(&from(*b))).unwrap_or(first)
        };
        let a = farthest(&|p| p.distance(first));
        let b = farthest(&|p| p.distance(a));
        let along = (b - a).try_normalize()?;
        let height = |p: DVec3| (p - a).reject_from_normalized(along).length();
        let c = farthest(&height);
        if height(c) <= 4.0 * within_mm {
            return None;
        }
        let normal = (b - a).cross(c - a).try_normalize()?;
        Some(Self { normal, offset_mm: normal.dot(a) })
    }

    /// Distance of a point from the plane, mm.
    pub(super) fn distance_mm(&self, point: DVec3) -> f64 {
        (self.normal.dot(point) - self.offset_mm).abs()
    }

    /// Whether all points lie within a distance of the plane.
    pub(super) fn holds(&self, points: &[DVec3], within_mm: f64) -> bool {
        points.iter().all(|point| self.distance_mm(*point) <= within_mm)
    }
}

/// Common point of three planes; `None` if they have none, or an uncertain one.
pub(super) fn corner([a, b, c]: [Plane; 3]) -> Option<DVec3> {
    let volume = a.normal.dot(b.normal.cross(c.normal));
    if volume.abs() < SINE_MIN * SINE_MIN {
        return None;
    }
    let (bc, ca, ab) = (b.normal.cross(c.normal), c.normal.cross(a.normal), a.normal.cross(b.normal));
    Some((bc * a.offset_mm + ca * b.offset_mm + ab * c.offset_mm) / volume)
}

/// A choice of planes that together contain most edges of a loop.
struct Cover {
    /// Number of planes at the start of `candidates` that were known before.
    known: usize,
    candidates: Vec<Plane>,
    /// For each candidate, whether it contains each edge of the loop.
    covers: Vec<Vec<bool>>,
    /// Indices of the chosen candidates, best first.
    chosen: Vec<usize>,
    /// For each edge, whether no chosen plane contains it.
    left: Vec<bool>,
}

/// Chooses up to six planes that contain most edges of a loop. Candidates are the `known` planes, and planes fitted to
/// runs of the loop.
fn cover(points: &[DVec3], known: &[Plane], within_mm: f64) -> Cover {
    let count = points.len();
    let next = |i: usize| (i + 1) % count;
    let on = |plane: &Plane| -> Vec<bool> {
        let near: Vec<bool> = points.iter().map(|p| plane.distance_mm(*p) <= within_mm).collect();
        (0..count).map(|i| near[i] && near[next(i)]).collect()
    };
    // The first planes belong to the largest rims.
    let known = &known[..known.len().min(PLANES_REUSED)];
    let mut candidates = known.to_vec();
    candidates.extend(windows(points, within_mm));
    let mut covers: Vec<Vec<bool>> = candidates.iter().map(on).collect();
    let total: f64 = (0..count).map(|i| points[i].distance(points[next(i)])).sum();
    let (mut chosen, mut left) = (Vec::new(), vec![true; count]);
    while left.contains(&true) && chosen.len() < PLANES_MAX {
        let gain = |c: usize| covers[c].iter().zip(&left).filter(|(on, left)| **on && **left).count();
        // A plane that nearly coincides with a chosen one is left out; opposite faces of a box are far apart.
        let fits = |c: &usize| {
            chosen.iter().all(|other: &usize| {
                meet(&candidates[*c], &candidates[*other]) || are_apart(&candidates[*c], &candidates[*other], points)
            })
        };
        // The first of equally good candidates is taken.
        let best = (0..candidates.len()).filter(fits).max_by_key(|&c| (gain(c), std::cmp::Reverse(c)));
        let length = |c: usize| -> f64 {
            let gained = (0..count).filter(|&i| covers[c][i] && left[i]);
            gained.map(|i| points[i].distance(points[next(i)])).sum()
        };
        let is_enough = |c: &usize| *c < known.len() || (gain(*c) >= EDGES_MIN && length(*c) >= PLANE_PART * total);
        let is_enough = |c: &usize| gain(*c) > 0 && is_enough(c);
        let Some(best) = best.filter(is_enough) else { break };
        // A plane fitted to all points that it contains is more exact than a plane fitted to a short run.
        if best >= known.len() {
            let held: Vec<DVec3> =
                (0..count).filter(|&i| covers[best][i]).flat_map(|i| [points[i], points[next(i)]]).collect();
            if let Some(plane) = Plane::through(&held, within_mm).filter(|plane| plane.holds(&held, within_mm)) {
                candidates[best] = plane;
                covers[best] = on(&plane);
            }
        }
        covers[best].iter().zip(&mut left).filter(|(on, _)| **on).for_each(|(_, left)| *left = false);
        chosen.push(best);
    }
    Cover { known: known.len(), candidates, covers, chosen, left }
}

/// Planes that together contain every edge of a loop that lies in no single plane, such as a loop around the edge of a
/// box. Returns the plane of each edge as an index into `known`; `None` if there are no such planes.
///
/// `known` are planes of other loops, which are preferred. New planes are appended to it.
pub(super) fn of_edges(points: &[DVec3], known: &mut Vec<Plane>, within_mm: f64) -> Option<Vec<usize>> {
    let count = points.len();
    if count < 2 * EDGES_MIN {
        return None;
    }
    let Cover { known: before, candidates, covers, chosen, left } = cover(points, known, within_mm);
    if left.contains(&true) {
        return None;
    }
    let assigned = assign(&chosen, &covers, count)?;
    let arcs = (0..count).filter(|&i| assigned[i] != assigned[(i + 1) % count]).count();
    if !(2..=ARCS_MAX).contains(&arcs) {
        return None;
    }
    // New planes are appended to `known`.
    let mut index: Vec<usize> = (0..candidates.len()).collect();
    for &c in chosen.iter().filter(|c| **c >= before) {
        index[c] = known.len();
        known.push(candidates[c]);
    }
    Some(assigned.into_iter().map(|c| index[c]).collect())
}

/// Notch of a loop: a short run of edges off the planes of the other edges.
pub(super) struct Notch {
    /// Indices of the run's first and last corner; both lie in a plane of the loop.
    pub(super) start: usize,
    pub(super) end: usize,
    /// If these corners lie in different planes: point near the run on the planes' intersection line.
    pub(super) via: Option<DVec3>,
}

/// Notches of a loop. They occur, for example, where triangles are missing at a cut, or where an edge of the mesh cuts
/// across an edge of the box. Empty if notches can't explain the loop.
pub(super) fn notches(points: &[DVec3], known: &[Plane], within_mm: f64) -> Vec<Notch> {
    let count = points.len();
    if count < NOTCHED_EDGES_MIN {
        return Vec::new();
    }
    let Cover { candidates, covers, chosen, left, .. } = cover(points, known, within_mm);
    let length = |i: usize| points[i].distance(points[(i + 1) % count]);
    let total: f64 = (0..count).map(length).sum();
    let off: f64 = (0..count).filter(|&i| left[i]).map(length).sum();
    if off > NOTCHED_PART * total {
        return Vec::new();
    }
    let starts = (0..count).filter(|&i| left[i] && !left[(i + count - 1) % count]);
    let end = |start: usize| (start..start + count).map(|i| i % count).find(|&i| !left[i]);
    let notch = |start: usize| {
        let end = end(start)?;
        let before = (start + count - 1) % count;
        let covers = &covers;
        let holds = |edge: usize| chosen.iter().copied().filter(move |&c| covers[c][edge]);
        if holds(before).any(|c| covers[c][end]) {
            return Some(Notch { start, end, via: None });
        }
        let (p, q) = (candidates[holds(before).next()?], candidates[holds(end).next()?]);
        let middle = 0.5 * (points[start] + points[end]);
        let via = nearest_of_both(&p, &q, middle)?;
        let near = 2.0 * points[start].distance(points[end]);
        (via.distance(middle) <= near).then_some(Notch { start, end, via: Some(via) })
    };
    starts.map(notch).collect::<Option<Vec<Notch>>>().unwrap_or_default()
}

/// Point nearest to `point` on the intersection line of two planes; `None` if they are nearly parallel.
fn nearest_of_both(p: &Plane, q: &Plane, point: DVec3) -> Option<DVec3> {
    if !meet(p, q) {
        return None;
    }
    let cosine = p.normal.dot(q.normal);
    let (to_p, to_q) = (p.offset_mm - p.normal.dot(point), q.offset_mm - q.normal.dot(point));
    let scale = 1.0 / (1.0 - cosine * cosine);
    Some(point + scale * ((to_p - cosine * to_q) * p.normal + (to_q - cosine * to_p) * q.normal))
}

/// Whether two planes are parallel, and far apart relative to the extent of `points`.
fn are_apart(p: &Plane, q: &Plane, points: &[DVec3]) -> bool {
    let sine = p.normal.cross(q.normal).length();
    let offset = p.normal.dot(q.normal).signum() * q.offset_mm;
    let size = points.iter().map(|point| point.distance(points[0])).fold(0.0, f64::max);
    sine < PARALLEL_SINE && (p.offset_mm - offset).abs() > APART_PART * size
}

/// Whether two planes intersect at a clear angle.
pub(super) fn meet(p: &Plane, q: &Plane) -> bool {
    p.normal.cross(q.normal).length() >= SINE_MIN
}

/// Index of a plane for each edge. Where several planes contain an edge, it has the plane of the edge before it. `None`
/// if an edge lies in no plane, or no edge lies in exactly one.
fn assign(chosen: &[usize], covers: &[Vec<bool>], count: usize) -> Option<Vec<usize>> {
    let holding = |i: usize| chosen.iter().copied().filter(move |&c| covers[c][i]);
    let first = (0..count).find(|&i| holding(i).count() == 1)?;
    let mut assigned = vec![usize::MAX; count];
    let mut present = holding(first).next()?;
    for i in (0..count).map(|step| (first + step) % count) {
        if !covers[present][i] {
            present = holding(i).next()?;
        }
        assigned[i] = present;
    }
    Some(assigned)
}

/// Planes fitted to runs of consecutive points of a loop, of different lengths.
fn windows(points: &[DVec3], within_mm: f64) -> Vec<Plane> {
    let count = points.len();
    let step = count.div_ceil(STARTS).max(1);
    let mut found: Vec<Plane> = Vec::new();
    for length in [count / 2, count / 3, count / 4, count / 6, count / 10].into_iter().filter(|l| *l > EDGES_MIN) {
        for start in (0..count).step_by(step) {
            let run: Vec<DVec3> = (0..length).map(|i| points[(start + i) % count]).collect();
            if let Some(plane) = Plane::through(&run, within_mm).filter(|plane| plane.holds(&run, within_mm)) {
                found.push(plane);
            }
        }
    }
    found
}

#[cfg(test)]
mod tests {
    use super::*;

    #[test]
    fn three_planes_meet_in_a_corner() {
        let plane = |normal: DVec3, offset_mm| Plane { normal, offset_mm };
        let planes = [plane(DVec3::X, 1.0), plane(DVec3::Y, 2.0), plane(DVec3::Z, 3.0)];
        assert!(corner(planes).unwrap().distance(DVec3::new(1.0, 2.0, 3.0)) < 1e-12);
        assert!(corner([planes[0], planes[0], planes[1]]).is_none());
    }

    #[test]
    fn a_loop_round_an_edge_has_two_planes_and_a_wavy_one_none() {
        let arc = |i: usize| std::f64::consts::PI * i as f64 / 20.0;
        let bent: Vec<DVec3> = (0..20)
            .map(|i| DVec3::new(arc(i).cos(), arc(i).sin(), 0.0))
            .chain((0..20).map(|i| DVec3::new(-arc(i).cos(), 0.0, arc(i).sin())))
            .collect();
        let mut known = Vec::new();
        let planes = of_edges(&bent, &mut known, 1e-6).unwrap();
        assert_eq!(known.len(), 2);
        assert!((0..20).all(|i| planes[i] == planes[0] && planes[20 + i] == planes[20]));
        let wavy: Vec<DVec3> =
            (0..40).map(|i| DVec3::new(arc(i).cos(), arc(i).sin(), (3.0 * arc(i)).sin() * 0.3)).collect();
        assert!(of_edges(&wavy, &mut Vec::new(), 1e-6).is_none());
    }
}
