//! Course of the umbilical cord through the fluid: from the placenta to the navel, past the fetus.
//!
//! A search on a grid of nodes finds a path with clearance on all sides. The path passes two points with much fluid, so
//! that the cord hangs in loops. Relaxation then straightens it and pushes it off the fetus, the wall, the placenta and
//! itself.

use std::cmp::Reverse;
use std::collections::BinaryHeap;

use glam::{IVec3, Vec3};
use insonify_core::anatomy::sdf::Solid;
use rayon::prelude::*;

use super::vary::random;

/// Smallest clearance around the cord, mm.
const CLEARANCE_MM: f32 = 1.0;
/// Number of nodes along the longest axis of the search grid.
const NODES: f32 = 56.0;
/// Rounds of relaxation.
const ROUNDS: usize = 90;

/// Obstacles around the cord.
pub(super) struct Surroundings<'a> {
    /// Uterine cavity, which the cord must not leave.
    pub(super) cavity: &'a Solid,
    /// The placenta, scene frame.
    pub(super) placenta: &'a Solid,
    /// The fetus up to its skin, scene frame.
    pub(super) fetus: &'a Solid,
}

/// End of the cord: its position `at`, and the unit direction `away` into the fluid.
#[derive(Clone, Copy)]
pub(super) struct End {
    pub(super) at: Vec3,
    pub(super) away: Vec3,
}

impl Surroundings<'_> {
    /// Distance from `p` to the nearest obstacle, mm; negative inside an obstacle.
    fn clearance_mm(&self, p: Vec3) -> f32 {
        (-self.cavity.distance_mm(p)).min(self.placenta.distance_mm(p)).min(self.fetus.distance_mm(p))
    }

    /// Unit direction in which the clearance increases fastest; zero if there is none.
    fn uphill(&self, p: Vec3) -> Vec3 {
        const STEP_MM: f32 = 0.5;
        let d = |e: Vec3| self.clearance_mm(p + e * STEP_MM) - self.clearance_mm(p - e * STEP_MM);
        Vec3::new(d(Vec3::X), d(Vec3::Y), d(Vec3::Z)).normalize_or_zero()
    }
}

/// Points of the cord's centre line, about 3 mm apart, from the placenta to the navel.
pub(super) fn route(around: &Surroundings, placenta: End, navel: End, radius_mm: f32, seed: u64) -> Vec<Vec3> {
    let grid = Grid::of(around, radius_mm);
    let lift = radius_mm + CLEARANCE_MM;
    let (from, to) = (placenta.at + placenta.away * lift, navel.at + navel.away * lift);
    let stops = grid.stops(from, to, seed);
    let mut line = vec![placenta.at];
    let mut anchors = Vec::new();
    let mut last = from;
    for &stop in stops.iter().chain([&to]) {
        let leg = grid.path(last, stop, &line);
        line.extend(leg);
        anchors.push(line[line.len() - 1]);
        last = stop;
    }
    anchors.pop();
    line.push(navel.at);
    relax(around, resample(&line, 0.6 * radius_mm), &anchors, [placenta, navel], radius_mm)
}

/// Clearances at the nodes of a regular grid about the cavity.
struct Grid {
    origin: Vec3,
    size: IVec3,
    cell_mm: f32,
    clearance_mm: Vec<f32>,
    /// Clearance required around the cord's centre line, mm.
    need_mm: f32,
}

impl Grid {
    fn of(around: &Surroundings, radius_mm: f32) -> Self {
        let bounds = around.cavity.bounds();
        let cell_mm = bounds.size().max_element() / NODES;
        let size = (bounds.size() / cell_mm).ceil().as_ivec3() + 1;
        let mut grid =
            Self { origin: bounds.min, size, cell_mm, clearance_mm: Vec::new(), need_mm: radius_mm + CLEARANCE_MM };
        let count = (size.x * size.y * size.z) as usize;
        grid.clearance_mm = (0..count).into_par_iter().map(|i| around.clearance_mm(grid.position(i))).collect();
        grid
    }

    fn coordinates(&self, index: usize) -> IVec3 {
        let (x, y) = (self.size.x as usize, self.size.y as usize);
        IVec3::new((index % x) as i32, (index / x % y) as i32, (index / (x * y)) as i32)
    }

    fn position(&self, index: usize) -> Vec3 {
        self.origin + self.coordinates(index).as_vec3() * self.cell_mm
    }

    fn index(&self, at: IVec3) -> Option<usize> {
        let inside = at.cmpge(IVec3::ZERO).all() && at.cmplt(self.size).all();
        inside.then(|| ((at.z * self.size.y + at.y) * self.size.x + at.x) as usize)
    }

