//! Echo of the bevel's facet: an elliptic mirror that flashes where it faces the probe.

use std::f64::consts::PI;

use super::scanline::Scanline;
use super::{NeedleEcho, NeedleTables, Placed, REFLECTION};

/// Cosine between the facet's normal and the direction to the probe up to which the facet fades out.
const FACING_WHOLE: f64 = 0.2;
/// Number of positions of an integral over the facet.
const POSITIONS: u32 = 16;
/// Smallest amplitude of an echo that is added: −120 dB.
const LEAST: f64 = 1e-6;
/// Phase of the facet's diffuse echo, turns.
const DIFFUSE_TURNS: f32 = 0.37;

impl NeedleTables {
    /// Adds the echo of the facet, if the bevel's side is known and the facet faces the probe.
    pub(super) fn add_bevel(&self, placed: &Placed, scanline: &Scanline, depth_mm: f64, into: &mut Vec<NeedleEcho>) {
        let Some(bevel) = placed.bevel else { return };
        let (sin, cos) = self.settings.bevel_deg.to_radians().sin_cos();
        let radius_mm = self.settings.radius_mm();
        let normal = scanline.vector(cos * bevel + sin * placed.direction);
        let centre = scanline.point_mm(placed.axis_mm - placed.direction * (radius_mm * cos / sin));
        let facing = (-normal.z / FACING_WHOLE).clamp(0.0, 1.0);
        if facing == 0.0 || !(1e-3..=depth_mm).contains(&centre.z) {
            return;
        }
        // Half extents of the ellipse along the face and across the slice, mm.
        let long = scanline.vector(sin * bevel - cos * placed.direction) * (radius_mm / sin);
        let short = scanline.vector(placed.direction.cross(bevel)) * radius_mm;
        let [half_x, half_y] = [long.x.hypot(short.x), long.y.hypot(short.y)];
        if centre.x.abs() > self.beam.reach_mm(centre.z) + half_x || centre.y.abs() > self.slice.reach_mm() {
            return;
        }
        let covered = self.covered(centre.truncate().to_array(), [half_x, half_y], centre.z);
        let bore = self.settings.bore_mm() / (2.0 * radius_mm);
        // Area of the projected ellipse over the rectangle's.
        let ellipse = 0.25 * PI * (long.x * short.y - long.y * short.x).abs() / (half_x * half_y).max(1e-9);
        let plate = REFLECTION * facing * ellipse * (1.0 - bore * bore) * covered;
        // A mirror smaller than the beam returns a wider lobe, as a narrower beam does.
        let [sigma_x, sigma_y] = self.sigmas_mm(centre.z);
        let narrowed = |sigma: f64, half: f64| 1.0 / (1.0 + (2.0 * sigma / half.max(1e-3)).powi(2)).sqrt();
        let tangent_x = normal.x / normal.z * narrowed(sigma_x, half_x);
        let tangent_y = normal.y / normal.z * narrowed(sigma_y, half_y);
        let tilt = self.beam.tilt(centre.z, tangent_x) * self.slice.tilt(centre.z, tangent_y);
        for (amplitude, turns) in [(plate * tilt, 0.0), (plate * self.diffuse, DIFFUSE_TURNS)] {
            if amplitude > LEAST {
                let (depth_mm, amplitude) = (centre.z as f32, amplitude as f32);
                into.push(NeedleEcho { depth_mm, extra_mm: 0.0, amplitude, turns });
            }
        }
    }

    /// Share of a plate's echo that comes from a rectangle with this centre and half extents, mm.
    fn covered(&self, centre: [f64; 2], half: [f64; 2], depth_mm: f64) -> f64 {
        let step = |half: f64| 2.0 * half / f64::from(POSITIONS);
        let at = |i: u32, axis: usize| centre[axis] - half[axis] + (f64::from(i) + 0.5) * step(half[axis]);
        let (amplitude, field) = (self.beam.amplitudes(depth_mm), self.slice.fields(depth_mm));
        let along: f64 = (0..POSITIONS).map(|i| amplitude(at(i, 0))).sum();
        let across = (0..POSITIONS).map(|i| field(at(i, 1))).sum::<glam::DVec2>().length();
        along * step(half[0]) * across * step(half[1])
    }
}
