//! Caps of a surface where it was cut.
//!
//! A rim that lies in a plane is closed by triangles from its middle. They may overlap where the rim isn't convex: there,
//! their winding numbers cancel.
//!
//! Other rims along sides of the surface's bounding box, where a scan ended, tell by their direction which part of a side
//! the solid covers: at each place the nearest edge of a rim decides.

use std::collections::{BTreeMap, HashMap, HashSet};

use glam::{DVec2, DVec3, Vec3};
use insonify_core::anatomy::Mesh;
use insonify_core::anatomy::doctor::Region;
use insonify_core::anatomy::groups::Groups;
use rayon::prelude::*;

use super::edges;
use super::work::region;

/// Largest distance of a rim from a plane, mm, and as a share of the mean edge of all rims. Decimation and smoothing
/// move rims out of their plane.
const ON_MM: f64 = 2e-3;
const ON_PART: f64 = 0.03;
/// Least share of a rim's length on sides of the box that makes it a cut.
const CUT_PART: f32 = 0.7;
/// Fewest edges of rims on a side.
const EDGES_MIN: usize = 3;
/// Most tiles along a side of the box.
const TILES: f64 = 400.0;

/// A side of the bounding box.
struct Side {
    axis: usize,
    is_high: bool,
    /// Edges of rims: start and end in the plane, mm, with the solid to the left of each.
    rims: Vec<[DVec2; 2]>,
    /// Covered tiles, along the next axis first.
    tiles: Vec<bool>,
}

/// Size of all sides' tiles.
struct Box3 {
    low: DVec3,
    high: DVec3,
    tile_mm: f64,
}

impl Side {
    fn of(axis: usize, is_high: bool, rims: &[[Vec3; 2]]) -> Self {
        let mut side = Self { axis, is_high, rims: Vec::new(), tiles: Vec::new() };
        // The triangle that closes a rim runs from the second end to the first. Its solid lies to the left, seen from
        // outside, where the axes of low sides are mirrored.
        let flat = |v: Vec3| side.flat(v.as_dvec3());
        side.rims =
            rims.iter().map(|[a, b]| if is_high { [flat(*b), flat(*a)] } else { [flat(*a), flat(*b)] }).collect();
        side.rims.retain(|[a, b]| a != b);
        side
    }

    /// Axes in the plane. Seen from outside, the second lies to the left of the first for high sides.
    fn axes(&self) -> [usize; 2] {
        [(self.axis + 1) % 3, (self.axis + 2) % 3]
    }

    /// Number of tiles along both axes.
    fn counts(&self, all: &Box3) -> [usize; 2] {
        self.axes().map(|axis| ((all.high[axis] - all.low[axis]) / all.tile_mm).ceil().max(1.0) as usize)
    }

    /// Corner of a tile, mm.
    fn corner(&self, all: &Box3, [u, v]: [usize; 2]) -> DVec3 {
        let [first, second] = self.axes();
        let mut at = if self.is_high { all.high } else { all.low };
        at[first] = (all.low[first] + all.tile_mm * u as f64).min(all.high[first]);
        at[second] = (all.low[second] + all.tile_mm * v as f64).min(all.high[second]);
        at
    }

    fn flat(&self, at: DVec3) -> DVec2 {
        let [first, second] = self.axes();
        DVec2::new(at[first], at[second])
    }

    /// Covers the tiles whose middle lies to the left of the nearest edge.
    fn cover(&mut self, all: &Box3) {
        let [count, rows] = self.counts(all);
        let of_tile = |n: usize| {
            let at = [n % count, n / count];
            let middle = 0.5 * (self.corner(all, at) + self.corner(all, at.map(|n| n + 1)));
            is_covered(&self.rims, self.flat(middle))
        };
        self.tiles = (0..count * rows).into_par_iter().map(of_tile).collect();
    }

    /// Region of the covered tiles.
    fn region(&self, all: &Box3) -> Region {
        let [count, _] = self.counts(all);
        let covered = (0..self.tiles.len()).filter(|&n| self.tiles[n]).map(|n| [n % count, n / count]);
        region(covered.flat_map(|at| [at, at.map(|n| n + 1)]).map(|at| self.corner(all, at).as_vec3()))
    }

    /// Adds triangles of the covered tiles, facing outward; squares of covered tiles in one piece.
    fn triangles(&self, all: &Box3, mesh: &mut Mesh) {
        let [count, rows] = self.counts(all);
        let side = count.max(rows).next_power_of_two();
        let covered = |u: usize, v: usize| u < count && v < rows && self.tiles[v * count + u];
        let mut squares = vec![[0, 0, side]];
        while let Some([u, v, side]) = squares.pop() {
            let within = || (v..v + side).flat_map(|row| (u..u + side).map(move |column| (column, row)));
            let number = within().filter(|&(column, row)| covered(column, row)).count();
            if number == 0 {
                continue;
            }
            if number < side * side {
                let half = side / 2;
                squares.extend([[u, v, half], [u + half, v, half], [u, v + half, half], [u + half, v + half, half]]);
                continue;
            }
            let first = mesh.vertices_mm.len() as u32;
            let corners = [[u, v], [u + side, v], [u + side, v + side], [u, v + side]];
            mesh.vertices_mm.extend(corners.map(|at| self.corner(all, at).as_vec3()));
            for [a, b, c] in [[0, 1, 2], [0, 2, 3]] {
                let [b, c] = if self.is_high { [b, c] } else { [c, b] };
                mesh.triangles.push([a, b, c].map(|n| first + n));
            }
        }
    }
}

