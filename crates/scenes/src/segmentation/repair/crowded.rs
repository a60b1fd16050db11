//! Crowded edges: edges of more than two triangles. Sheets there are removed, and touching parts separated.

use std::collections::{BTreeMap, HashMap};
use std::f64::consts::TAU;

use insonify_core::anatomy::groups::Groups;

use super::edges::{self, Edge, of, undirected};
use super::report::{ActionKind, RemainingKind};
use super::work::{Work, area};

/// Largest number of rounds of removing sheets, and of dividing edges.
const ROUNDS: usize = 32;

/// Distance by which the vertices of touching parts are moved inward, mm. The gap between the parts then exceeds 0.001
/// mm, the depth from which the scene check reports a crossing.
const APART_MM: f64 = 0.004;

/// Resolves all crowded edges.
pub(super) fn resolve(work: &mut Work) {
    drop_sheets(work);
    let mut separated = 0;
    let mut regions = Vec::new();
    for round in 0..ROUNDS {
        let edges = edges::sorted(&work.mesh.triangles);
        let pairs = pairs(work, &edges);
        if pairs.is_empty() {
            break;
        }
        if round == 0 {
            separated = pairs.len();
            regions.push(work.region_of(pairs.values().flatten().flatten().map(|&t| work.mesh.triangles[t as usize])));
        }
        if !divide_vertices(work, &edges, &pairs) {
            divide_edges(work, &pairs);
        }
    }
    work.log(ActionKind::Separated, separated, regions);
}

/// Reports edges that still have more than two triangles as remaining defects.
pub(super) fn check(work: &mut Work) {
    let edges = edges::sorted(&work.mesh.triangles);
    let crowded: Vec<[u32; 3]> = edges::groups(&edges)
        .filter(|group| group.len() > 2)
        .map(|group| work.mesh.triangles[group[0].triangle as usize])
        .collect();
    let region = work.region_of(crowded.iter().copied());
    work.leave(RemainingKind::Crowded, crowded.len(), [region]);
}

/// At each edge of an odd number of triangles, three or more, removes the smallest sheet, until no such edge is left. A
/// sheet is a set of triangles connected over edges of two.
fn drop_sheets(work: &mut Work) {
    let mut removed = 0;
    let mut regions = Vec::new();
    for _ in 0..ROUNDS {
        let edges = edges::sorted(&work.mesh.triangles);
        let is_odd = |group: &&[Edge]| group.len() > 2 && group.len() % 2 == 1;
        let odd: Vec<&[Edge]> = edges::groups(&edges).filter(is_odd).collect();
        if odd.is_empty() {
            break;
        }
        let sheet = edges::components(work.mesh.triangles.len(), &edges);
        let mut areas = vec![0.0; sheet.iter().max().map_or(0, |&last| last as usize + 1)];
        for (triangle, &index) in work.mesh.triangles.iter().zip(&sheet) {
            areas[index as usize] += area(work.corners(*triangle));
        }
        // The smallest sheets come first. Each edge loses at most one of its sheets per round.
        let mut around: Vec<Vec<u32>> = odd
            .iter()
            .map(|group| {
                let mut sheets: Vec<u32> = group.iter().map(|e| sheet[e.triangle as usize]).collect();
                sheets.sort_unstable();
                sheets
            })
            .collect();
        around.sort_unstable();
        around.dedup();
        let smallest = |sheets: &Vec<u32>| {
            // If a sheet that contains the edge twice were removed, the number of triangles would still be odd.
            let once = |s: &&u32| sheets.iter().filter(|other| other == s).count() % 2 == 1;
            let by_area = |a: &&u32, b: &&u32| areas[**a as usize].total_cmp(&areas[**b as usize]).then(a.cmp(b));
            sheets.iter().filter(once).min_by(by_area).copied()
        };
        let mut chosen: Vec<(u32, usize)> =
            around.iter().enumerate().filter_map(|(i, sheets)| smallest(sheets).map(|s| (s, i))).collect();
        chosen.sort_by(|a, b| areas[a.0 as usize].total_cmp(&areas[b.0 as usize]).then(a.cmp(b)));
        let (mut gone, mut spared) = (vec![false; areas.len()], vec![false; areas.len()]);
        for (s, i) in chosen {
            if spared[s as usize] || around[i].iter().any(|other| gone[*other as usize]) {
                continue;
            }
            gone[s as usize] = true;
            around[i].iter().for_each(|&other| spared[other as usize] = other != s);
        }
        let keep: Vec<bool> = sheet.iter().map(|&s| !gone[s as usize]).collect();
        let dropped: Vec<[u32; 3]> =
            work.mesh.triangles.iter().zip(&keep).filter(|(_, keep)| !**keep).map(|(t, _)| *t).collect();
        if dropped.is_empty() {
            break;
        }
        regions.push(work.region_of(dropped.iter().copied()));
        removed += dropped.len();
        work.retain(&keep);
    }
    work.log(ActionKind::Sheet, removed, regions);
}

