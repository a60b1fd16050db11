//! Colours of a picture's points: surfaces, cuts and the fan along each line of sight.

use glam::{DVec3, Vec3};

use super::Fan;
use super::camera::Camera;
use super::caster::{Caster, Hit};
use crate::sink::colour;

/// Remaining transmission, 0..=1, at which a line of sight ends.
const DARK: f32 = 0.02;
pub(super) const GROUND: Vec3 = Vec3::new(0.055, 0.068, 0.085);
pub(super) const HOUSING: Vec3 = Vec3::new(0.62, 0.66, 0.72);
pub(super) const BEAD: Vec3 = Vec3::new(1.0, 0.62, 0.1);
/// Colour of a fan without an image.
const FAN: Vec3 = Vec3::new(1.0, 0.80, 0.30);
const FAN_OPACITY: f32 = 0.30;
const IMAGE_OPACITY: f32 = 0.93;
/// Offset towards the viewer, mm, so that the fan covers a cut in its own plane.
const BEFORE_MM: f32 = 0.02;

/// Appearance of a surface in a picture.
pub(super) struct Appearance {
    pub(super) colour: Vec3,
    /// Opacity, 0..=1; 0 hides the surface except in sections.
    pub(super) opacity: f32,
    /// Index of the tissue inside; none for the probe.
    pub(super) tissue: Option<usize>,
}

/// Plane of a cut; its normal points towards the viewer.
pub(super) struct Plane {
    pub(super) point_mm: DVec3,
    pub(super) normal: DVec3,
}

/// Result of one line of sight.
#[derive(Clone, Copy)]
pub(super) struct Sample {
    pub(super) colour: Vec3,
    /// Tissues that are visible, one bit each.
    pub(super) seen: [u64; 4],
    /// Hash of the visible layers in their order. Edges are drawn where it changes.
    pub(super) layers: u32,
}

/// Surfaces with their appearances, and the probe's fan.
pub(super) struct Scenery {
    pub(super) caster: Caster,
    pub(super) appearances: Vec<Appearance>,
    pub(super) fan: Option<Fan>,
}

impl Scenery {
    /// Follows the line of sight at a point of the picture. Returns colour, tissues and layers.
    pub(super) fn sample(
        &self,
        camera: &Camera,
        plane: Option<&Plane>,
        column: f64,
        row: f64,
        hits: &mut Vec<Hit>,
    ) -> Sample {
        let (point, forward) = (camera.point(column, row), camera.forward);
        self.caster.crossings(point, forward, hits);
        let mut light = Vec3::ZERO;
        let mut left = 1.0_f32;
        let mut seen = [0u64; 4];
        let mut layers = 0_u32;
        let mut add = |colour: Vec3, opacity: f32, tissue: Option<usize>, layer: u32| {
            // Layers that are nearly invisible make no edge.
            if left * opacity > 0.04 {
                layers = (layers.rotate_left(5) ^ (layer + 1)).wrapping_mul(0x9e37_79b9);
            }
            light += left * opacity * colour;
            if let Some(i) = tissue.filter(|_| left * opacity > 0.08)
                && let Some(word) = seen.get_mut(i >> 6)
            {
                *word |= 1 << (i & 63);
            }
            left *= 1.0 - opacity;
            left > DARK
        };
        let mut fan = self.fan.as_ref().and_then(|fan| {
            let t = fan.meets(point, forward)?;
            let grey = fan.at(point + forward * t)?;
            let (colour, opacity) = match grey {
                Some(grey) => (Vec3::splat(f32::from(grey) / 255.0), IMAGE_OPACITY),
                None => (FAN, FAN_OPACITY),
            };
            Some((t as f32 - BEFORE_MM, colour, opacity))
        });
        let mut cut = plane.map(|plane| {
            let t = plane.normal.dot(plane.point_mm - point) / plane.normal.dot(forward);
            (t as f32, self.medium_beyond(hits, t as f32))
        });
        let from = cut.map_or(f32::NEG_INFINITY, |(t, _)| t);
        let probe = self.appearances.len().saturating_sub(if self.fan.is_some() { 2 } else { 0 });
        let mut next = hits.iter().filter(|hit| hit.t_mm >= from || hit.surface as usize >= probe).peekable();
        loop {
            let t_hit = next.peek().map_or(f32::INFINITY, |hit| hit.t_mm);
            let t_cut = cut.map_or(f32::INFINITY, |(t, _)| t);
            let t_fan = fan.map_or(f32::INFINITY, |(t, ..)| t);
            if t_fan <= t_cut && t_fan <= t_hit && t_fan.is_finite() {
                if let Some((_, colour, opacity)) = fan.take()
                    && !add(colour, opacity, None, 0)
                {
                    break;
                }
            } else if t_cut <= t_hit && t_cut.is_finite() {
                let medium = cut.take().and_then(|(_, medium)| medium).and_then(|m| self.appearances.get(m));
                // A section through a tissue is opaque.
                if let Some(appearance) = medium
                    && !add(0.92 * appearance.colour, 1.0, appearance.tissue, 1 + appearance.tissue.unwrap_or(0) as u32)
                {
                    break;
                }
            } else if let Some(hit) = next.next() {
                let Some(appearance) = self.appearances.get(hit.surface as usize) else { continue };
                // A hidden layer is visible only in sections.
                if appearance.opacity <= 0.0 {
                    continue;
                }
                let facing = hit.cosine.abs().min(1.0);
                let opacity = appearance.opacity + (1.0 - appearance.opacity) * 0.6 * (1.0 - facing).powi(3);
                if !add(shade(appearance.colour, hit, camera), opacity, appearance.tissue, 1000 + hit.surface) {
                    break;
                }
            } else {
                break;
            }
        }
        Sample { colour: light + left * GROUND, seen, layers }
    }

    /// Index of the surface with the highest priority among those that contain the point `t_mm` along the line of
    /// sight; `None` if none does. Surfaces of the probe are excluded.
    fn medium_beyond(&self, hits: &[Hit], t_mm: f32) -> Option<usize> {
        let mut met = [0u64; 4];
        let mut highest = None;
        for hit in hits.iter().filter(|hit| hit.t_mm > t_mm) {
            let index = hit.surface as usize;
            let tissue = self.appearances.get(index).is_some_and(|appearance| appearance.tissue.is_some());
            let Some(word) = met.get_mut(index >> 6).filter(|_| tissue) else { continue };
            let bit = 1 << (index & 63);
            // The point is inside a surface if the first hit beyond it leads outwards.
            if *word & bit == 0 && hit.cosine > 0.0 {
                highest = highest.max(Some(index));
            }
            *word |= bit;
        }
        highest
    }
}

/// Colour under light from the upper left behind the viewer. Both sides of a surface are lit.
fn shade(colour: Vec3, hit: &Hit, camera: &Camera) -> Vec3 {
    let toward = (-0.8 * camera.forward + 0.5 * camera.up - 0.35 * camera.right).normalize().as_vec3();
    let normal = if hit.cosine > 0.0 { -hit.normal } else { hit.normal };
    let diffuse = normal.dot(toward).max(0.0);
    let gloss = 0.12 * diffuse.powi(24);
    colour * (0.28 + 0.72 * diffuse) + Vec3::splat(gloss)
}

pub(super) fn colour_of(tissue: &str) -> Vec3 {
    Vec3::from(colour::tissue(tissue).map(|v| f32::from(v) / 255.0))
}