    fn node(&self, p: Vec3) -> usize {
        let at = ((p - self.origin) / self.cell_mm).round().as_ivec3().clamp(IVec3::ZERO, self.size - 1);
        self.index(at).unwrap_or(0)
    }

    /// The up to 26 neighbours of a node, each with its distance, mm.
    fn neighbours(&self, index: usize) -> impl Iterator<Item = (usize, f32)> + '_ {
        let at = self.coordinates(index);
        (0..27).filter(|&n| n != 13).filter_map(move |n| {
            let step = IVec3::new(n % 3, n / 3 % 3, n / 9) - 1;
            Some((self.index(at + step)?, step.as_vec3().length() * self.cell_mm))
        })
    }

    /// Cost of the path per mm at a node. Low clearance is expensive; a path through an obstacle is a last resort.
    fn price(&self, index: usize) -> f32 {
        let clearance = self.clearance_mm[index];
        let lack = ((self.need_mm - clearance) / self.need_mm).clamp(0.0, 1.0);
        let comfort = ((2.0 * self.need_mm - clearance) / self.need_mm).clamp(0.0, 1.0);
        1.0 + comfort + 12.0 * lack * lack + if clearance < 0.5 { 60.0 - 4.0 * clearance.min(0.0) } else { 0.0 }
    }

    /// Dijkstra's algorithm: for every node, the cost of the path from `from` and the node before it on that path.
    /// Stops early once `to` is reached.
    fn spread(&self, from: usize, to: Option<usize>, price: &[f32]) -> (Vec<f32>, Vec<usize>) {
        let mut cost = vec![f32::MAX; price.len()];
        let mut before = vec![usize::MAX; price.len()];
        // Costs are not negative, so their bits sort like their values.
        let mut queue = BinaryHeap::from([(Reverse(0u32), from)]);
        cost[from] = 0.0;
        while let Some((Reverse(bits), node)) = queue.pop() {
            if f32::from_bits(bits) > cost[node] {
                continue;
            }
            if Some(node) == to {
                break;
            }
            for (next, mm) in self.neighbours(node) {
                let total = cost[node] + mm * 0.5 * (price[node] + price[next]);
                if total < cost[next] {
                    cost[next] = total;
                    before[next] = node;
                    queue.push((Reverse(total.to_bits()), next));
                }
            }
        }
        (cost, before)
    }

    /// Up to two points (mm) with much fluid that the cord can reach, far from its ends and from each other.
    fn stops(&self, from: Vec3, to: Vec3, seed: u64) -> Vec<Vec3> {
        let price: Vec<f32> = (0..self.clearance_mm.len()).map(|i| self.price(i)).collect();
        let (cost, _) = self.spread(self.node(from), None, &price);
        let mut taken = vec![from, to];
        let mut stops = Vec::new();
        for stop in 0..2u64 {
            let far = 9.0 * self.need_mm;
            let score = |i: usize| {
                let p = self.position(i);
                let apart = taken.iter().map(|q| q.distance(p)).fold(far, f32::min);
                let clearance = self.clearance_mm[i].min(2.5 * self.need_mm);
                apart + 2.0 * clearance + 1.5 * self.need_mm * random(seed, 5000 + 100_000 * stop + i as u64)
            };
            let free = (0..price.len()).filter(|&i| {
                // Points that can be reached only through an obstacle are too expensive.
                self.clearance_mm[i] > 1.1 * self.need_mm
                    && cost[i] < 5.0 * self.position(i).distance(from) + 20.0 * self.need_mm
                    && self.position(i).distance(from) < 16.0 * self.need_mm
            });
            if let Some(best) = free.max_by(|&a, &b| score(a).total_cmp(&score(b))) {
                stops.push(self.position(best));
                taken.push(self.position(best));
            }
        }
        // The point nearer to the placenta comes first.
        stops.sort_by(|a, b| a.distance(from).total_cmp(&b.distance(from)));
        stops
    }

    /// Points of the cheapest path between two points that avoids the `earlier` parts of the cord, mm.
    fn path(&self, from: Vec3, to: Vec3, earlier: &[Vec3]) -> Vec<Vec3> {
        let joint = 2.5 * self.need_mm;
        let width = 2.0 * self.need_mm;
        let off: Vec<Vec3> = earlier.iter().copied().filter(|p| p.distance(from) > joint).collect();
        let price: Vec<f32> = (0..self.clearance_mm.len())
            .into_par_iter()
            .map(|i| {
                let p = self.position(i);
                let crossing = off.iter().any(|q| q.distance_squared(p) < width * width);
                self.price(i) + if crossing { 25.0 } else { 0.0 }
            })
            .collect();
        let (start, end) = (self.node(from), self.node(to));
        let (_, before) = self.spread(start, Some(end), &price);
        let mut nodes = vec![end];
        while let Some(&node) = nodes.last().filter(|&&n| n != start && before[n] != usize::MAX) {
            nodes.push(before[node]);
        }
        let middle: Vec<Vec3> = nodes.iter().rev().map(|&n| self.position(n)).collect();
        let inner = middle.len().saturating_sub(1).max(1);
        std::iter::once(from).chain(middle[1.min(inner)..inner].iter().copied()).chain([to]).collect()
    }
}

