//! Relations between surfaces: hidden ones, and overlaps at equal priority.

use std::collections::{BTreeMap, BTreeSet};

use glam::{DVec3, Vec3};
use rayon::prelude::*;

use super::RESOLUTION_MM;
use super::finding::{Defect, Finding, Region};
use super::probes::{Probe, probes};
use super::surface_check::SurfaceCheck;
use super::tree::Tree;

/// Largest number of triangles of a surface that are sampled; sample points lie on their inward normals.
const PROBES: usize = 1024;

/// Smallest fraction of a surface's samples that must be thin for the surface to count as a sheet.
const THIN_PART: f64 = 0.05;

/// Smallest number of sample points inside another surface that counts as a tie, relative to the number of samples. A
/// single point half way through the surface also suffices.
const TIED_PART: f64 = 0.01;

/// Largest number of hiding surfaces that a finding names.
const HIDERS_NAMED: usize = 3;

/// Examines every closed surface in relation to the others. Returns each finding with the index of its surface.
pub(super) fn examine(checks: &[SurfaceCheck], trees: &[Option<Tree<'_>>]) -> Vec<(usize, Finding)> {
    let mut found: Vec<(usize, Finding)> =
        (0..checks.len()).into_par_iter().flat_map_iter(|index| one(index, checks, trees)).collect();
    // A tie is found from both surfaces, but reported once.
    let mut reported = BTreeSet::new();
    found.retain(|(index, f)| f.defect != Defect::PriorityTie || reported.insert((*index, f.what.clone())));
    found
}

fn one(index: usize, checks: &[SurfaceCheck], trees: &[Option<Tree<'_>>]) -> Vec<(usize, Finding)> {
    let check = &checks[index];
    let (Some(tree), true) = (&trees[index], check.closed) else { return Vec::new() };
    let probes = probes(tree, PROBES);
    let mut found = Vec::new();
    let thin: Vec<&Probe> = probes.iter().filter(|p| p.thickness_mm < RESOLUTION_MM).collect();
    if !thin.is_empty() && thin.len() as f64 >= THIN_PART * probes.len() as f64 {
        let least = thin.iter().map(|p| p.thickness_mm).fold(f64::INFINITY, f64::min);
        let what = format!("a sheet {least:.6} mm thick: entered and left at one place, it is not seen");
        let region = Region::of(thin.iter().map(|p| p.points_mm[1].as_vec3()));
        found.push((index, Finding::new(Defect::ThinSheet, what).at([region])));
    }
    let (mut seen, mut ties) = (false, BTreeMap::<usize, Tie>::new());
    let mut hiders = BTreeSet::new();
    let points = probes.iter().flat_map(|probe| probe.points_mm.into_iter().zip([false, true]));
    for (point, half_way) in points {
        let mut hider = None;
        for other in holding(point, checks, trees).filter(|&other| other != index) {
            let o = &checks[other];
            if rank(checks, other) > rank(checks, index) {
                hider = Some(other);
            }
            if o.priority == check.priority && o.tissue_index != check.tissue_index {
                let tie = ties.entry(other).or_default();
                tie.points.push(point.as_vec3());
                tie.deep |= half_way;
            }
        }
        seen |= hider.is_none();
        hiders.extend(hider);
    }
    if !seen && !hiders.is_empty() {
        let mut names: Vec<_> = hiders.iter().map(|&i| format!("`{}`", checks[i].name)).collect();
        if names.len() > HIDERS_NAMED {
            let others = names.len() - HIDERS_NAMED;
            names.truncate(HIDERS_NAMED);
            names.push(format!("{others} others"));
        }
        let what = format!("nothing of it (priority {}) is seen behind {}", check.priority, names.join(", "));
        let region = check.bounds_mm.map(|bounds| Region::of(bounds.corners()));
        found.push((index, Finding::new(Defect::Hidden, what).at(region)));
    }
    // A few shallow points mean only that both surfaces approximate the same anatomical border.
    ties.retain(|_, tie| tie.deep || tie.points.len() as f64 >= TIED_PART * probes.len() as f64);
    for (other, Tie { points, .. }) in ties {
        let (loser, winner) = (index.min(other), index.max(other));
        let what = format!(
            "it overlaps `{}`, of another tissue and the same priority {}: the later one in the file, `{}`, wins",
            checks[winner].name, check.priority, checks[winner].name
        );
        found.push((loser, Finding::new(Defect::PriorityTie, what).at([Region::of(points)])));
    }
    found
}

/// Overlap of two surfaces of equal priority: sample points of the first that are inside the second.
#[derive(Default)]
struct Tie {
    points: Vec<Vec3>,
    /// Whether a sample half way through the first surface is inside the second.
    deep: bool,
}

/// Rank of a closed surface; where several overlap, the surface of the highest rank is the medium.
fn rank(checks: &[SurfaceCheck], index: usize) -> (i32, usize) {
    (checks[index].priority, index)
}

/// Indices of the closed surfaces that contain a point.
fn holding<'a>(
    point: DVec3,
    checks: &'a [SurfaceCheck],
    trees: &'a [Option<Tree<'a>>],
) -> impl Iterator<Item = usize> + 'a {
    let p = point.as_vec3();
    let within = move |check: &SurfaceCheck| check.bounds_mm.is_some_and(|bounds| bounds.distance_mm(p) == 0.0);
    let is_held = move |check: &SurfaceCheck, tree: &Option<Tree<'_>>| {
        check.closed && within(check) && tree.as_ref().is_some_and(|tree| tree.holds(point))
    };
    (0..checks.len()).filter(move |&index| is_held(&checks[index], &trees[index]))
}

/// Index of the surface that is the medium at a point; `None` in the background.
pub(super) fn medium(point: DVec3, checks: &[SurfaceCheck], trees: &[Option<Tree<'_>>]) -> Option<usize> {
    holding(point, checks, trees).max_by_key(|&index| rank(checks, index))
}
