//! Winding of triangles: consistent in each part, and outward.

use std::cell::OnceCell;

use glam::DVec3;
use insonify_core::anatomy::{Bounds, Mesh};

use super::edges::{self, NONE, of};
use super::report::{ActionKind, RemainingKind};
use super::work::{Work, area, region, volume};
use crate::segmentation::meshing::winding::Winding;

/// Largest number of a part's corners that are tested for lying inside other parts.
const CORNERS_SAMPLED: usize = 33;
/// Least winding number of a part about corners that lie within; about half in the plane of a rim.
const HELD: f64 = 0.4;
/// Least volume of an open part that shows which way it faces, relative to the power 1.5 of its area; 0.094 for a sphere.
const BULGE: f64 = 0.02;

/// Makes the winding of each component consistent by turning over triangles of the least total area.
pub(super) fn make_consistent(work: &mut Work) {
    let edges = edges::sorted(&work.mesh.triangles);
    let next = edges::neighbours(work.mesh.triangles.len(), &edges);
    let count = work.mesh.triangles.len();
    let mut turn: Vec<Option<bool>> = vec![None; count];
    let mut turned = Vec::new();
    let mut queue = Vec::new();
    for seed in 0..count {
        if turn[seed].is_some() {
            continue;
        }
        turn[seed] = Some(false);
        queue.clear();
        queue.push(seed as u32);
        let mut at = 0;
        while let Some(&t) = queue.get(at) {
            at += 1;
            let own = turn[t as usize] == Some(true);
            for (side, &other) in next[t as usize].iter().enumerate() {
                if other == NONE {
                    continue;
                }
                let [from, to] = of(work.mesh.triangles[t as usize])[side];
                let runs_alike = of(work.mesh.triangles[other as usize]).contains(&[from, to]);
                let wanted = own != runs_alike;
                if turn[other as usize].is_none() {
                    turn[other as usize] = Some(wanted);
                    queue.push(other);
                }
            }
        }
        // Turning over the other triangles of the component instead has the same effect, so the smaller area is chosen.
        let area_of = |want: bool| -> f64 {
            let wanted = queue.iter().filter(|&&t| turn[t as usize] == Some(want));
            wanted.map(|&t| area(work.corners(work.mesh.triangles[t as usize]))).sum()
        };
        if queue.iter().any(|&t| turn[t as usize] == Some(true)) {
            let less = area_of(true) <= area_of(false);
            turned.extend(queue.iter().copied().filter(|&t| turn[t as usize] == Some(less)));
        }
    }
    let region = work.region_of(turned.iter().map(|&t| work.mesh.triangles[t as usize]));
    turned.iter().for_each(|&t| work.mesh.triangles[t as usize].swap(1, 2));
    work.log(ActionKind::Turned, turned.len(), [region]);
}

/// Reports edges between triangles that face opposite ways as remaining defects.
pub(super) fn check(work: &mut Work) {
    let edges = edges::sorted(&work.mesh.triangles);
    let alike: Vec<[u32; 3]> = edges::groups(&edges)
        .filter(|group| matches!(group, [a, b] if a.back == b.back))
        .map(|group| work.mesh.triangles[group[0].triangle as usize])
        .collect();
    let region = work.region_of(alike.iter().copied());
    work.leave(RemainingKind::OneSided, alike.len(), [region]);
}

/// A component of the surface: triangles connected over edges.
pub(super) struct Part {
    pub(super) bounds: Bounds,
    /// Some corners of the part, spread evenly over its triangles.
    corners: Vec<glam::Vec3>,
    pub(super) triangles: usize,
    pub(super) area_mm2: f64,
    /// Signed volume, mm³: positive if the part faces outward. Holes count as closed by fans about the middle of all
    /// rims.
    pub(super) volume_mm3: f64,
    /// Whether the part has an edge of its own: of no other triangle.
    pub(super) has_rim: bool,
}

/// Components of a mesh, and for each triangle the index of its component.
pub(super) fn parts(mesh: &Mesh) -> (Vec<Part>, Vec<u32>) {
    let edges = edges::sorted(&mesh.triangles);
    let part_of = edges::components(mesh.triangles.len(), &edges);
    let mut counts = vec![0usize; part_of.iter().max().map_or(0, |&last| last as usize + 1)];
    part_of.iter().for_each(|&index| counts[index as usize] += 1);
    let new = |_: &usize| Part {
        bounds: Bounds::EMPTY,
        corners: Vec::new(),
        triangles: 0,
        area_mm2: 0.0,
        volume_mm3: 0.0,
        has_rim: false,
    };
    let mut parts: Vec<Part> = counts.iter().map(new).collect();
    // Any point will do for a closed part.
    let first = mesh.vertices_mm.first().copied().unwrap_or_default().as_dvec3();
    let mut rims = vec![(DVec3::ZERO, 0.0); parts.len()];
    for group in edges::groups(&edges).filter(|group| group.len() != 2) {
        for edge in group {
            let index = part_of[edge.triangle as usize] as usize;
            parts[index].has_rim |= group.len() == 1;
            let ends = [edge.low, edge.high].map(|v| mesh.vertices_mm[v as usize].as_dvec3());
            let length = ends[0].distance(ends[1]);
            rims[index].0 += 0.5 * length * (ends[0] + ends[1]);
            rims[index].1 += length;
        }
    }
    let centre = |index: u32| match rims[index as usize] {
        (sum, length) if length > 0.0 => sum / length,
        _ => first,
    };
    for (corners, &index) in mesh.corners_mm().zip(&part_of) {
        let part = &mut parts[index as usize];
        part.bounds = corners.into_iter().fold(part.bounds, Bounds::with);
        if part.triangles.is_multiple_of(counts[index as usize].div_ceil(CORNERS_SAMPLED)) {
            part.corners.push(corners[0]);
        }
        part.triangles += 1;
        let centre = centre(index);
        let corners = corners.map(|v| v.as_dvec3() - centre);
        part.area_mm2 += area(corners);
        part.volume_mm3 += volume(corners);
    }
    (parts, part_of)
}

