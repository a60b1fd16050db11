//! Loops of the mother's bowel lateral of the uterus and above it, with gas in them.

use glam::Vec3;
use insonify_core::anatomy::sdf::{Solid, catmull_rom, smooth_union, sphere, sweep, union};

use super::abdominal_wall::AbdominalWall;
use super::proportions::Proportions;
use super::vary::{random, vary};
use crate::phantom::organ::{Body::Mother, Organ};
use crate::phantom::parameters::Parameters;

/// Outer radius of a loop, mm.
const RADIUS_MM: f32 = 10.0;
/// Thickness of a loop's wall, mm.
const WALL_MM: f32 = 2.0;

/// Knots of the loops around the reference uterus: descending colon, transverse colon with small bowel under it,
/// ascending colon; then small bowel lateral of the uterus.
const LOOPS_22_MM: [&[[f32; 3]]; 5] = [
    &[[92.0, -36.0, -46.0], [94.0, -4.0, -40.0], [92.0, 30.0, -42.0], [90.0, 62.0, -30.0], [82.0, 94.0, -10.0]],
    &[[-92.0, -40.0, -44.0], [-95.0, -8.0, -38.0], [-93.0, 24.0, -44.0], [-88.0, 60.0, -30.0], [-80.0, 92.0, -12.0]],
    &[
        [72.0, 106.0, 4.0],
        [48.0, 118.0, 12.0],
        [20.0, 127.0, 10.0],
        [-6.0, 129.0, 6.0],
        [-34.0, 124.0, 12.0],
        [-58.0, 112.0, 8.0],
        [-76.0, 100.0, -2.0],
    ],
    &[
        [58.0, 104.0, -40.0],
        [36.0, 120.0, -30.0],
        [14.0, 132.0, -16.0],
        [-12.0, 128.0, -30.0],
        [-36.0, 118.0, -40.0],
        [-60.0, 102.0, -36.0],
    ],
    &[[84.0, 14.0, -14.0], [92.0, 34.0, -12.0], [84.0, 54.0, -8.0], [78.0, 76.0, 4.0], [66.0, 88.0, 20.0]],
];

/// Centre lines of the loops, each point with its outer radius.
fn lines(parameters: &Parameters) -> Vec<Vec<(Vec3, f32)>> {
    let proportions = Proportions::of(parameters);
    let seed = parameters.seed;
    let line = |(n, knots): (usize, &&[[f32; 3]])| {
        let at = |(i, &knot): (usize, &[f32; 3])| {
            let key = 40 * n as u64 + 3 * i as u64;
            let jitter = Vec3::new(vary(seed, key), vary(seed, key + 1), vary(seed, key + 2)) * 4.0;
            (proportions.follow(Vec3::from(knot) + jitter), 0.0)
        };
        let knots: Vec<(Vec3, f32)> = knots.iter().enumerate().map(at).collect();
        let mut points = catmull_rom(&knots, 9);
        // Haustra of the colon: the radius varies with a period of 18 mm.
        let mut length = 0.0;
        for i in 0..points.len() {
            length += points[i].0.distance(points[i.saturating_sub(1)].0);
            points[i].1 = RADIUS_MM * (1.0 + 0.13 * (std::f32::consts::TAU * length / 18.0).sin());
        }
        points
    };
    LOOPS_22_MM.iter().enumerate().map(line).collect()
}

/// Loops within the belly, with radii reduced by `inside_mm`.
fn loops(lines: &[Vec<(Vec3, f32)>], inside_mm: f32, interior: &Solid) -> Solid {
    let tube = |line: &Vec<(Vec3, f32)>| sweep(&line.iter().map(|&(p, r)| (p, r - inside_mm)).collect::<Vec<_>>());
    union(lines.iter().map(tube)).smooth_intersect(interior.grown(-1.0 - inside_mm), 3.0)
}

/// Pockets of gas of different sizes at the front of the lumen.
fn gas(parameters: &Parameters, lines: &[Vec<(Vec3, f32)>]) -> Solid {
    let seed = parameters.seed;
    let mut pockets = Vec::new();
    for (n, line) in lines.iter().enumerate() {
        for (i, &(p, r)) in line.iter().enumerate().skip(2).step_by(3) {
            let key = 500 + 60 * n as u64 + i as u64;
            // No gas in a third of the lumen.
            if random(seed, key) > 0.34 {
                let radius = (r - WALL_MM) * (0.45 + 0.2 * random(seed, key + 3000));
                let up = Vec3::Z * (r - WALL_MM - radius - 0.5);
                let aside = (line[(i + 1).min(line.len() - 1)].0 - p) * (random(seed, key + 6000) - 0.5);
                pockets.push(sphere(p + up + aside, radius));
            }
        }
    }
    smooth_union(pockets, 3.0)
}

/// Organs of the bowel: wall, content and gas.
pub(super) fn organs(parameters: &Parameters, wall: &AbdominalWall) -> Vec<Organ> {
    let lines = lines(parameters);
    let interior = wall.interior();
    let lumen = loops(&lines, WALL_MM, &interior);
    let gas = gas(parameters, &lines).smooth_intersect(lumen.grown(-0.3), 1.0);
    vec![
        Mother.organ("maternal_bowel_wall", "muscle", 20, 3.2, 12.0, loops(&lines, 0.0, &interior)),
        Mother.organ("maternal_bowel", "bowel", 21, 3.2, 9.5, lumen),
        Mother.organ("bowel_gas", "air", 22, 2.6, 4.6, gas),
    ]
}
