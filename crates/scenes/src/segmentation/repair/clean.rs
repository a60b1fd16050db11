//! Removal of triangles without area, of copies, and of pairs of triangles back to back.

use std::collections::{BTreeMap, HashMap};

use insonify_core::anatomy::groups::Groups;

use super::edges::{self, of, undirected};
use super::report::ActionKind;
use super::work::Work;

/// Height, mm, below which a triangle counts as flat, without area.
const FLAT_MM: f64 = 1e-6;

/// Largest number of rounds of [`flip_away`].
const ROUNDS: usize = 16;

/// Number of rounds before edges may get four triangles.
const PATIENT_ROUNDS: usize = 8;

/// Removes flat triangles, which have no area. Where a corner of one lies on its longest edge, the triangle beyond that
/// edge is divided at the corner.
pub(super) fn drop_degenerate(work: &mut Work) {
    let total = work.mesh.triangles.len();
    work.mesh.triangles.retain(|[a, b, c]| a != b && b != c && c != a);
    let mut removed = total - work.mesh.triangles.len();
    let mut regions = Vec::new();
    for round in 0..ROUNDS {
        let flat: Vec<u32> = flat(work);
        if flat.is_empty() {
            break;
        }
        regions.push(work.region_of(flat.iter().map(|&t| work.mesh.triangles[t as usize])));
        removed += flip_away(work, &flat, round >= PATIENT_ROUNDS);
    }
    let left = flat(work);
    removed += left.len();
    let mut keep = vec![true; work.mesh.triangles.len()];
    left.iter().for_each(|&t| keep[t as usize] = false);
    work.retain(&keep);
    work.log(ActionKind::Degenerate, removed, regions);
}

/// Indices of the triangles lower than [`FLAT_MM`].
fn flat(work: &Work) -> Vec<u32> {
    let is_flat = |triangle: [u32; 3]| {
        let [a, b, c] = work.corners(triangle);
        let longest = a.distance(b).max(b.distance(c)).max(c.distance(a));
        let twice = (b - a).cross(c - a).length();
        // With the tracer's 32-bit corners, even a higher triangle may have no area at all.
        twice == 0.0 || twice < FLAT_MM * longest
    };
    (0u32..).zip(&work.mesh.triangles).filter(|(_, t)| is_flat(**t)).map(|(index, _)| index).collect()
}

/// Removes flat triangles. If another triangle shares the longest edge, it is divided at the flat one's third corner.
/// Returns the number of triangles removed. Unless `forced`, a division that would give an edge four triangles is left
/// out.
fn flip_away(work: &mut Work, flat: &[u32], forced: bool) -> usize {
    let edges = edges::sorted(&work.mesh.triangles);
    let next = edges::neighbours(work.mesh.triangles.len(), &edges);
    let exists = |edge: [u32; 2]| {
        let key = undirected(edge);
        edges.binary_search_by(|e| [e.low, e.high].cmp(&key)).is_ok()
    };
    let mut touched = vec![false; work.mesh.triangles.len()];
    let mut keep = vec![true; work.mesh.triangles.len()];
    let mut removed = 0;
    for &t in flat {
        let triangle = work.mesh.triangles[t as usize];
        let length = |side: usize| {
            let [from, to] = of(triangle)[side];
            work.at(from).distance(work.at(to))
        };
        let side = (0..3).fold(0, |best, side| if length(side) > length(best) { side } else { best });
        let [from, to] = of(triangle)[side];
        let middle = triangle[(side + 2) % 3];
        let beyond = next[t as usize][side];
        if touched[t as usize] {
            continue;
        }
        if beyond == edges::NONE {
            keep[t as usize] = false;
            removed += 1;
            continue;
        }
        let other = work.mesh.triangles[beyond as usize];
        let Some(apex) = other.iter().copied().find(|v| *v != from && *v != to) else { continue };
        if touched[beyond as usize] {
            continue;
        }
        if apex == middle {
            // Both triangles are flat and lie back to back.
            for gone in [t, beyond] {
                touched[gone as usize] = true;
                keep[gone as usize] = false;
            }
            removed += 2;
            continue;
        }
        if !forced && exists([middle, apex]) {
            continue;
        }
        // The parts of the divided triangle have its winding, whichever of both triangles they replace.
        let divided = |gone: u32| other.map(|v| if v == gone { middle } else { v });
        work.mesh.triangles[t as usize] = divided(from);
        work.mesh.triangles[beyond as usize] = divided(to);
        touched[t as usize] = true;
        touched[beyond as usize] = true;
        removed += 1;
    }
    work.retain(&keep);
    removed
}

