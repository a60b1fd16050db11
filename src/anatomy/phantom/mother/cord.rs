//! The umbilical cord: jelly about a vein and two arteries that wind around it.

use std::f32::consts::TAU;

use glam::Vec3;

use super::{organ, placenta};
use crate::anatomy::phantom::attitude::Attitude;
use crate::anatomy::phantom::fetus;
use crate::anatomy::phantom::organ::Organ;
use crate::anatomy::phantom::sdf::{catmull_rom, sweep, union};

const CORD_RADIUS_MM: f32 = 5.2;
const VEIN_RADIUS_MM: f32 = 1.8;
const ARTERY_RADIUS_MM: f32 = 1.05;
const VESSEL_WALL_MM: f32 = 0.35;
/// Length of one turn of the vessels.
const PITCH_MM: f32 = 24.0;

/// The cord's centre line from the placenta to the navel, scene frame.
fn centre_line(attitude: &Attitude) -> Vec<Vec3> {
    let (start, away) = placenta::insertion();
    let navel = attitude.scene_point(fetus::navel(attitude));
    let ventral = attitude.scene_vector(attitude.vertebra(fetus::NAVEL_LEVEL).vector(Vec3::Z));
    let knots = [
        start - away * 5.0,
        start + away * 2.0,
        start + away * 8.0,
        Vec3::new(38.0, 13.0, 7.0),
        Vec3::new(45.0, 2.0, 1.0),
        Vec3::new(47.0, -8.0, -9.0),
        Vec3::new(45.0, -3.0, -23.0),
        Vec3::new(44.0, 12.0, -27.0),
        Vec3::new(47.0, 16.0, -13.0),
        Vec3::new(36.0, 6.0, -8.0),
        Vec3::new(27.0, 2.0, -10.0),
        Vec3::new(19.0, 11.0, -12.0),
        navel + ventral * 8.0 + Vec3::new(0.0, -4.0, 0.0),
        navel + ventral * 2.0,
        navel - ventral * 5.0,
    ];
    let knots: Vec<(Vec3, f32)> = knots.into_iter().map(|p| (p, 0.0)).collect();
    catmull_rom(&knots, 8).into_iter().map(|(p, _)| p).collect()
}

/// Curves at `offset_mm` from `line` that wind around it, starting at `phase`.
fn winding(line: &[Vec3], offset_mm: f32, phase: f32, radius_mm: f32) -> Vec<(Vec3, f32)> {
    let mut across = (line[1] - line[0]).any_orthonormal_vector();
    let mut length = 0.0;
    (0..line.len())
        .map(|i| {
            let tangent = (line[(i + 1).min(line.len() - 1)] - line[i.saturating_sub(1)]).normalize();
            // Carried along without twist of its own.
            across = (across - tangent * across.dot(tangent)).normalize();
            length += line[i].distance(line[i.saturating_sub(1)]);
            let angle = phase + TAU * length / PITCH_MM;
            (line[i] + (across * angle.cos() + tangent.cross(across) * angle.sin()) * offset_mm, radius_mm)
        })
        .collect()
}

/// Cord, vessel walls and blood.
pub(super) fn organs(attitude: &Attitude) -> Vec<Organ> {
    let line = centre_line(attitude);
    let jelly = sweep(&line.iter().map(|&p| (p, CORD_RADIUS_MM)).collect::<Vec<_>>());
    // Vessels begin and end inside placenta and fetus.
    let vessels = |grown: f32| {
        union([
            sweep(&winding(&line, 1.9, 0.0, VEIN_RADIUS_MM + grown)),
            sweep(&winding(&line, 3.2, 0.35 * TAU, ARTERY_RADIUS_MM + grown)),
            sweep(&winding(&line, 3.2, 0.65 * TAU, ARTERY_RADIUS_MM + grown)),
        ])
    };
    vec![
        organ("cord", "cord_jelly", 70, 1.1, 5.0, jelly),
        organ("cord_vessel_walls", "vessel_wall", 72, 0.75, 2.0, vessels(VESSEL_WALL_MM)),
        organ("cord_vessels", "blood", 74, 0.7, 1.9, vessels(0.0)),
    ]
}
