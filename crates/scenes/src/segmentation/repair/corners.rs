//! Edges and corners of the box whose planes cut the surface off. There, the caps of bent rims meet.

use std::collections::{BTreeMap, BTreeSet};

use glam::DVec3;

use super::loops::loops;
use super::planes::{self, Plane};
use super::work::{Work, volume};

/// Distance by which a surface may extend beyond a plane that cuts it off, mm.
const BEYOND_MM: f64 = 0.05;

/// Vertex at which a rim turns from one plane into another.
#[derive(Debug, Clone, Copy)]
pub(super) struct Turn {
    pub(super) vertex: u32,
    /// Index of the rim's plane after the turn, and direction of the rim's next edge.
    pub(super) plane: usize,
    pub(super) direction: DVec3,
}

/// Turns of rims by the pair of planes between which they turn.
pub(super) type Turns = BTreeMap<[usize; 2], Vec<Turn>>;

/// New edges at which two caps meet: the indices of both planes, and the two vertices.
pub(super) type Bends = Vec<([usize; 2], [u32; 2])>;

/// Corner of the box: an intersection of three planes. `inside` tells whether the solid includes it, once decided.
struct Corner {
    at: DVec3,
    planes: [usize; 3],
    inside: Option<bool>,
    /// Votes on whether the solid includes the corner, from the winding of rims: the number for minus the number
    /// against.
    votes: i32,
}

/// Edges at which the caps of two planes meet, on the intersection lines of planes. `None` if the ends of the edges
/// don't pair up.
///
/// Along an intersection line, the solid begins or ends at each turn of a rim, and at each corner of the box that it
/// includes. The winding of the surface decides which corners these are. If the winding is ambiguous, the solid
/// includes as few corners as possible. The first `sides` of the `known` planes are sides of an upright box; other
/// planes count only where rims turn.
pub(super) fn bends(work: &mut Work, turns: &Turns, known: &[Plane], sides: usize) -> Option<Bends> {
    let used: BTreeSet<usize> = turns.keys().flatten().copied().collect();
    if used.is_empty() {
        return Some(Vec::new());
    }
    let faces: Vec<usize> = (0..known.len()).filter(|i| used.contains(i) || *i < sides).collect();
    let side = |i: usize| if faces.contains(&i) { side(work, &known[i]) } else { None };
    let sides: Vec<Option<f64>> = (0..known.len()).map(side).collect();
    let mut corners = corners(&faces, &sides, known);
    let lines = lines(&faces, known, &corners)?;
    let is_odd = |pair: &[usize; 2]| turns.get(pair).is_some_and(|ends| ends.len() % 2 == 1);
    vote(&mut corners, &lines, work, turns, known, &sides);
    decide(&mut corners, &lines, &is_odd)?;
    let vertex: Vec<Option<u32>> =
        corners.iter().map(|corner| (corner.inside == Some(true)).then(|| work.push(corner.at))).collect();
    let mut bends = Vec::new();
    for (pair, ends) in lines {
        let mut along: Vec<u32> = turns.get(&pair).into_iter().flatten().map(|turn| turn.vertex).collect();
        along.extend(ends.iter().filter_map(|&end| vertex[end]));
        let direction = known[pair[0]].normal.cross(known[pair[1]].normal);
        along.sort_by(|a, b| work.at(*a).dot(direction).total_cmp(&work.at(*b).dot(direction)).then(a.cmp(b)));
        let (spans, rest) = along.as_chunks::<2>();
        if !rest.is_empty() {
            return None;
        }
        bends.extend(spans.iter().filter(|[a, b]| a != b).map(|&span| (pair, span)));
    }
    Some(bends)
}

/// Sign of the side of a plane on which the whole surface lies; `None` if it lies on both sides.
fn side(work: &Work, plane: &Plane) -> Option<f64> {
    let used = work.mesh.triangles.iter().flatten();
    let height = |vertex: &u32| plane.normal.dot(work.at(*vertex)) - plane.offset_mm;
    let (low, high) = used.map(height).fold((0.0f64, 0.0f64), |(low, high), h| (low.min(h), high.max(h)));
    match (low >= -BEYOND_MM, high <= BEYOND_MM) {
        (true, _) => Some(1.0),
        (_, true) => Some(-1.0),
        _ => None,
    }
}

/// Corners of the box: intersections of three of the planes `faces` that no other plane cuts off.
fn corners(faces: &[usize], sides: &[Option<f64>], known: &[Plane]) -> Vec<Corner> {
    let is_inside = |at: DVec3| {
        let cuts_off = |i: &usize| {
            sides[*i].is_some_and(|side| side * (known[*i].normal.dot(at) - known[*i].offset_mm) < -BEYOND_MM)
        };
        !faces.iter().any(cuts_off)
    };
    let mut found: Vec<Corner> = Vec::new();
    for (n, &i) in faces.iter().enumerate() {
        for (m, &j) in faces.iter().enumerate().skip(n + 1) {
            for &k in &faces[m + 1..] {
                if let Some(at) = planes::corner([known[i], known[j], known[k]]).filter(|at| is_inside(*at)) {
                    found.push(Corner { at, planes: [i, j, k], inside: None, votes: 0 });
                }
            }
        }
    }
    found
}