/// Corners of a triangle in ascending order, and whether that order has the same winding.
fn keyed([a, b, c]: [u32; 3]) -> ([u32; 3], bool) {
    let mut sorted = [a, b, c];
    sorted.sort_unstable();
    (sorted, [[a, b, c], [b, c, a], [c, a, b]].contains(&sorted))
}

/// Removes copies of triangles. Two triangles back to back are both removed if they form a wall inside the surface. If
/// they are the only border there, one of them stays.
pub(super) fn drop_copies(work: &mut Work) {
    let mut keys: Vec<([u32; 3], u32, bool)> = (0u32..)
        .zip(&work.mesh.triangles)
        .map(|(index, t)| {
            let (key, even) = keyed(*t);
            (key, index, even)
        })
        .collect();
    keys.sort_unstable();
    let mut keep = vec![true; work.mesh.triangles.len()];
    let (mut copies, mut backs) = (Vec::new(), Vec::new());
    for group in keys.chunk_by(|a, b| a.0 == b.0).filter(|group| group.len() > 1) {
        let even = group.iter().filter(|(_, _, even)| *even).count();
        // One of the copies with the majority's winding stays; without a majority, the first one.
        let kept = if 2 * even == group.len() { group[0] } else { majority(group, 2 * even > group.len()) };
        for &(_, index, _) in group.iter().filter(|(_, index, _)| *index != kept.1) {
            keep[index as usize] = false;
            copies.push(index);
        }
        if 2 * even == group.len() {
            backs.push(kept.1);
        }
    }
    if copies.is_empty() {
        return;
    }
    let walls = inner_walls(work, &backs, &keep);
    let triangle = |index: &u32| work.mesh.triangles[*index as usize];
    let (copies_at, walls_at) =
        (work.region_of(copies.iter().map(triangle)), work.region_of(walls.iter().map(triangle)));
    walls.iter().for_each(|&index| keep[index as usize] = false);
    work.retain(&keep);
    work.log(ActionKind::Duplicate, copies.len() - walls.len(), [copies_at]);
    work.log(ActionKind::InnerWall, 2 * walls.len(), [walls_at]);
}

fn majority(group: &[([u32; 3], u32, bool)], even: bool) -> ([u32; 3], u32, bool) {
    group.iter().copied().find(|(_, _, is_even)| *is_even == even).unwrap_or(group[0])
}

/// Indices of the triangles in `backs`, one of each pair back to back, that form walls inside the surface. A sheet of
/// them is a wall if most of its boundary edges stay closed without it.
fn inner_walls(work: &Work, backs: &[u32], keep: &[bool]) -> Vec<u32> {
    if backs.is_empty() {
        return Vec::new();
    }
    let triangles: Vec<[u32; 3]> = backs.iter().map(|&index| work.mesh.triangles[index as usize]).collect();
    let own = edges::sorted(&triangles);
    let mut rest = HashMap::<[u32; 2], usize>::new();
    let mut rim = BTreeMap::<[u32; 2], u32>::new();
    let mut joined = Groups::new(triangles.len());
    for group in edges::groups(&own) {
        match group {
            [edge] => _ = rim.insert([edge.low, edge.high], edge.triangle),
            [first, others @ ..] => others.iter().for_each(|other| joined.join(first.triangle, other.triangle)),
            [] => {}
        }
    }
    let is_back: std::collections::HashSet<u32> = backs.iter().copied().collect();
    let others =
        (0u32..).zip(&work.mesh.triangles).filter(|(index, _)| keep[*index as usize] && !is_back.contains(index));
    for edge in others.flat_map(|(_, t)| of(*t)).map(undirected).filter(|edge| rim.contains_key(edge)) {
        *rest.entry(edge).or_default() += 1;
    }
    let sheet = joined.numbered();
    // For each sheet: number of boundary edges that would stay closed without it, and number of those that would open.
    let mut votes = vec![[0usize; 2]; triangles.len()];
    for (edge, triangle) in &rim {
        let count = rest.get(edge).copied().unwrap_or(0);
        votes[sheet[*triangle as usize] as usize][usize::from(count == 0 || count % 2 == 1)] += 1;
    }
    let is_wall = |at: usize| votes[sheet[at] as usize][0] > votes[sheet[at] as usize][1];
    (0..backs.len()).filter(|at| is_wall(*at)).map(|at| backs[at]).collect()
}
