//! Remeshing of surfaces that are open or cross themselves: the contour of the region with a winding number of at least ½.

use std::collections::HashSet;

use glam::{DVec2, DVec3, Vec3};
use insonify_core::anatomy::Mesh;
use insonify_core::anatomy::doctor::{Region, crossing, tree::Tree};
use rayon::prelude::*;

use super::caps::capped;
use super::edges;
use super::report::{ActionKind, RemainingKind};
use super::work::{Work, region};
use super::{RepairSettings, orient};
use crate::segmentation::meshing::contour::{
    Contour, Crossing, Grid, Origin, Solid, Vertex, around, bisected, touching,
};
use crate::segmentation::meshing::winding::{Hit, Winding};

/// Fewest voxels along the longest side, most for the detail of the surface, and most for a small allowed move.
const VOXELS: [f64; 3] = [40.0, 300.0, 600.0];
/// Largest move of a vertex within its cell, voxels.
const MOVE_VOXELS: f64 = 0.85;
/// Distance from the result, voxels, beyond which a given triangle is not part of it.
const APART_VOXELS: f64 = 1.5;
/// Distance from a triangle, voxels, at which the winding number on its sides is taken.
const BESIDE_VOXELS: f64 = 1e-3;
/// Largest deviation of a fill from a plane at which it is a flat cap, voxels.
const FLAT_VOXELS: f64 = 0.5;

/// Whether a surface is closed, with two triangles at each edge, and doesn't pass through itself.
pub(super) fn is_sound(work: &Work) -> bool {
    let edges = edges::sorted(&work.mesh.triangles);
    let paired = edges::groups(&edges).all(|group| matches!(group, [a, b] if a.back != b.back));
    if !paired || work.mesh.triangles.is_empty() {
        return paired;
    }
    let (_, part_of) = orient::parts(&work.mesh);
    let found = Tree::new(&work.mesh).map(|tree| crossing::find(&tree, &part_of));
    found.is_none_or(|found| !found.are_serious(work.mesh.triangles.len()))
}

/// The region with a winding number of at least ½, of a surface with its caps.
struct Wound {
    winding: Winding,
    /// Number of the surface's triangles; those of the caps follow.
    given: usize,
    /// Edges that neither the surface nor its caps pair, as triangles without area.
    rims: Winding,
}

impl Wound {
    fn of(closed: &Mesh, given: usize) -> Self {
        let place = |v: u32| closed.vertices_mm[v as usize];
        let edges = edges::sorted(&closed.triangles);
        // Caps close each other, though their edges differ.
        let is_rim = |group: &&[edges::Edge]| {
            let is_given = group.iter().any(|edge| (edge.triangle as usize) < given);
            is_given && 2 * group.iter().filter(|edge| edge.back).count() != group.len()
        };
        let rims = edges::groups(&edges).filter(is_rim);
        let rims = rims.map(|group| [group[0].low, group[0].high, group[0].high].map(place));
        Self { winding: Winding::of(closed.corners_mm()), given, rims: Winding::of(rims) }
    }

    /// The number about a point, if it is whole within the error of its series.
    fn whole_number(&self, at_mm: DVec3) -> Option<i32> {
        let number = self.winding.number(at_mm);
        ((number - number.round()).abs() < 0.1).then_some(number.round() as i32)
    }

    /// Crossing of a segment at which the surface begins or ends, if it is one of a triangle.
    fn change(&self, from_mm: DVec3, to_mm: DVec3) -> Option<Hit> {
        let hits = self.winding.hits(from_mm, to_mm);
        if let [hit] = hits[..] {
            return Some(hit);
        }
        let first = self.holds(from_mm);
        let ends = hits.iter().skip(1).map(|hit| hit.share).chain([1.0]);
        let mut spans = hits.iter().zip(ends).filter(|(hit, end)| end - hit.share > 1e-6);
        spans.find(|(hit, end)| self.holds(from_mm.lerp(to_mm, 0.5 * (hit.share + end))) != first).map(|(hit, _)| *hit)
    }
}

impl Solid for Wound {
    fn holds(&self, at_mm: DVec3) -> bool {
        self.winding.number(at_mm) >= 0.5
    }

    fn whole(&self, low_mm: DVec3, high_mm: DVec3) -> Option<bool> {
        let (centre, radius) = (0.5 * (low_mm + high_mm), 0.5 * low_mm.distance(high_mm));
        if self.winding.nearest(centre, radius).is_some() {
            return None;
        }
        // Away from triangles the number is harmonic, so it can't hide much between the corners.
        let corner =
            |n: usize| DVec3::from_array([0, 1, 2].map(|a| if n >> a & 1 == 1 { high_mm[a] } else { low_mm[a] }));
        let numbers = (0..8).map(corner).map(|at| self.winding.number(at));
        let (least, most) = numbers.fold((f64::INFINITY, f64::NEG_INFINITY), |(a, b), n| (a.min(n), b.max(n)));
        if least > 0.75 {
            Some(true)
        } else if most < 0.25 {
            Some(false)
        } else {
            None
        }
    }

