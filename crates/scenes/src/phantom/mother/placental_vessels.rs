//! Vessels on the chorionic plate: trunks from the cord's insertion to the placenta's rim, each with two branches.

use std::f32::consts::TAU;

use glam::{Vec2, Vec3};
use insonify_core::anatomy::sdf::{Solid, smooth_sweep, union};

use super::placenta::Placenta;
use super::vary::random;

/// Number of trunks that leave the cord's insertion.
const TRUNKS: u64 = 5;
/// Radius of a trunk at the insertion, mm.
const RADIUS_MM: f32 = 1.9;
/// Thickness of tissue over a vessel on the fetal side, mm.
const COVER_MM: f32 = 0.9;

/// All vessels, under the fetal side of the placenta's `body`. `root` is the cord's insertion.
pub(super) fn tree(placenta: &Placenta, body: &Solid, root: Vec3) -> Solid {
    let seed = placenta.parameters.seed;
    let centre = placenta.tangent_position(root);
    let reach = placenta.radius_mm();
    let mut vessels = Vec::new();
    for i in 0..TRUNKS {
        let r = |k: u64| random(seed, 1900 + 20 * i + k);
        let turn = TAU * (i as f32 + 0.7 * (r(0) - 0.5)) / TRUNKS as f32;
        // Distance from the insertion to the rim; it depends on the direction, as the insertion is off the centre.
        let toward = Vec2::from_angle(turn);
        let along = centre.dot(toward);
        let to_rim = -along + (along * along + reach * reach - centre.length_squared()).max(0.0).sqrt();
        let trunk = |t: f32| {
            let sway = toward.perp() * (0.06 * to_rim * (5.0 * t + TAU * r(1)).sin() * t);
            centre + toward * (0.86 * to_rim * t) + sway
        };
        vessels.push(tube(placenta, body, &trunk, RADIUS_MM, 0.55));
        for (k, from) in [(2, 0.35f32), (4, 0.6)] {
            let side = if k == 2 { 1.0 } else { -1.0 };
            let aside = Vec2::from_angle(turn + side * (0.6 + 0.4 * r(k)));
            let length = to_rim * (0.8 - from) * (0.7 + 0.3 * r(k + 1));
            let start = trunk(from);
            let branch = move |t: f32| start + aside * (length * t);
            vessels.push(tube(placenta, body, &branch, RADIUS_MM * (0.95 - 0.5 * from), 0.6));
        }
    }
    // All trunks begin at the insertion.
    union(vessels)
}

/// Vessel under the fetal side along `line` in the tangent plane, tapering from `radius_mm` to the fraction `thin` of
/// it.
fn tube(placenta: &Placenta, body: &Solid, line: &dyn Fn(f32) -> Vec2, radius_mm: f32, thin: f32) -> Solid {
    let knots: Vec<(Vec3, f32)> = (0..=7)
        .filter_map(|k| {
            let t = k as f32 / 7.0;
            let on_wall = placenta.on_wall(line(t));
            let radius = radius_mm * (1.0 - (1.0 - thin) * t);
            let fetal = placenta.fetal_side(body, on_wall)?;
            // The vessel is left out where the placenta is too thin for it.
            let depth = on_wall.distance(fetal);
            (depth > 2.0 * radius + COVER_MM + 1.0)
                .then(|| (fetal - placenta.inward(on_wall) * (COVER_MM + radius), radius))
        })
        .collect();
    smooth_sweep(&knots, 4)
}
