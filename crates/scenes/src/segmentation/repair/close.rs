//! Closing of open surfaces. Each loop of open edges, a rim, is capped in planes or filled as a hole.

use std::collections::BTreeMap;

use glam::DVec3;
use insonify_core::anatomy::doctor::Region;

use super::RepairSettings;
use super::corners::{self, Turn, Turns};
use super::edges;
use super::fill::{Filler, borders};
use super::loops::loops;
use super::planes::{self, Notch, Plane};
use super::polygon::{self, Border};
use super::report::{ActionKind, RemainingKind};
use super::work::{Work, region};

/// Largest deviation from a plane at which a rim still counts as planar: mm, and as a fraction of the rim's mean edge.
/// Decimation and smoothing move rims out of their plane.
const PLANAR_MM: f64 = 2e-3;
const PLANAR_PART: f64 = 0.03;

/// Fewest rim edges on a side of the surface's bounding box that make it a border of the scan.
const SIDE_EDGES_MIN: usize = 3;

/// A loop of open edges.
struct Rim {
    vertices: Vec<u32>,
    points: Vec<DVec3>,
    region: Region,
    /// Largest distance from a plane at which a vertex counts as on it, mm.
    within_mm: f64,
}

impl Rim {
    /// Largest distances from a plane, mm: a strict one to try first, then the rim's own.
    fn tolerances_mm(&self) -> [f64; 2] {
        [PLANAR_MM, self.within_mm]
    }
}

/// Shape of a rim.
enum Kind {
    /// The whole loop lies in one plane: its index among the known planes.
    Planar(usize),
    /// The loop lies in several planes: for each edge, the index of its plane among the known planes.
    Bent(Vec<usize>),
    /// In no planes.
    Free,
}

/// Closes all loops of open edges. The winding must be consistent in each part.
pub(super) fn close(work: &mut Work, settings: &RepairSettings) {
    let mut rims: Vec<Rim> = loops(&work.mesh.triangles).into_iter().map(|vertices| rim(work, vertices)).collect();
    if rims.is_empty() {
        return;
    }
    rims.sort_by(|a, b| b.region.size_mm.total_cmp(&a.region.size_mm).then(a.vertices.cmp(&b.vertices)));
    let mut known: Vec<Plane> = sides_of_box(work, &rims);
    let sides = known.len();
    let mut kinds: Vec<Kind> = rims.iter().map(|rim| planar(rim, &mut known)).collect();
    for (rim, kind) in rims.iter().zip(&mut kinds).filter(|(_, kind)| matches!(kind, Kind::Free)) {
        *kind = bent(rim, &mut known);
    }
    split_notches(work, &mut rims, &mut kinds, &mut known);
    let mut is_closed = vec![false; rims.len()];
    let mut cuts = Cuts { rims: &rims, kinds: &kinds, known: &known, sides, is_closed: &mut is_closed };
    cuts.cap_bent(work);
    cuts.cap_planar(work);
    let holes: Vec<Vec<u32>> =
        rims.iter().zip(&is_closed).filter(|(_, closed)| !**closed).map(|(rim, _)| rim.vertices.clone()).collect();
    let mut filler = Filler::new(work, &holes);
    holes.iter().for_each(|hole| filler.fill(work, hole));
    report(work, &rims, &kinds, &is_closed, settings);
}

/// Reports edges that are still open as remaining defects.
pub(super) fn check(work: &mut Work) {
    let open = edges::open(&work.mesh.triangles);
    let region = region(open.iter().flatten().map(|&vertex| work.mesh.vertices_mm[vertex as usize]));
    work.leave(RemainingKind::Open, open.len(), [region]);
}

fn rim(work: &Work, vertices: Vec<u32>) -> Rim {
    let points: Vec<DVec3> = vertices.iter().map(|&vertex| work.at(vertex)).collect();
    let region = region(vertices.iter().map(|&vertex| work.mesh.vertices_mm[vertex as usize]));
    let next = points.iter().cycle().skip(1);
    let length: f64 = points.iter().zip(next).map(|(a, b)| a.distance(*b)).sum();
    let within_mm = PLANAR_MM.max(PLANAR_PART * length / points.len().max(1) as f64);
    Rim { vertices, points, region, within_mm }
}

/// `Planar` if the rim lies in one of the `known` planes, or in a plane of its own, which is then appended to `known`.
/// Otherwise `Free`.
fn planar(rim: &Rim, known: &mut Vec<Plane>) -> Kind {
    if let Some(index) =
        known.iter().take(planes::PLANES_REUSED).position(|plane| plane.holds(&rim.points, rim.within_mm))
    {
        return Kind::Planar(index);
    }
    let thin = 0.25 * rim.within_mm.min(1e-3 * f64::from(rim.region.size_mm));
    match Plane::through(&rim.points, thin).filter(|plane| plane.holds(&rim.points, rim.within_mm)) {
        Some(plane) => {
            known.push(plane);
            Kind::Planar(known.len() - 1)
        }
        None => Kind::Free,
    }
}