    /// Away from rims, the numbers of a grid differ by the crossings between its points.
    fn grid(&self, grid: &Grid) -> Option<Vec<bool>> {
        let high_mm = grid.point(grid.counts);
        let (centre, radius) = (0.5 * (grid.low_mm + high_mm), 0.5 * grid.low_mm.distance(high_mm));
        if self.rims.nearest(centre, radius + grid.step_mm).is_some() {
            return None;
        }
        let first = self.whole_number(grid.low_mm)?;
        let numbers = numbers(&self.winding.near(centre, radius), first, grid);
        let last = grid.counts.map(|n| n - 1);
        let corner = |n: usize| [0, 1, 2].map(|axis| if n >> axis & 1 == 1 { last[axis] } else { 0 });
        let is_known = |[x, y, z]: [usize; 3]| {
            let found = numbers[(z * grid.counts[1] + y) * grid.counts[0] + x];
            self.whole_number(grid.point([x, y, z])) == Some(found)
        };
        (1..8).map(corner).all(is_known).then(|| numbers.iter().map(|&number| number > 0).collect())
    }

    fn crossing(&self, from_mm: DVec3, to_mm: DVec3) -> Crossing {
        if let Some(hit) = self.change(from_mm, to_mm) {
            let origin = if (hit.triangle as usize) < self.given { Origin::Given } else { Origin::Cap };
            return Crossing { at_mm: from_mm.lerp(to_mm, hit.share), normal: hit.normal, origin };
        }
        let at_mm = bisected(from_mm, to_mm, |at| self.holds(at));
        // The number falls along the normal.
        let step = 0.5 * from_mm.distance(to_mm);
        let along = |axis: DVec3| self.winding.number(at_mm - step * axis) - self.winding.number(at_mm + step * axis);
        let normal = DVec3::from_array(DVec3::AXES.map(along)).normalize_or_zero();
        Crossing { at_mm, normal, origin: Origin::Fill }
    }
}

/// Winding numbers about the points of a grid, from that about its first: each triangle between two points that faces
/// along the axis takes one away. Rows along z lead to those along y, and these to all along x.
fn numbers(triangles: &[[DVec3; 3]], first: i32, grid: &Grid) -> Vec<i32> {
    let [nx, ny, nz] = grid.counts;
    let mut steps = vec![0; nx * ny * nz];
    let index = |[x, y, z]: [usize; 3]| (z * ny + y) * nx + x;
    for corners in triangles {
        cross(corners, 2, [1, 1], grid, |at, by| steps[index(at)] += by);
        cross(corners, 1, [nz, 1], grid, |at, by| steps[index(at)] += by);
        cross(corners, 0, [ny, nz], grid, |at, by| steps[index(at)] += by);
    }
    // A point's step is that from the point before it: along x, at x = 0 along y, at x = y = 0 along z.
    steps[0] = first;
    for z in 0..nz {
        for y in 0..ny {
            for x in 0..nx {
                let before = match [x, y, z] {
                    [0, 0, 0] => continue,
                    [0, 0, z] => [0, 0, z - 1],
                    [0, y, z] => [0, y - 1, z],
                    [x, y, z] => [x - 1, y, z],
                };
                steps[index([x, y, z])] += steps[index(before)];
            }
        }
    }
    steps
}

/// Calls `of` for each row along `axis` that a triangle crosses between two points: with the second of them and the
/// change of the number. `rows` are the numbers of rows along the two axes that follow `axis`.
fn cross(corners: &[DVec3; 3], axis: usize, rows: [usize; 2], grid: &Grid, mut of: impl FnMut([usize; 3], i32)) {
    let across = [(axis + 1) % 3, (axis + 2) % 3];
    let places = corners.map(|v| (v - grid.low_mm) / grid.step_mm);
    let flat = places.map(|v| DVec2::new(v[across[0]], v[across[1]]));
    let normal = (places[1] - places[0]).cross(places[2] - places[0]);
    if normal[axis] == 0.0 {
        return;
    }
    let range = |n: usize| {
        let low = flat.iter().map(|v| v[n]).fold(f64::INFINITY, f64::min).ceil().max(0.0) as usize;
        let high = flat.iter().map(|v| v[n]).fold(f64::NEG_INFINITY, f64::max).floor();
        low..if high < 0.0 { 0 } else { (high as usize + 1).min(rows[n]) }
    };
    for (v, u) in range(1).flat_map(|v| range(0).map(move |u| (v, u))) {
        let at = DVec2::new(u as f64, v as f64);
        let sides = [0, 1, 2].map(|n| is_left(flat[n], flat[(n + 1) % 3], at));
        if sides[0] != sides[1] || sides[1] != sides[2] {
            continue;
        }
        let off = at - flat[0];
        let place = places[0][axis] - (normal[across[0]] * off.x + normal[across[1]] * off.y) / normal[axis];
        let next = place.ceil();
        if next >= 1.0 && next < grid.counts[axis] as f64 {
            let mut point = [0; 3];
            (point[axis], point[across[0]], point[across[1]]) = (next as usize, u, v);
            of(point, if normal[axis] > 0.0 { -1 } else { 1 });
        }
    }
}