/// Turns parts over so that they face outward. Parts within an odd number of other parts are cavities and face inward.
pub(super) fn face_outward(work: &mut Work) {
    drop_doubled(work);
    let (parts, part_of) = parts(&work.mesh);
    let depths: Vec<usize> = holders(&work.mesh, &parts, &part_of).iter().map(Vec::len).collect();
    // What is nearly flat has no inside of its own. All such parts keep their directions in the file to each other.
    let is_flat = |part: &Part| part.has_rim && part.volume_mm3.abs() < BULGE * part.area_mm2.powf(1.5);
    let flat_mm3: f64 = parts.iter().filter(|part| is_flat(part)).map(|part| part.volume_mm3).sum();
    let (mut turned, mut cavities) = (Vec::new(), Vec::new());
    for (index, (part, depth)) in parts.iter().zip(&depths).enumerate() {
        let is_cavity = depth % 2 == 1;
        match (part.volume_mm3 > 0.0, is_cavity) {
            _ if is_flat(part) && flat_mm3 < 0.0 => turned.push(index),
            _ if is_flat(part) => {}
            (true, true) => cavities.push(index),
            (false, false) => turned.push(index),
            _ => {}
        }
    }
    // If every part faces the wrong way, the whole surface was inside out: its cavities count as turned parts.
    if turned.len() + cavities.len() == parts.len() {
        turned.append(&mut cavities);
        turned.sort_unstable();
    }
    let mut turns = vec![false; parts.len()];
    turned.iter().chain(&cavities).for_each(|&index| turns[index] = true);
    for (triangle, &index) in work.mesh.triangles.iter_mut().zip(&part_of) {
        if turns[index as usize] {
            triangle.swap(1, 2);
        }
    }
    let at = |list: &[usize]| list.iter().map(|&index| region(parts[index].bounds.corners())).collect::<Vec<_>>();
    let (turned_at, cavities_at) = (at(&turned), at(&cavities));
    work.log(ActionKind::TurnedPart, turned.len(), turned_at);
    work.log(ActionKind::Cavity, cavities.len(), cavities_at);
}

/// Smallest ratio of a part's volume to that of a part around it at which both count as one surface drawn twice.
const DOUBLED_SHARE: f64 = 0.9;

/// Removes parts just within another part that faces the same way: surfaces that were exported twice, slightly offset.
/// A cavity faces the other way.
fn drop_doubled(work: &mut Work) {
    let (parts, part_of) = parts(&work.mesh);
    let holders = holders(&work.mesh, &parts, &part_of);
    let is_doubled = |(index, around): (usize, &Vec<usize>)| {
        let volume = parts[index].volume_mm3;
        around.iter().any(|&other| {
            let share = volume / parts[other].volume_mm3;
            (DOUBLED_SHARE..1.0).contains(&share)
        })
    };
    let gone: Vec<bool> = holders.iter().enumerate().map(is_doubled).collect();
    let regions: Vec<_> = (0..parts.len()).filter(|&i| gone[i]).map(|i| region(parts[i].bounds.corners())).collect();
    if regions.is_empty() {
        return;
    }
    let keep: Vec<bool> = part_of.iter().map(|&index| !gone[index as usize]).collect();
    work.retain(&keep);
    work.log(ActionKind::Doubled, regions.len(), regions);
}

/// For each part, the indices of the parts that enclose it, judged by its sampled corners.
fn holders(mesh: &Mesh, parts: &[Part], part_of: &[u32]) -> Vec<Vec<usize>> {
    let mut triangles = vec![Vec::new(); parts.len()];
    (0u32..).zip(part_of).for_each(|(triangle, &index)| triangles[index as usize].push(triangle));
    let windings: Vec<OnceCell<Winding>> = parts.iter().map(|_| OnceCell::new()).collect();
    let winding = |index: usize| {
        windings[index].get_or_init(|| Winding::of(triangles[index].iter().map(|&t| mesh.corners_of(t))))
    };
    let around = |(index, part): (usize, &Part)| {
        let could_hold = |other: &usize| *other != index && parts[*other].bounds.holds(part.bounds);
        let holds = |other: &usize| {
            let held = part.corners.iter().filter(|c| winding(*other).number(c.as_dvec3()).abs() > HELD).count();
            // Where parts touch, a corner may be on either side; near the hole of an open part, half are outside.
            10 * held >= if parts[*other].has_rim { 5 } else { 9 } * part.corners.len()
        };
        (0..parts.len()).filter(could_hold).filter(holds).collect()
    };
    parts.iter().enumerate().map(around).collect()
}
