//! Crossing triangles: small folds are smoothed, other crossings reported.

use std::collections::{BTreeMap, BTreeSet};

use glam::Vec3;
use insonify_core::anatomy::doctor::crossing::{self, Pair};
use insonify_core::anatomy::doctor::tree::Tree;
use insonify_core::anatomy::{Bounds, Mesh};

use super::edges::{self, of, undirected};
use super::report::{ActionKind, RemainingKind};
use super::work::{Work, region};

/// Largest number of rounds of smoothing; the smoothing gets stronger after each `ROUNDS_A_STEP`.
const ROUNDS: usize = 12;
const ROUNDS_A_STEP: usize = 3;

/// Smallest depth of a crossing that is smoothed, mm. The separation of touching parts may leave shallower ones.
const DEPTH_MM: f64 = 0.01;

/// The remaining folds are reported if there is more than one per this number of triangles; the scene check ignores
/// fewer.
const FOLDS_ONE_IN: usize = 25;

/// Smooths small folds without moving a vertex by more than `max_move_mm`, and reports the remaining ones.
pub(super) fn resolve(work: &mut Work, max_move_mm: f64) {
    let before = work.mesh.clone();
    let Some(tree) = Tree::new(&before) else { return };
    let mut pairs = crossing::pairs(&tree);
    if pairs.is_empty() {
        return;
    }
    let edges = edges::sorted(&work.mesh.triangles);
    let part_of = edges::components(work.mesh.triangles.len(), &edges);
    drop(edges);
    let first = pairs.len();
    let at = region(pairs.iter().map(|pair| pair.point));
    let reach_mm = (max_move_mm - f64::from(work.joined_mm)).max(0.0) as f32;
    for round in 0..ROUNDS {
        let is_in_one = |pair: &&Pair| part_of[pair.triangles[0] as usize] == part_of[pair.triangles[1] as usize];
        let deep = pairs.iter().filter(is_in_one).filter(|pair| pair.depth_mm >= DEPTH_MM);
        let seeds: BTreeSet<u32> = deep.flat_map(|pair| pair.triangles).collect();
        if seeds.is_empty() || reach_mm == 0.0 {
            break;
        }
        // Smoothing starts weak and narrow. Later it may move vertices farther, over a wider ring of triangles.
        let step = round / ROUNDS_A_STEP;
        let reach_mm = reach_mm * [0.1, 0.3, 1.0, 1.0][step.min(3)];
        pairs = smooth(work, &tree, &seeds, &pairs, reach_mm, step + 1).unwrap_or(pairs);
    }
    work.log(ActionKind::Fold, first - pairs.len(), [at]);
    if pairs.is_empty() {
        return;
    }
    let crossings = Tree::new(&work.mesh).map(|tree| crossing::find(&tree, &part_of));
    let Some(crossing::Crossings { overlaps, folds, regions }) = crossings else { return };
    if overlaps > 0 {
        work.leave(RemainingKind::Overlap, overlaps, regions);
    } else if folds * FOLDS_ONE_IN > work.mesh.triangles.len() {
        work.leave(RemainingKind::Fold, folds, regions);
    }
}

/// Smooths the vertices within `rings` triangles of the `seeds`. Returns the pairs of triangles that cross afterwards.
/// `None`, with nothing changed, if they are not fewer than before.
fn smooth(
    work: &mut Work,
    tree: &Tree<'_>,
    seeds: &BTreeSet<u32>,
    pairs: &[Pair],
    reach_mm: f32,
    rings: usize,
) -> Option<Vec<Pair>> {
    let mut inside: BTreeSet<u32> = seeds.iter().flat_map(|&t| work.mesh.triangles[t as usize]).collect();
    let mut around = BTreeMap::<u32, BTreeSet<u32>>::new();
    let mut touched: Vec<u32> = Vec::new();
    for ring in 0..=rings {
        let touches = |t: &[u32; 3]| t.iter().any(|vertex| inside.contains(vertex));
        touched = (0u32..).zip(&work.mesh.triangles).filter(|(_, t)| touches(t)).map(|(index, _)| index).collect();
        if ring == rings {
            break;
        }
        if ring > 0 {
            inside.extend(touched.iter().flat_map(|&t| work.mesh.triangles[t as usize]));
        }
    }
    for &t in &touched {
        for [a, b] in of(work.mesh.triangles[t as usize]).map(undirected) {
            around.entry(a).or_default().insert(b);
            around.entry(b).or_default().insert(a);
        }
    }
    let saved: Vec<(u32, Vec3)> =
        inside.iter().map(|&vertex| (vertex, work.mesh.vertices_mm[vertex as usize])).collect();
    for _ in 0..4 {
        let moved: Vec<(u32, Vec3)> = inside
            .iter()
            .filter_map(|&vertex| {
                let near = around.get(&vertex)?;
                let mean =
                    near.iter().map(|&other| work.mesh.vertices_mm[other as usize]).sum::<Vec3>() / near.len() as f32;
                let home = work.home_mm[vertex as usize];
                let wanted = work.mesh.vertices_mm[vertex as usize].lerp(mean, 0.5);
                Some((vertex, home + (wanted - home).clamp_length_max(0.999 * reach_mm)))
            })
            .collect();
        moved.into_iter().for_each(|(vertex, to)| work.mesh.vertices_mm[vertex as usize] = to);
    }
    let is_touched: BTreeSet<u32> = touched.iter().copied().collect();
    let elsewhere = pairs.iter().filter(|pair| pair.triangles.iter().all(|t| !is_touched.contains(t)));
    let mut now: Vec<Pair> = elsewhere.copied().collect();
    now.extend(crossings_of(&work.mesh, tree, &touched, &is_touched, reach_mm));
    if now.len() < pairs.len() {
        return Some(now);
    }
    saved.into_iter().for_each(|(vertex, to)| work.mesh.vertices_mm[vertex as usize] = to);
    None
}

/// Pairs of crossing triangles, at least one of them in `some`. `tree` has the positions before smoothing, which moves
/// vertices by up to `reach_mm`, so the search reaches further.
fn crossings_of(mesh: &Mesh, tree: &Tree<'_>, some: &[u32], is_some: &BTreeSet<u32>, reach_mm: f32) -> Vec<Pair> {
    let mut found = Vec::new();
    for &t in some {
        let bounds = mesh.corners_of(t).into_iter().fold(Bounds::EMPTY, Bounds::with).grown(2.0 * reach_mm);
        tree.near([bounds.min, bounds.max, bounds.min], |u| {
            if u == t || (u < t && is_some.contains(&u)) {
                return;
            }
            if let Some((point, depth_mm)) = crossing::cross(mesh, t.min(u), t.max(u)) {
                found.push(Pair { triangles: [t.min(u), t.max(u)], point: point.as_vec3(), depth_mm });
            }
        });
    }
    found.sort_by_key(|pair| pair.triangles);
    found
}