/// Whether a point lies to the left of the nearest edge. Where two edges are equally near, as at a corner, the one whose line
/// is farther away decides.
fn is_covered(rims: &[[DVec2; 2]], at: DVec2) -> bool {
    let mut best = (f64::INFINITY, 0.0);
    for [from, to] in rims {
        let along = *to - *from;
        let share = ((at - *from).dot(along) / along.length_squared()).clamp(0.0, 1.0);
        let off = at - (*from + share * along);
        let beside = along.perp_dot(at - *from) / along.length();
        let distance = off.length();
        let is_tie = (distance - best.0).abs() <= 1e-9 * distance;
        if (is_tie && beside.abs() > f64::abs(best.1)) || (!is_tie && distance < best.0) {
            best = (distance, beside);
        }
    }
    best.1 > 0.0
}

/// The surface with the caps of its cuts, and the regions of these cuts; caps at sides of the bounding box on tiles of
/// about `tile_mm`. Rims in one plane count as one cut, unless they are smaller than `small_mm`. The winding of the
/// surface must be consistent.
pub(super) fn capped(mesh: &Mesh, tile_mm: f64, small_mm: f64) -> (Mesh, Vec<Region>) {
    let mut closed = mesh.clone();
    let mut open = edges::open(&mesh.triangles);
    if open.is_empty() {
        return (closed, Vec::new());
    }
    let length: f32 = open
        .iter()
        .map(|edge| {
            let [a, b] = ends(mesh, edge);
            a.distance(b)
        })
        .sum();
    let on_mm = ON_MM.max(ON_PART * f64::from(length) / open.len() as f64);
    let mut regions = close_flat(&mut closed, &mut open, on_mm, small_mm);
    regions.extend(close_sides(&mut closed, &open, tile_mm, on_mm));
    (closed, regions)
}

/// Ends of an edge, mm.
fn ends(mesh: &Mesh, edge: &[u32; 2]) -> [Vec3; 2] {
    edge.map(|v| mesh.vertices_mm[v as usize])
}

/// Closes the rims that lie in planes and removes their edges from `open`. Returns a region for each plane with rims
/// larger than `small_mm`, and for each smaller rim.
fn close_flat(mesh: &mut Mesh, open: &mut Vec<[u32; 2]>, on_mm: f64, small_mm: f64) -> Vec<Region> {
    let rim_of = rims(open, mesh.vertices_mm.len());
    let mut edges = BTreeMap::<u32, Vec<[u32; 2]>>::new();
    open.iter().for_each(|edge| edges.entry(rim_of[edge[0] as usize]).or_default().push(*edge));
    let (mut cuts, mut regions) = (Vec::<Plane>::new(), Vec::new());
    let mut closed = HashSet::new();
    for (rim, edges) in edges {
        let points: Vec<Vec3> = edges.iter().flat_map(|edge| ends(mesh, edge)).collect();
        let middle = points.iter().map(|v| v.as_dvec3()).sum::<DVec3>() / points.len() as f64;
        let of_edge = |edge: &[u32; 2]| {
            let [a, b] = ends(mesh, edge).map(|v| v.as_dvec3() - middle);
            a.cross(b)
        };
        let normal = edges.iter().map(of_edge).sum::<DVec3>().normalize_or_zero();
        let plane = Plane { normal, middle, points };
        if normal == DVec3::ZERO || !plane.holds(&plane.points, on_mm) {
            continue;
        }
        let centre = mesh.vertices_mm.len() as u32;
        mesh.vertices_mm.push(middle.as_vec3());
        mesh.triangles.extend(edges.iter().map(|[a, b]| [*b, *a, centre]));
        closed.insert(rim);
        let region = region(plane.points.iter().copied());
        if f64::from(region.size_mm) <= small_mm {
            regions.push(region);
            continue;
        }
        match cuts.iter_mut().find(|cut| cut.holds(&plane.points, on_mm)) {
            Some(cut) => cut.points.extend(plane.points),
            None => cuts.push(plane),
        }
    }
    open.retain(|edge| !closed.contains(&rim_of[edge[0] as usize]));
    regions.extend(cuts.into_iter().map(|cut| region(cut.points)));
    regions
}

/// Plane of one or more rims.
struct Plane {
    /// Unit normal.
    normal: DVec3,
    middle: DVec3,
    /// Corners of the rims, mm.
    points: Vec<Vec3>,
}

impl Plane {
    fn holds(&self, points: &[Vec3], within_mm: f64) -> bool {
        points.iter().all(|v| self.normal.dot(v.as_dvec3() - self.middle).abs() <= within_mm)
    }
}