/// For each edge of four or more triangles, the pairs of triangles that border the same part.
type Pairs = BTreeMap<[u32; 2], Vec<[u32; 2]>>;

/// Pairs up the triangles at each crowded edge: between the two of a pair lies the inside of a part.
fn pairs(work: &Work, edges: &[Edge]) -> Pairs {
    let crowded = edges::groups(edges).filter(|group| group.len() > 2 && group.len().is_multiple_of(2));
    crowded.map(|group| ([group[0].low, group[0].high], pairs_of(work, group))).collect()
}

fn pairs_of(work: &Work, group: &[Edge]) -> Vec<[u32; 2]> {
    let (low, high) = (work.at(group[0].low), work.at(group[0].high));
    let axis = (high - low).normalize_or_zero();
    let across = axis.any_orthonormal_vector();
    let up = axis.cross(across);
    let mut around: Vec<(f64, &Edge)> = group
        .iter()
        .map(|edge| {
            let triangle = work.mesh.triangles[edge.triangle as usize];
            let out = work.at(triangle[(usize::from(edge.side) + 2) % 3]) - low;
            (out.dot(up).atan2(out.dot(across)), edge)
        })
        .collect();
    around.sort_by(|a, b| a.0.total_cmp(&b.0).then(a.1.cmp(b.1)));
    let count = around.len();
    let pair_from = |first: usize| {
        let pair = move |i: usize| [(first + 2 * i) % count, (first + 2 * i + 1) % count];
        (0..count / 2).map(pair)
    };
    let gap =
        |first: usize| -> f64 { pair_from(first).map(|[i, j]| (around[j].0 - around[i].0).rem_euclid(TAU)).sum() };
    // Around the edge, anticlockwise: the solid lies between a triangle that runs backward along the edge and the next
    // triangle, which runs forward.
    let encloses = |first: usize| pair_from(first).all(|[i, j]| around[i].1.back && !around[j].1.back);
    let first = match (encloses(0), encloses(1)) {
        (true, false) => 0,
        (false, true) => 1,
        _ => usize::from(gap(1) < gap(0)),
    };
    pair_from(first).map(|pair| pair.map(|i| around[i].1.triangle)).collect()
}