/// Planes of those sides of the surface's bounding box that contain several rim edges: the borders of an upright scan.
fn sides_of_box(work: &Work, rims: &[Rim]) -> Vec<Plane> {
    let Some(bounds) = work.mesh.bounds_mm() else { return Vec::new() };
    let at = [bounds.min.as_dvec3(), bounds.max.as_dvec3()];
    let planes = DVec3::AXES.into_iter().flat_map(|normal| at.map(|at| Plane { normal, offset_mm: normal.dot(at) }));
    let edges_on = |plane: &Plane| {
        let on = |rim: &Rim| {
            let near = |point: &DVec3| plane.distance_mm(*point) <= rim.within_mm;
            let next = rim.points.iter().cycle().skip(1);
            rim.points.iter().zip(next).filter(|(a, b)| near(a) && near(b)).count()
        };
        rims.iter().map(on).sum::<usize>()
    };
    planes.filter(|plane| edges_on(plane) >= SIDE_EDGES_MIN).collect()
}

/// `Bent` if the rim lies in several planes; new planes are appended to `known`. Otherwise `Free`.
fn bent(rim: &Rim, known: &mut Vec<Plane>) -> Kind {
    // The strict tolerance comes first: it assigns edges near two planes more reliably.
    let found = rim.tolerances_mm().into_iter().find_map(|within_mm| planes::of_edges(&rim.points, known, within_mm));
    found.map_or(Kind::Free, Kind::Bent)
}

/// Separates notches from rims that otherwise lie in planes. A notch, a short run of edges off the planes, becomes a
/// rim of its own.
fn split_notches(work: &mut Work, rims: &mut Vec<Rim>, kinds: &mut Vec<Kind>, known: &mut Vec<Plane>) {
    let free: Vec<usize> = (0..rims.len()).filter(|&i| matches!(kinds[i], Kind::Free)).collect();
    let rest: Vec<Vec<u32>> = free.iter().map(|&i| rims[i].vertices.clone()).collect();
    let filler = Filler::new(work, &rest);
    for i in free {
        for within_mm in rims[i].tolerances_mm() {
            let notches = planes::notches(&rims[i].points, known, within_mm);
            let Some((rest, split)) = without(work, &rims[i].vertices, &notches, &filler) else { continue };
            let kind = match planar(&rest, known) {
                Kind::Free => bent(&rest, known),
                planar => planar,
            };
            if !matches!(kind, Kind::Free) {
                (rims[i], kinds[i]) = (rest, kind);
                kinds.extend(split.iter().map(|_| Kind::Free));
                rims.extend(split);
                break;
            }
        }
    }
}

/// A rim without its notches, and the notches as rims. `None` if there are no notches, or no new edge can separate one
/// of them.
fn without(work: &mut Work, vertices: &[u32], notches: &[Notch], filler: &Filler) -> Option<(Rim, Vec<Rim>)> {
    let count = vertices.len();
    let run = |notch: &Notch| -> Vec<u32> {
        let length = (notch.end + count - notch.start) % count;
        (notch.start..=notch.start + length).map(|at| vertices[at % count]).collect()
    };
    let can_split = |notch: &Notch| {
        let [from, to] = [notch.start, notch.end].map(|at| vertices[at]);
        from != to && (notch.via.is_some() || (run(notch).len() > 2 && !filler.is_taken([from, to])))
    };
    if notches.is_empty() || !notches.iter().all(can_split) {
        return None;
    }
    let mut stays = vec![true; count];
    let mut via = BTreeMap::new();
    let mut split = Vec::new();
    for notch in notches {
        let mut corners = run(notch);
        (1..corners.len() - 1).for_each(|step| stays[(notch.start + step) % count] = false);
        if let Some(at) = notch.via {
            let vertex = work.push(at);
            corners.push(vertex);
            via.insert(notch.start, vertex);
        }
        split.push(rim(work, corners));
    }
    let rest = (0..count).filter(|&at| stays[at]).flat_map(|at| [Some(vertices[at]), via.get(&at).copied()]).flatten();
    Some((rim(work, rest.collect()), split))
}

/// Rims that lie in planes, and whether each is closed.
struct Cuts<'a> {
    rims: &'a [Rim],
    kinds: &'a [Kind],
    known: &'a [Plane],
    /// Number of planes at the start of `known` that are sides of the bounding box.
    sides: usize,
    is_closed: &'a mut [bool],
}