/// Whether a point lies to the left of an edge. A point on an edge of two triangles lies in exactly one of them.
fn is_left(from: DVec2, to: DVec2, at: DVec2) -> bool {
    let is_turned = (to.x, to.y) < (from.x, from.y);
    let [low, high] = if is_turned { [to, from] } else { [from, to] };
    ((high - low).perp_dot(at - low) >= 0.0) != is_turned
}

/// Side of the voxels for a surface, mm: half its mean edge, and small enough for the allowed move, within limits.
fn voxel_mm(mesh: &Mesh, max_move_mm: f64) -> f64 {
    let extent_mm = mesh.bounds_mm().map_or(0.0, |bounds| f64::from(bounds.size().max_element()));
    let edges = mesh.corners_mm().flat_map(|[a, b, c]| [a.distance(b), b.distance(c), c.distance(a)]);
    let mean_mm = edges.map(f64::from).sum::<f64>() / (3 * mesh.triangles.len()).max(1) as f64;
    let [coarse_mm, fine_mm, least_mm] = VOXELS.map(|voxels| extent_mm / voxels);
    (0.5 * mean_mm).clamp(fine_mm, coarse_mm).min((max_move_mm / MOVE_VOXELS).max(least_mm))
}

/// Replaces the surface by the contour of the region with a winding number of at least ½.
pub(super) fn remesh(work: &mut Work, settings: &RepairSettings) {
    let given = std::mem::take(&mut work.mesh);
    let voxel_mm = voxel_mm(&given, settings.max_move_mm);
    let Some(bounds) = given.bounds_mm() else { return };
    let (closed, capped) = capped(&given, voxel_mm, settings.small_hole_mm);
    let solid = Wound::of(&closed, given.triangles.len());
    let contour = Contour::of(&solid, bounds, voxel_mm, given.triangles.len().max(1000));
    drop(closed);

    work.mesh = contour.mesh.clone();
    work.log(ActionKind::Remeshed, given.triangles.len(), [region(bounds.corners())]);
    log_fills(work, &contour, capped, settings.small_hole_mm);
    let surface = Winding::of(given.corners_mm());
    log_left_out(work, &given, &contour, &solid);
    drop(solid);
    work.moved_mm = moved_mm(&contour, &surface);
    let limit_mm = settings.max_move_mm.max(0.0);
    if f64::from(work.moved_mm) > limit_mm {
        work.leave(RemainingKind::Moved, 1, [region(bounds.corners())]);
    }
}

/// Largest distance of the result from the given surface, mm, apart from caps and fills.
fn moved_mm(contour: &Contour, surface: &Winding) -> f32 {
    let new = contour.vertices.iter().filter(|vertex| vertex.origin != Origin::Given);
    let new: HashSet<[u16; 3]> = new.flat_map(|vertex| around(vertex.cell)).collect();
    let within_mm = 10.0 * contour.voxel_mm;
    let distance = |v: &Vec3| {
        let point = surface.nearest(v.as_dvec3(), within_mm);
        point.map_or(within_mm, |point| point.distance(v.as_dvec3())) as f32
    };
    let kept = contour.mesh.vertices_mm.par_iter().filter(|v| !new.contains(&contour.cell(**v)));
    kept.map(distance).reduce(|| 0.0, f32::max)
}