/// Intersection lines: for each pair of intersecting planes, the indices of the corners at the line's ends. `None` if a
/// line has more than two corners, since the planes then form no box.
fn lines(faces: &[usize], known: &[Plane], corners: &[Corner]) -> Option<Vec<([usize; 2], Vec<usize>)>> {
    let mut lines = Vec::new();
    for (n, &i) in faces.iter().enumerate() {
        for &j in &faces[n + 1..] {
            if planes::meet(&known[i], &known[j]) {
                let is_end = |c: &usize| corners[*c].planes.contains(&i) && corners[*c].planes.contains(&j);
                let ends: Vec<usize> = (0..corners.len()).filter(is_end).collect();
                if ends.len() > 2 {
                    return None;
                }
                lines.push(([i, j], ends));
            }
        }
    }
    Some(lines)
}

/// Adds the votes of rims to the corners. A rim runs such that, seen from outside the box, its cap lies to its left.
fn vote(
    corners: &mut [Corner],
    lines: &[([usize; 2], Vec<usize>)],
    work: &Work,
    turns: &Turns,
    known: &[Plane],
    sides: &[Option<f64>],
) {
    let faces_outward = if open_volume(work) < 0.0 { -1.0 } else { 1.0 };
    for (pair, ends) in lines {
        let line = known[pair[0]].normal.cross(known[pair[1]].normal);
        let height = |turn: &&Turn| work.at(turn.vertex).dot(line);
        for &end in ends {
            let at = corners[end].at.dot(line);
            let last = turns.get(pair).into_iter().flatten().min_by(|a, b| {
                let distance = |turn: &&Turn| (height(turn) - at).abs();
                distance(a).total_cmp(&distance(b)).then(a.vertex.cmp(&b.vertex))
            });
            let Some(turn) = last else { continue };
            let Some(side) = sides[turn.plane] else { continue };
            let into_cap = (-side * known[turn.plane].normal).cross(turn.direction) * faces_outward;
            let toward_end = (at - height(&turn)).signum();
            corners[end].votes += if into_cap.dot(line) * toward_end > 0.0 { 1 } else { -1 };
        }
    }
}

/// Signed volume of the surface with each rim closed by a fan, mm³. If it is negative, the surface most likely faces
/// inward.
fn open_volume(work: &Work) -> f64 {
    let triangles = work.mesh.triangles.iter().map(|t| volume(work.corners(*t))).sum::<f64>();
    let fan = |rim: &Vec<u32>| -> f64 {
        let points: Vec<DVec3> = rim.iter().map(|&vertex| work.at(vertex)).collect();
        let middle = points.iter().sum::<DVec3>() / points.len() as f64;
        let next = points.iter().cycle().skip(1);
        points.iter().zip(next).map(|(a, b)| volume([*a, *b, middle])).sum()
    };
    triangles + loops(&work.mesh.triangles).iter().map(fan).sum::<f64>()
}

/// Decides which corners the solid includes. On a line with an odd number of turns, the solid includes exactly one of
/// its two ends; otherwise both or none. A line with one corner starts outside the solid. `None` if these rules
/// contradict each other.
fn decide(
    corners: &mut [Corner],
    lines: &[([usize; 2], Vec<usize>)],
    is_odd: &dyn Fn(&[usize; 2]) -> bool,
) -> Option<()> {
    let mut queue = Vec::new();
    for (pair, ends) in lines {
        match ends[..] {
            [] if is_odd(pair) => return None,
            [only] => set(corners, &mut queue, only, is_odd(pair))?,
            _ => {}
        }
    }
    spread(corners, lines, is_odd, &mut queue, 0)?;
    for first in 0..corners.len() {
        if corners[first].inside.is_some() {
            continue;
        }
        let start = queue.len();
        set(corners, &mut queue, first, false)?;
        spread(corners, lines, is_odd, &mut queue, start)?;
        let group = &queue[start..];
        let inside = group.iter().filter(|&&c| corners[c].inside == Some(true)).count();
        let votes: i32 = group
            .iter()
            .map(|&c| if corners[c].inside == Some(true) { corners[c].votes } else { -corners[c].votes })
            .sum();
        if votes < 0 || (votes == 0 && 2 * inside > group.len()) {
            group.iter().for_each(|&c| corners[c].inside = corners[c].inside.map(|inside| !inside));
        }
    }
    Some(())
}

/// Sets whether the solid includes a corner, and queues the corner. `None` if it was set to the opposite before.
fn set(corners: &mut [Corner], queue: &mut Vec<usize>, corner: usize, inside: bool) -> Option<()> {
    match corners[corner].inside {
        Some(is) => (is == inside).then_some(()),
        None => {
            corners[corner].inside = Some(inside);
            queue.push(corner);
            Some(())
        }
    }
}

/// Follows all lines from the queued corners and sets the corners at their other ends.
fn spread(
    corners: &mut [Corner],
    lines: &[([usize; 2], Vec<usize>)],
    is_odd: &dyn Fn(&[usize; 2]) -> bool,
    queue: &mut Vec<usize>,
    mut at: usize,
) -> Option<()> {
    while let Some(&corner) = queue.get(at) {
        at += 1;
        let inside = corners[corner].inside?;
        for (pair, ends) in lines {
            let other = match ends[..] {
                [a, b] if a == corner => b,
                [a, b] if b == corner => a,
                _ => continue,
            };
            set(corners, queue, other, inside != is_odd(pair))?;
        }
    }
    Some(())
}