/// Points `step_mm` apart along `line`, including its ends.
fn resample(line: &[Vec3], step_mm: f32) -> Vec<Vec3> {
    let length: f32 = line.windows(2).map(|p| p[0].distance(p[1])).sum();
    let count = (length / step_mm).round().max(8.0) as usize;
    let mut points = Vec::with_capacity(count + 1);
    let (mut segment, mut before) = (0, 0.0);
    for i in 0..count {
        let at = length * i as f32 / count as f32;
        while segment + 2 < line.len() && before + line[segment].distance(line[segment + 1]) < at {
            before += line[segment].distance(line[segment + 1]);
            segment += 1;
        }
        let span = line[segment].distance(line[segment + 1]).max(1e-6);
        points.push(line[segment].lerp(line[segment + 1], ((at - before) / span).clamp(0.0, 1.0)));
    }
    points.push(line[line.len() - 1]);
    points
}

/// `line` straightened, with clearance from all obstacles. Its points stay near `anchors` during the first rounds. At
/// both ends the cord runs in the given directions.
fn relax(around: &Surroundings, line: Vec<Vec3>, anchors: &[Vec3], ends: [End; 2], radius_mm: f32) -> Vec<Vec3> {
    let need = radius_mm + CLEARANCE_MM;
    let step_mm = 0.6 * radius_mm;
    let mut line = line;
    for round in 0..ROUNDS {
        let last = line.len() - 1;
        let old = line.clone();
        line.par_iter_mut().enumerate().skip(1).take(last - 1).for_each(|(i, p)| {
            let here = old[i];
            let mut moved = (old[i - 1] + old[i + 1] - 2.0 * here) * 0.3;
            // The cord is straight near its ends.
            for (end, steps) in [(ends[0], i), (ends[1], last - i)] {
                let out = steps as f32 * step_mm;
                if out < 1.6 * need {
                    moved += (end.at + end.away * out - here) * 0.4;
                }
            }
            moved += off_itself(&old, i, radius_mm);
            // Anchors hold the loops during the first two thirds of the rounds.
            if round < ROUNDS * 2 / 3 {
                for anchor in anchors {
                    let pull = (1.0 - here.distance(*anchor) / (2.0 * need)).max(0.0);
                    moved += (*anchor - here) * 0.5 * pull;
                }
            }
            *p = here + moved.clamp_length_max(0.5 * step_mm);
            // At its ends the cord may touch the obstacles that it avoids elsewhere.
            let from_end = p.distance(ends[0].at).min(p.distance(ends[1].at));
            let need = need.min(0.9 * from_end);
            let lack = need - around.clearance_mm(*p);
            if lack > 0.0 {
                *p += around.uphill(*p) * lack.min(step_mm);
            }
        });
        if round % 10 == 9 {
            line = resample(&line, step_mm);
        }
    }
    // Smoothing widens bends that are too tight for the cord's jelly.
    for _ in 0..4 {
        let old = line.clone();
        for i in 2..line.len().saturating_sub(2) {
            let p = old[i - 2..=i + 2].iter().sum::<Vec3>() / 5.0;
            let need = (0.9 * radius_mm).min(0.8 * p.distance(ends[0].at).min(p.distance(ends[1].at)));
            let lack = (need - around.clearance_mm(p)).max(0.0);
            line[i] = p + around.uphill(p) * (0.5 * lack) + off_itself(&old, i, radius_mm);
        }
    }
    line
}

/// Displacement of point `i` of `line`, mm, away from the nearest other part of the cord.
fn off_itself(line: &[Vec3], i: usize, radius_mm: f32) -> Vec3 {
    let least = 2.0 * radius_mm + 2.0 * CLEARANCE_MM;
    // Only the nearest point pushes: its neighbours would push the same way.
    let nearest = line
        .iter()
        .enumerate()
        .filter(|(k, _)| i.abs_diff(*k) as f32 * 0.6 * radius_mm > 2.4 * least)
        .map(|(_, q)| (line[i].distance(*q), *q))
        .min_by(|a, b| a.0.total_cmp(&b.0));
    match nearest {
        Some((gap, q)) if gap < least => (line[i] - q).normalize_or_zero() * (0.6 * (least - gap)),
        _ => Vec3::ZERO,
    }
}