/// Logs the caps of cuts and the fills of holes: small ones apart, and of large ones those that aren't flat as guesses.
fn log_fills(work: &mut Work, contour: &Contour, cuts: Vec<Region>, small_hole_mm: f64) {
    let is_small = |region: &Region| f64::from(region.size_mm) <= small_hole_mm;
    // Cracks along the rim of a cap are part of it.
    let capped = contour.vertices.iter().filter(|vertex| vertex.origin == Origin::Cap);
    let capped: HashSet<[u16; 3]> = capped.flat_map(|vertex| around(vertex.cell)).collect();
    let is_fill = |vertex: &&Vertex| vertex.origin == Origin::Fill && !capped.contains(&vertex.cell);
    let fills: Vec<&Vertex> = contour.vertices.iter().filter(is_fill).collect();
    let cells: Vec<[u16; 3]> = fills.iter().map(|vertex| vertex.cell).collect();
    let (small, large): (Vec<Region>, Vec<Region>) = cuts.into_iter().partition(|region| is_small(region));
    work.cuts.clone_from(&large);
    let mut found = [large, small, Vec::new()];
    for group in touching(&cells) {
        let points: Vec<Vec3> = group.iter().map(|&n| fills[n].at_mm).collect();
        let region = region(points.iter().copied());
        let kind = if is_small(&region) {
            1
        } else if is_flat(&points, FLAT_VOXELS * contour.voxel_mm) {
            0
        } else {
            2
        };
        found[kind].push(region);
    }
    for (kind, regions) in [ActionKind::PlanarCap, ActionKind::SmallHole, ActionKind::Guess].into_iter().zip(found) {
        work.log(kind, regions.len(), regions);
    }
}

/// Whether points lie in a plane.
fn is_flat(points: &[Vec3], within_mm: f64) -> bool {
    let points: Vec<DVec3> = points.iter().map(|v| v.as_dvec3()).collect();
    let Some(&first) = points.first() else { return true };
    let farthest =
        |of: &dyn Fn(DVec3) -> f64| points.iter().copied().fold(first, |a, b| if of(b) > of(a) { b } else { a });
    let a = farthest(&|p| p.distance(first));
    let b = farthest(&|p| p.distance(a));
    let along = (b - a).normalize_or_zero();
    let c = farthest(&|p| (p - a).reject_from(along + DVec3::splat(1e-12)).length());
    let normal = along.cross(c - a).normalize_or_zero();
    // Points on a line lie in any plane.
    normal != DVec3::ZERO && points.iter().all(|p| normal.dot(*p - a).abs() <= within_mm)
}

/// Logs the given triangles that the result has no surface near. Where the number on both sides is alike, they are walls
/// within the solid, or sheets that enclose nothing. The others are parts thinner than the voxels.
fn log_left_out(work: &mut Work, given: &Mesh, contour: &Contour, solid: &Wound) {
    let result = Winding::of(contour.mesh.corners_mm());
    let within_mm = APART_VOXELS * contour.voxel_mm;
    let corners: Vec<[Vec3; 3]> = given.corners_mm().collect();
    let is_border = |corners: &[Vec3; 3]| {
        let [a, b, c] = corners.map(|v| v.as_dvec3());
        let middle = (a + b + c) / 3.0;
        if result.nearest(middle, within_mm).is_some() {
            return None;
        }
        let beside = (b - a).cross(c - a).normalize_or_zero() * BESIDE_VOXELS * contour.voxel_mm;
        Some(solid.holds(middle - beside) != solid.holds(middle + beside))
    };
    let apart: Vec<(bool, [Vec3; 3])> =
        corners.par_iter().filter_map(|corners| Some((is_border(corners)?, *corners))).collect();
    let of = |is_border: bool| apart.iter().filter(move |(is, _)| *is == is_border).map(|(_, corners)| *corners);
    work.log(ActionKind::LeftOut, of(false).count(), [region(of(false).flatten())]);
    work.leave(RemainingKind::Lost, of(true).count(), [region(of(true).flatten())]);
}

#[cfg(test)]
mod tests {
    use insonify_core::anatomy::analytic::{joined, sphere};

    use super::*;

    #[test]
    fn numbers_by_crossings_are_those_of_single_points() {
        // Two balls that overlap, and a cavity.
        let mut cavity = sphere(Vec3::new(-12.0, 2.0, 1.0), 5.0, 3);
        cavity.flip();
        let balls = [sphere(Vec3::new(-10.0, 1.0, 2.0), 20.0, 4), sphere(Vec3::new(12.0, 0.0, -3.0), 18.0, 4), cavity];
        let closed = joined(balls);
        let solid = Wound::of(&closed, closed.triangles.len());
        let (mut passed, mut inside) = (0, 0);
        for n in 0..512usize {
            let at = DVec3::from_array([n % 8, n / 8 % 8, n / 64].map(|n| n as f64));
            let grid = Grid { low_mm: 8.13 * (at - 4.0), step_mm: 1.0171, counts: [8, 7, 8] };
            let found = solid.grid(&grid).unwrap();
            let expected: Vec<bool> = grid.points().map(|at_mm| solid.holds(at_mm)).collect();
            assert_eq!(found, expected, "{:?}", grid.low_mm);
            passed += usize::from(found.contains(&true) && found.contains(&false));
            inside += found.iter().filter(|&&inside| inside).count();
        }
        assert!(passed > 50 && inside > 10_000, "{passed} {inside}");
    }
}
