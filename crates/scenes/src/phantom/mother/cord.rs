//! Umbilical cord: Wharton's jelly around a vein and two arteries, which wind around the cord's centre line.

use std::f32::consts::TAU;

use glam::Vec3;
use insonify_core::anatomy::sdf::{Solid, catmull_rom, sweep, union};

use super::cord_path::{End, Surroundings, route};
use super::proportions::growth;
use super::vary::{random, vary};
use crate::phantom::organ::{Body::Mother, Organ};
use crate::phantom::parameters::Parameters;

/// Radius at 22 weeks, mm (Weissman et al., J Ultrasound Med 13:11, 1994: about 10 to 11 mm across).
const CORD_RADIUS_22_MM: f32 = 5.2;
const VESSEL_WALL_MM: f32 = 0.35;
/// Radius of a vessel, and distance of the vessel from the cord's centre line, in units of the cord's radius.
const VEIN: [f32; 2] = [0.345, 0.365];
const ARTERY: [f32; 2] = [0.20, 0.615];
/// Length along the cord per turn of the vessels at 22 weeks, mm: 0.2 to 0.45 coils per cm (Predanic et al., J
/// Ultrasound Med 24:271, 2005).
const PITCH_22_MM: f32 = 28.0;
/// Depth to which the cord extends into placenta and fetus, mm.
const ROOTED_MM: f32 = 5.0;

/// Course of the umbilical cord.
pub(super) struct Cord {
    /// Centre line from inside the placenta to inside the fetus, scene frame, mm.
    pub(super) line: Vec<Vec3>,
    pub(super) radius_mm: f32,
    pitch_mm: f32,
    phase: f32,
}

impl Cord {
    /// Cord between its insertion `from` in the placenta and its insertion `navel` in the fetus.
    pub(super) fn of(parameters: &Parameters, around: &Surroundings, from: End, navel: End) -> Self {
        let seed = parameters.seed;
        let size = growth(parameters).powf(0.8);
        let radius_mm = CORD_RADIUS_22_MM * size * (1.0 + 0.08 * vary(seed, 2000));
        let course = route(around, from, navel, radius_mm, seed);
        // The ends of the line lie inside the placenta and the fetus.
        let mut knots = vec![from.at - from.away * ROOTED_MM];
        knots.extend(&course);
        knots.push(navel.at - navel.away * ROOTED_MM);
        let knots: Vec<(Vec3, f32)> = knots.into_iter().map(|p| (p, 0.0)).collect();
        let line = catmull_rom(&knots, 3).into_iter().map(|(p, _)| p).collect();
        // The vessels of seven cords in eight wind to the left.
        let turn = if random(seed, 2001) < 0.875 { 1.0 } else { -1.0 };
        let pitch_mm = turn * PITCH_22_MM * size * (1.0 + 0.3 * vary(seed, 2002));
        Self { line, radius_mm, pitch_mm, phase: TAU * random(seed, 2003) }
    }

    /// Vessel wound around the cord's centre line. Its radius and the distance of its centre from that line are in
    /// units of the cord's radius. `phase` is its angle at the start, rad; `grown_mm` is added to its radius.
    fn winding(&self, [radius, offset]: [f32; 2], phase: f32, grown_mm: f32) -> Solid {
        let line = &self.line;
        let mut across = (line[1] - line[0]).any_orthonormal_vector();
        let mut length = 0.0;
        let points: Vec<(Vec3, f32)> = (0..line.len())
            .map(|i| {
                let tangent = (line[(i + 1).min(line.len() - 1)] - line[i.saturating_sub(1)]).normalize_or(Vec3::Y);
                // The direction across the line is carried along by parallel transport, without twist.
                across = (across - tangent * across.dot(tangent)).normalize_or(tangent.any_orthonormal_vector());
                length += line[i].distance(line[i.saturating_sub(1)]);
                let angle = self.phase + phase + TAU * length / self.pitch_mm;
                let side = across * angle.cos() + tangent.cross(across) * angle.sin();
                (line[i] + side * (offset * self.radius_mm), radius * self.radius_mm + grown_mm)
            })
            .collect();
        sweep(&points)
    }

    fn vein(&self, grown_mm: f32) -> Solid {
        self.winding(VEIN, 0.0, grown_mm)
    }

    fn arteries(&self, grown_mm: f32) -> [Solid; 2] {
        [0.35, 0.65].map(|turn| self.winding(ARTERY, turn * TAU, grown_mm))
    }

    /// Organs of the cord: jelly, vessel walls and blood.
    pub(super) fn organs(&self) -> Vec<Organ> {
        let jelly = sweep(&self.line.iter().map(|&p| (p, self.radius_mm)).collect::<Vec<_>>());
        let [left, right] = self.arteries(VESSEL_WALL_MM);
        let walls = union([self.vein(VESSEL_WALL_MM), left, right]);
        vec![
            Mother.organ("cord", "cord_jelly", 70, 1.2, 6.0, jelly),
            Mother.organ("cord_vessel_walls", "vessel_wall", 72, 0.8, 2.4, walls),
            Mother.organ("cord_arteries", "blood", 74, 0.65, 1.6, union(self.arteries(0.0))),
            Mother.organ("cord_vein", "blood", 75, 0.8, 2.5, self.vein(0.0)),
        ]
    }
}