/// At each vertex of a crowded edge, gives each part a vertex of its own. Returns false if there was nothing to
/// separate.
fn divide_vertices(work: &mut Work, edges: &[Edge], pairs: &Pairs) -> bool {
    let mut at: BTreeMap<u32, Vec<u32>> = pairs.keys().flatten().map(|&vertex| (vertex, Vec::new())).collect();
    for (triangle, index) in work.mesh.triangles.iter().zip(0u32..) {
        for vertex in triangle {
            if let Some(list) = at.get_mut(vertex) {
                list.push(index);
            }
        }
    }
    let plain = |key: [u32; 2]| {
        let start = edges.partition_point(|e| [e.low, e.high] < key);
        match edges[start..] {
            [a, b, ..] if [b.low, b.high] == key => Some([a.triangle, b.triangle]),
            _ => None,
        }
    };
    let mut changes = Vec::new();
    for (&vertex, triangles) in &at {
        let position: HashMap<u32, u32> = triangles.iter().copied().zip(0..).collect();
        let mut fans = Groups::new(triangles.len());
        let mut is_crowded = vec![false; triangles.len()];
        for &index in triangles {
            for edge in of(work.mesh.triangles[index as usize]).map(undirected) {
                if !edge.contains(&vertex) {
                    continue;
                }
                match pairs.get(&edge) {
                    Some(pairs) => {
                        is_crowded[position[&index] as usize] = true;
                        pairs.iter().for_each(|[a, b]| fans.join(position[a], position[b]));
                    }
                    None => {
                        if let Some([a, b]) = plain(edge) {
                            fans.join(position[&a], position[&b]);
                        }
                    }
                }
            }
        }
        let fan = fans.numbered();
        let count = fan.iter().max().map_or(0, |&last| last + 1);
        let needs_own = |f: u32| fan.iter().zip(&is_crowded).any(|(of, crowded)| *of == f && *crowded);
        for f in (1..count).filter(|&f| needs_own(f)) {
            let of_fan: Vec<u32> = triangles.iter().zip(&fan).filter(|(_, of)| **of == f).map(|(t, _)| *t).collect();
            changes.push((vertex, of_fan));
        }
    }
    for (vertex, triangles) in &changes {
        let copy = work.copy(*vertex);
        work.split.extend([*vertex, copy]);
        for &index in triangles {
            let corners = &mut work.mesh.triangles[index as usize];
            corners.iter_mut().filter(|corner| *corner == vertex).for_each(|corner| *corner = copy);
        }
    }
    !changes.is_empty()
}

/// Divides the triangles at each crowded edge at the middle of the edge, where each pair gets a vertex of its own.
fn divide_edges(work: &mut Work, pairs: &Pairs) {
    let mut touched = vec![false; work.mesh.triangles.len()];
    for (&[low, high], pairs) in pairs {
        if pairs.iter().flatten().any(|&t| touched[t as usize]) {
            continue;
        }
        let middle_mm = 0.5 * (work.at(low) + work.at(high));
        for pair in pairs {
            let middle = work.push(middle_mm);
            work.split.push(middle);
            for &t in pair {
                touched[t as usize] = true;
                let triangle = work.mesh.triangles[t as usize];
                let with = |gone: u32| triangle.map(|v| if v == gone { middle } else { v });
                work.mesh.triangles[t as usize] = with(low);
                work.mesh.triangles.push(with(high));
            }
        }
    }
}

/// Moves the separated vertices slightly inward, which leaves a gap between touching parts. The surface must face
/// outward.
pub(super) fn move_apart(work: &mut Work) {
    if work.split.is_empty() {
        return;
    }
    let mut split = std::mem::take(&mut work.split);
    split.sort_unstable();
    split.dedup();
    // For each vertex: sum of the unit normals, weighted by angle, and length of the shortest edge of its triangles.
    let mut around: BTreeMap<u32, (glam::DVec3, f64)> =
        split.into_iter().map(|vertex| (vertex, (glam::DVec3::ZERO, f64::INFINITY))).collect();
    for triangle in &work.mesh.triangles {
        let [a, b, c] = work.corners(*triangle);
        let normal = (b - a).cross(c - a).normalize_or_zero();
        let shortest = a.distance(b).min(b.distance(c)).min(c.distance(a));
        for (i, vertex) in triangle.iter().enumerate() {
            if let Some((sum, least)) = around.get_mut(vertex) {
                let corner = [a, b, c][i];
                let (to, from) = ([b, c, a][i] - corner, [c, a, b][i] - corner);
                *sum += normal * to.angle_between(from);
                *least = least.min(shortest);
            }
        }
    }
    for (vertex, (normal, shortest)) in around {
        let inward = -normal.normalize_or_zero() * APART_MM.min(0.2 * shortest);
        work.mesh.vertices_mm[vertex as usize] += inward.as_vec3();
    }
}