impl Cuts<'_> {
    /// Caps all bent rims together with the planar rims in the same planes, so that one rim within another makes a
    /// ring. If that fails, caps each bent rim separately.
    fn cap_bent(&mut self, work: &mut Work) {
        let bent: Vec<usize> = (0..self.rims.len()).filter(|&i| matches!(self.kinds[i], Kind::Bent(_))).collect();
        if bent.is_empty() || self.cap_along(work, &bent, true).is_some() {
            return;
        }
        for i in bent {
            self.cap_along(work, &[i], false);
        }
    }

    /// Caps the bent rims `members` in their planes, if wanted together with the planar rims there. `None`, without any
    /// new cap, if one of the planes can't be capped.
    fn cap_along(&mut self, work: &mut Work, members: &[usize], with_planar: bool) -> Option<()> {
        let mut turns = Turns::new();
        let mut outlines = BTreeMap::<usize, Vec<Border>>::new();
        for &i in members {
            let Kind::Bent(of_edge) = &self.kinds[i] else { continue };
            let before = of_edge.iter().cycle().skip(of_edge.len() - 1);
            for ((border, &after), &before) in borders(&self.rims[i].vertices).into_iter().zip(of_edge).zip(before) {
                outlines.entry(after).or_default().push(border);
                if after != before {
                    let direction = work.at(border.to) - work.at(border.from);
                    let turn = Turn { vertex: border.from, plane: after, direction };
                    turns.entry([after.min(before), after.max(before)]).or_default().push(turn);
                }
            }
        }
        for (pair, [from, to]) in corners::bends(work, &turns, self.known, self.sides)? {
            let border = Border { from, to, directed: false };
            pair.iter().for_each(|plane| outlines.entry(*plane).or_default().push(border));
        }
        let mut closed = members.to_vec();
        for (i, kind) in self.kinds.iter().enumerate().filter(|_| with_planar) {
            if let Kind::Planar(plane) = kind
                && let Some(outline) = outlines.get_mut(plane)
            {
                outline.extend(borders(&self.rims[i].vertices));
                closed.push(i);
            }
        }
        let caps = outlines.iter().map(|(&plane, outline)| self.cap(work, plane, outline));
        let caps = caps.collect::<Option<Vec<_>>>()?;
        work.mesh.triangles.extend(caps.into_iter().flatten());
        closed.into_iter().for_each(|i| self.is_closed[i] = true);
        Some(())
    }

    /// Caps the planar rims of each plane together, or each separately if that fails.
    fn cap_planar(&mut self, work: &mut Work) {
        let mut of_plane = BTreeMap::<usize, Vec<usize>>::new();
        for (i, kind) in self.kinds.iter().enumerate() {
            if let Kind::Planar(plane) = kind
                && !self.is_closed[i]
            {
                of_plane.entry(*plane).or_default().push(i);
            }
        }
        for (plane, members) in of_plane {
            let outline =
                |of: &[usize]| -> Vec<Border> { of.iter().flat_map(|&i| borders(&self.rims[i].vertices)).collect() };
            let mut caps = Vec::new();
            match self.cap(work, plane, &outline(&members)) {
                Some(cap) => caps.push((members, cap)),
                None => caps.extend(
                    members.into_iter().filter_map(|i| Some((vec![i], self.cap(work, plane, &outline(&[i]))?))),
                ),
            }
            for (members, triangles) in caps {
                work.mesh.triangles.extend(triangles);
                members.into_iter().for_each(|i| self.is_closed[i] = true);
            }
        }
    }

    fn cap(&self, work: &Work, plane: usize, outline: &[Border]) -> Option<Vec<[u32; 3]>> {
        polygon::triangulate(outline, &self.known[plane], |vertex| work.at(vertex))
    }
}

/// Logs the number of closed rims by the method of closing.
fn report(work: &mut Work, rims: &[Rim], kinds: &[Kind], is_closed: &[bool], settings: &RepairSettings) {
    let mut regions = BTreeMap::<ActionKind, Vec<Region>>::new();
    for ((rim, kind), capped) in rims.iter().zip(kinds).zip(is_closed) {
        let is_small = f64::from(rim.region.size_mm) <= settings.small_hole_mm;
        let action = match kind {
            Kind::Bent(_) if *capped => ActionKind::BentCap,
            _ if is_small => ActionKind::SmallHole,
            Kind::Planar(_) => ActionKind::PlanarCap,
            _ => ActionKind::Guess,
        };
        regions.entry(action).or_default().push(rim.region);
    }
    for (action, regions) in regions {
        work.log(action, regions.len(), regions);
    }
}