/// Adds triangles that close the surface at the sides of its bounding box. Returns a region for each side with rims.
fn close_sides(mesh: &mut Mesh, open: &[[u32; 2]], tile_mm: f64, on_mm: f64) -> Vec<Region> {
    let Some(bounds) = mesh.bounds_mm().filter(|_| !open.is_empty()) else { return Vec::new() };
    let (low, high) = (bounds.min.as_dvec3(), bounds.max.as_dvec3());
    let all = Box3 { low, high, tile_mm: tile_mm.max((high - low).max_element() / TILES) };
    let sides = [0, 1, 2].map(|axis| [false, true].map(|is_high| (axis, is_high)));
    let sides: Vec<(usize, bool)> = sides.into_iter().flatten().collect();
    let is_on = |[a, b]: [Vec3; 2], (axis, is_high): (usize, bool)| {
        let place = if is_high { high[axis] } else { low[axis] };
        [a, b].iter().all(|v| (f64::from(v[axis]) - place).abs() <= on_mm)
    };
    // Rims that only touch a side are no cuts.
    let is_cut = cut_rims(open, mesh, |edge| sides.iter().any(|side| is_on(edge, *side)));
    // An edge on two sides, an edge of the box, tells nothing.
    let side_of = |edge: &[u32; 2]| {
        let edge = ends(mesh, edge);
        let mut on = sides.iter().filter(|side| is_on(edge, **side));
        on.next().filter(|_| on.next().is_none()).map(|side| (edge, *side))
    };
    let cuts = open.iter().zip(is_cut).filter(|(_, is_cut)| *is_cut);
    let on_one: Vec<([Vec3; 2], (usize, bool))> = cuts.filter_map(|(edge, _)| side_of(edge)).collect();
    let found = |&(axis, is_high): &(usize, bool)| {
        let own: Vec<[Vec3; 2]> =
            on_one.iter().filter(|(_, on)| *on == (axis, is_high)).map(|(edge, _)| *edge).collect();
        Side::of(axis, is_high, &own)
    };
    let mut sides: Vec<Side> = sides.iter().map(found).collect();
    for side in sides.iter_mut().filter(|side| side.rims.len() >= EDGES_MIN) {
        side.cover(&all);
    }
    if sides.iter().all(|side| side.tiles.is_empty()) {
        return Vec::new();
    }
    fill_whole(&mut sides, &all);
    sides.iter().filter(|side| !side.tiles.is_empty()).for_each(|side| side.triangles(&all, mesh));
    let capped = sides.iter().filter(|side| side.rims.len() >= EDGES_MIN && side.tiles.contains(&true));
    capped.map(|side| side.region(&all)).collect()
}

/// For each vertex, the number of its rim: edges that share ends.
fn rims(open: &[[u32; 2]], vertices: usize) -> Vec<u32> {
    let mut rims = Groups::new(vertices);
    open.iter().for_each(|&[a, b]| rims.join(a, b));
    rims.numbered()
}

/// For each open edge, whether its rim is a cut: most of its length lies on sides of the box.
fn cut_rims(open: &[[u32; 2]], mesh: &Mesh, is_on: impl Fn([Vec3; 2]) -> bool) -> Vec<bool> {
    let rim_of = rims(open, mesh.vertices_mm.len());
    let mut lengths = HashMap::<u32, [f32; 2]>::new();
    for edge in open {
        let ends = ends(mesh, edge);
        let [on, all] = lengths.entry(rim_of[edge[0] as usize]).or_default();
        let length = ends[0].distance(ends[1]);
        *all += length;
        *on += if is_on(ends) { length } else { 0.0 };
    }
    let is_cut =
        |edge: &[u32; 2]| lengths.get(&rim_of[edge[0] as usize]).is_some_and(|[on, all]| *on >= CUT_PART * all);
    open.iter().map(is_cut).collect()
}

/// Covers a side without rims wholly if most of its border is covered on the neighbouring sides.
fn fill_whole(sides: &mut [Side], all: &Box3) {
    let covered = |of: &Side, at: DVec3| {
        let [count, rows] = of.counts(all);
        let [first, second] = of.axes();
        let tile = |axis: usize, most: usize| {
            (((at[axis] - all.low[axis]) / all.tile_mm).floor().max(0.0) as usize).min(most - 1)
        };
        of.tiles[tile(second, rows) * count + tile(first, count)]
    };
    for n in 0..sides.len() {
        if !sides[n].tiles.is_empty() {
            continue;
        }
        let (mut inside, mut known) = (0, 0);
        for other in sides.iter().filter(|other| other.axis != sides[n].axis && !other.tiles.is_empty()) {
            let along = 3 - other.axis - sides[n].axis;
            let mut at = if sides[n].is_high { all.high } else { all.low };
            at[other.axis] = if other.is_high { all.high[other.axis] } else { all.low[other.axis] };
            for step in 0..32 {
                at[along] = all.low[along] + (f64::from(step) + 0.5) / 32.0 * (all.high[along] - all.low[along]);
                inside += usize::from(covered(other, at));
                known += 1;
            }
        }
        if 2 * inside > known {
            let [count, rows] = sides[n].counts(all);
            sides[n].tiles = vec![true; count * rows];
        }
    }
}
