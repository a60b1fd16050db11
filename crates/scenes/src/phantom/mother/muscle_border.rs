//! Border between the subcutaneous fat and the muscles under it: lobules of fat that indent the deep fascia.
//!
//! Sound is slower in fat than in muscle, so the border's relief delays a wavefront by 57 ns per mm of height. The
//! relief has the wavelengths of small lobules. Longer waves are left out: they would tilt or focus a scanner's beam,
//! whereas real abdominal walls scatter it like frosted glass.

use std::f32::consts::TAU;
use std::sync::Arc;

use glam::{Vec2, Vec3};
use insonify_core::anatomy::Wall;
use insonify_core::anatomy::sdf::{Bounds, Solid};

use super::abdominal_wall::{AbdominalWall, FASCIA_MM};
use super::vary::random;
use crate::phantom::organ::{Body::Mother, Organ};
use crate::phantom::parameters::Parameters;

/// Number of sine waves that the relief consists of.
const WAVES: u64 = 24;
/// Shortest and longest wavelength, mm.
const WAVE_MM: [f32; 2] = [13.0, 20.0];
/// Half the angle that the relief spans about the axis, rad. The relief includes both flanks, because a probe on one
/// flank points at the other.
const HALF_ANGLE: f32 = 1.62;
/// Power added to the squared envelope, relative to the mean power, before its root divides the waves. It keeps the
/// relief finite where the envelope is weak.
const EVEN_POWER: f32 = 0.25;
/// Mean depth of the relief under the even fascia, relative to the relief's RMS.
const MEAN: f32 = 1.45;
/// Width of the rim in which the relief fades out, mm.
const RIM_MM: f32 = 12.0;
/// Height of the upper side of the added fat above the even fascia, mm: at least a mesh cell.
const UPPER_MM: f32 = 5.0;
/// Width over which the edges of the added fat are rounded, mm.
const ROUNDED_MM: f32 = 8.0;
/// z coordinate of the axis about which angles across the belly are measured, mm.
const AXIS_Z_MM: f32 = -40.0;

/// RMS height of the relief, mm.
fn relief_mm(wall: Wall) -> f32 {
    match wall {
        Wall::Easy => 0.10,
        Wall::Average => 1.15,
        Wall::Hard => 1.85,
    }
}

/// A wave of the relief: wave numbers across and along the belly, rad/mm, and phase, rad.
struct Wave([f32; 3]);

fn waves(seed: u64) -> Arc<[Wave]> {
    let wave = |i: u64| {
        let [length, turn, phase] = [0, 1, 2].map(|k| random(seed, 1000 + 3 * i + k));
        // Wavelengths are spread over equal logarithmic parts of their range, directions over equal angles.
        let part = (i as f32 + length) / WAVES as f32;
        let number = TAU / (WAVE_MM[0] * (WAVE_MM[1] / WAVE_MM[0]).powf(part));
        let direction = 0.5 * TAU * ((7 * i % WAVES) as f32 + turn) / WAVES as f32;
        Wave([number * direction.cos(), number * direction.sin(), TAU * phase])
    };
    (0..WAVES).map(wave).collect()
}

/// The border between fat and muscles, and its extent.
struct Border {
    under_fat: Solid,
    waves: Arc<[Wave]>,
    rms_mm: f32,
    /// Half extent of the relief across and along the belly, mm.
    half_mm: [f32; 2],
    /// Radius that converts the angle about the axis to a length across the belly, mm.
    radius_mm: f32,
    upper_mm: f32,
}

impl Border {
    fn of(parameters: &Parameters, wall: &AbdominalWall) -> Self {
        let top = wall.belly_top_mm();
        let radius_mm = top - AXIS_Z_MM;
        Self {
            under_fat: wall.under_fat.clone(),
            waves: waves(parameters.seed),
            rms_mm: relief_mm(parameters.wall),
            half_mm: [HALF_ANGLE * radius_mm, 1.2 * top],
            radius_mm,
            upper_mm: UPPER_MM.min(wall.fat_mm - 1.0),
        }
    }

    /// Depth of the border under the outer side of the even fascia, mm, at the point `u` mm across and `v` mm along the
    /// belly. `outside` is the distance of the point outside the relief's extent, mm; negative within it.
    fn depth_mm(&self, u: f32, v: f32, outside: f32) -> f32 {
        // The directions of all waves lie within half a turn, so their sum has an envelope. Division by the envelope
        // makes the relief equally strong everywhere.
        let turn = |Wave([a, b, phase]): &Wave| Vec2::from_angle(a * u + b * v + phase);
        let sum = (2.0 / WAVES as f32).sqrt() * self.waves.iter().map(turn).sum::<Vec2>();
        let relief = sum.x / (EVEN_POWER + 0.5 * sum.length_squared()).sqrt();
        let depth = self.rms_mm * (MEAN + relief);
        // At the rim the border rises above the even fascia, so that the fascia under it joins the fascia outside.
        let inward = (-outside / RIM_MM).clamp(0.0, 1.0);
        let part = inward * inward * (3.0 - 2.0 * inward);
        depth * part - FASCIA_MM * (1.0 - part)
    }

    /// Solid of the fat above the border.
    fn solid(self) -> Solid {
        let along = self.half_mm[1];
        let outer = self.under_fat.bounds().grown(self.upper_mm + 1.0);
        // The relief spans slightly more than a right angle on each side, so it ends below the axis.
        let low = AXIS_Z_MM - 0.15 * outer.max.x;
        let bounds = outer.overlap(Bounds {
            min: Vec3::new(outer.min.x, -along - 1.0, low),
            max: Vec3::new(outer.max.x, along + 1.0, outer.max.z),
        });
        let (radius_mm, half_mm) = (self.radius_mm, self.half_mm);
        let coordinates = move |p: Vec3| {
            let (u, v) = (radius_mm * p.x.atan2(p.z - AXIS_Z_MM), p.y);
            (u, v, (u.abs() - half_mm[0]).max(v.abs() - half_mm[1]))
        };
        let extent = Solid::new(bounds, move |p| coordinates(p).2);
        let layer = Solid::new(bounds, move |p| {
            let depth = -self.under_fat.distance_mm(p);
            let (u, v, outside) = coordinates(p);
            // Far from the border its relief does not matter.
            let border = if depth.abs() > 20.0 { 0.0 } else { self.depth_mm(u, v, outside) };
            (-self.upper_mm - depth).max(depth - border)
        });
        layer.smooth_intersect(extent, ROUNDED_MM)
    }
}

/// The fat that indents the fascia.
pub(super) fn organs(parameters: &Parameters, wall: &AbdominalWall) -> Vec<Organ> {
    let solid = Border::of(parameters, wall).solid();
    vec![Mother.organ("muscle_border_fat", "fat", 11, 2.6, 6.0, solid)]
}
