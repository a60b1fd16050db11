//! Skin, fat, fasciae, muscles and peritoneum of a pregnant belly, and the tissue inside.
//!
//! Thin layers are the difference of thick closed solids. Each layer's solid extends inward, and the next layer, of
//! higher priority, hides the part below it. A layer of half a millimetre thus needs no fine mesh.

use glam::Vec3;
use insonify_core::anatomy::sdf::{Bounds, Solid, bisect, ellipsoid, half_space, rounded_box, smooth_union};

use super::proportions::Proportions;
use crate::phantom::organ::{Body::Mother, Organ};
use crate::phantom::parameters::Parameters;

/// Height of the belly's skin above the reference cavity (22 weeks) at [`REFERENCE_FAT_MM`], mm.
const BELLY_ABOVE_CAVITY_MM: f32 = 33.0;

pub(super) const SKIN_MM: f32 = 2.0;
const REFERENCE_FAT_MM: f32 = 13.5;
pub(super) const FASCIA_MM: f32 = 0.8;
const MUSCLE_MM: f32 = 7.0;
const POSTERIOR_FASCIA_MM: f32 = 0.5;
const PREPERITONEAL_FAT_MM: f32 = 0.8;
const PERITONEUM_MM: f32 = 0.5;

/// Depths under the outer side of the deep fascia at which the layers of the flank begin, mm: external oblique, fascia,
/// internal oblique, fascia, transversus. The muscles thin in pregnancy; their relative thicknesses are after Rankin et
/// al., Muscle Nerve 34:320 (2006).
const FLAT_MUSCLES_MM: [f32; 5] = [FASCIA_MM, 3.0, 3.4, 6.0, 6.4];

/// Layers of the wall, defined relative to the deep fascia.
pub(super) struct AbdominalWall {
    /// Solid of the torso up to the outer side of the deep fascia, which lies under the fat.
    pub(super) under_fat: Solid,
    /// Thickness of the subcutaneous fat, mm.
    pub(super) fat_mm: f32,
    proportions: Proportions,
    recti_lens: bool,
}

impl AbdominalWall {
    pub(super) fn of(parameters: &Parameters) -> Self {
        let proportions = Proportions::of(parameters);
        let (excess, shift) = (proportions.excess, proportions.skeleton_shift());
        let (bottom, top) = (-170.0 + shift.y, 170.0 + excess.y.abs());
        let half = Vec3::new((140.0 + 0.8 * excess.x).max(132.0), 0.5 * (top - bottom), 85.0);
        let trunk = rounded_box(Vec3::new(0.0, 0.5 * (top + bottom), -45.0 + shift.z), half, 55.0);
        let height = proportions.cavity_semi.z + BELLY_ABOVE_CAVITY_MM;
        let semi = Vec3::new(128.0 + excess.x, 155.0 + excess.y, height + 20.0);
        let torso = smooth_union([trunk, ellipsoid(Vec3::new(0.0, 0.0, -20.0), semi)], 40.0);
        let under_fat = torso.grown(-(SKIN_MM + REFERENCE_FAT_MM));
        let (fat_mm, recti_lens) = (parameters.maternal_fat_mm as f32, parameters.recti_lens);
        Self { under_fat, fat_mm, proportions, recti_lens }
    }

    /// Solid of the torso up to `depth_mm` below the skin's outer side.
    pub(super) fn under_skin(&self, depth_mm: f32) -> Solid {
        self.under_fat.grown(self.fat_mm + SKIN_MM - depth_mm)
    }

    /// Space enclosed by the abdominal wall.
    pub(super) fn interior(&self) -> Solid {
        let inside = MUSCLE_MM + FASCIA_MM + POSTERIOR_FASCIA_MM + PREPERITONEAL_FAT_MM + PERITONEUM_MM;
        self.under_fat.grown(-inside)
    }

    /// Height of the belly's skin above the origin, mm.
    pub(super) fn belly_top_mm(&self) -> f32 {
        let skin = self.under_skin(0.0);
        bisect(0.0, 600.0, 40, |height| skin.distance_mm(Vec3::Z * height) < 0.0)
    }

    /// Skin, fat, fasciae, muscles, peritoneum and interior: nested closed surfaces.
    pub(super) fn organs(&self) -> Vec<Organ> {
        let under_sheath = FASCIA_MM + MUSCLE_MM;
        let under_fascia = under_sheath + POSTERIOR_FASCIA_MM;
        let layer = |depth_mm: f32| self.under_fat.grown(-depth_mm);
        let mut organs = vec![
            Mother.organ("skin", "skin", 1, 7.0, 30.0, self.under_skin(0.0)),
            Mother.organ("subcutaneous_fat", "fat", 2, 7.0, 30.0, self.under_skin(SKIN_MM)),
            Mother.organ("abdominal_fascia", "fascia", 3, 7.0, 30.0, layer(0.0)),
            Mother.organ("rectus_muscles", "muscle", 4, 4.5, 18.0, self.recti()),
            Mother.organ("back_muscles", "muscle", 4, 9.0, 30.0, self.back_muscles()),
            Mother.organ("transversalis_fascia", "fascia", 14, 7.0, 26.0, self.behind_linea_alba(under_sheath)),
            Mother.organ("preperitoneal_fat", "fat", 15, 7.0, 26.0, self.behind_linea_alba(under_fascia)),
            Mother.organ("peritoneum", "peritoneum", 16, 8.0, 30.0, layer(under_fascia + PREPERITONEAL_FAT_MM)),
            Mother.organ("abdominal_interior", "soft_tissue_maternal", 17, 8.0, 30.0, self.interior()),
        ];
        let flat = [
            ("external_obliques", "muscle"),
            ("oblique_fascia", "fascia"),
            ("internal_obliques", "muscle"),
            ("transversus_fascia", "fascia"),
            ("transversus_muscles", "muscle"),
        ];
        for (i, (name, tissue)) in flat.into_iter().enumerate() {
            organs.push(Mother.organ(name, tissue, 5 + i as i32, 7.0, 17.0, self.flat_muscle(FLAT_MUSCLES_MM[i])));
        }
        organs
    }

    /// Half the distance between the lineae semilunares, where recti and flat muscles meet, mm.
    fn semilunaris_mm(&self) -> f32 {
        76.0 + 0.5 * self.proportions.excess.x
    }

    /// Both rectus muscles, left and right of the linea alba, which is wide in pregnancy because the muscles separate.
    fn recti(&self) -> Solid {
        let sheath = self.under_fat.grown(-FASCIA_MM);
        // The solid is at least as deep as a mesh cell; the posterior sheath hides the part below it.
        let deep = self.under_fat.grown(-(FASCIA_MM + MUSCLE_MM + 8.0));
        let semilunaris = half_space(Vec3::X * (self.semilunaris_mm() - 1.0), Vec3::new(0.94, 0.0, -0.34));
        let (half_width, under_fat) = (self.alba_half_width_mm(), self.under_fat.clone());
        // Without fat behind the linea alba, the linea narrows inward, where the edges of the recti are rounded.
        let narrowing = if self.recti_lens { 0.0 } else { 0.45 * half_width };
        let alba = Solid::new(Bounds::EVERYWHERE, move |p| {
            let part = (-under_fat.distance_mm(p) / (FASCIA_MM + MUSCLE_MM)).clamp(0.0, 1.0);
            half_width - narrowing * part - p.x
        });
        let front = half_space(Vec3::Z * self.front_mm(), Vec3::NEG_Z);
        let band = semilunaris.smooth_intersect(alba, 3.0).intersect(front);
        sheath.subtract(deep).smooth_intersect(band, 4.0).with_mirror_image()
    }

    /// Half width of the linea alba at its outer side, mm.
    fn alba_half_width_mm(&self) -> f32 {
        4.0 + 0.1 * self.proportions.excess.x.max(0.0)
    }

    /// Region deeper than `depth_mm` under the fat. If fat fills the gap between the recti, the region bulges outward
    /// in the midline, so that the linea alba is thinner than the muscles.
    fn behind_linea_alba(&self, depth_mm: f32) -> Solid {
        let layer = self.under_fat.grown(-depth_mm);
        if !self.recti_lens {
            return layer;
        }
        let half_width = self.alba_half_width_mm();
        let thinner = MUSCLE_MM - 1.6;
        let front = self.front_mm();
        layer.displaced(thinner, move |p| {
            let aside = (p.x.abs() / half_width).min(2.0);
            let ridge = (1.0 - 0.25 * aside * aside).max(0.0).powi(2);
            thinner * ridge * ((p.z - front) / 20.0).clamp(0.0, 1.0)
        })
    }

    /// Extensors of the back, between the loins and the spine.
    fn back_muscles(&self) -> Solid {
        let sheath = self.under_fat.grown(-FASCIA_MM);
        let back = half_space(Vec3::Z * (self.front_mm() - 53.0), Vec3::Z);
        let midline = half_space(Vec3::X * 3.0, Vec3::NEG_X);
        sheath.smooth_intersect(back.smooth_intersect(midline, 3.0), 6.0).with_mirror_image()
    }

    /// z coordinate of the border between the belly's front and its flanks, mm.
    fn front_mm(&self) -> f32 {
        -20.0 + self.proportions.skeleton_shift().z
    }

    /// Layer of the flank that begins at `depth_mm` under the fat: lateral of the lineae semilunares, in front of the
    /// loins.
    fn flat_muscle(&self, depth_mm: f32) -> Solid {
        let layer = self.under_fat.grown(-depth_mm);
        let deep = self.under_fat.grown(-(FASCIA_MM + MUSCLE_MM + 12.0));
        // Deeper muscles end farther from the midline.
        let edge = self.semilunaris_mm() + 1.0 + 0.6 * depth_mm;
        let beyond = half_space(Vec3::X * edge, Vec3::new(-0.94, 0.0, 0.34));
        let loins = half_space(Vec3::Z * (self.front_mm() - 50.0), Vec3::NEG_Z);
        layer.subtract(deep).smooth_intersect(beyond, 4.0).intersect(loins).with_mirror_image()
    }
}

#[cfg(test)]
mod tests {
    use super::*;

    #[test]
    fn the_belly_is_as_high_as_uterus_and_wall() {
        let top = |p: Parameters| AbdominalWall::of(&p).belly_top_mm();
        let default = Parameters::default();
        assert!((top(default) - 86.0).abs() < 0.01, "{}", top(default));
        assert!((top(Parameters { maternal_fat_mm: 60.0, ..default }) - 132.5).abs() < 0.05);
        for weeks in [16.0, 34.0] {
            let p = Parameters { gestational_weeks: weeks, ..default };
            let above = top(p) - Proportions::of(&p).cavity_semi.z;
            assert!((32.0..45.0).contains(&above), "{above} mm of wall at {weeks} weeks");
        }
    }

    #[test]
    fn the_uterus_is_inside_the_wall() {
        for weeks in [16.0, 22.0, 34.0] {
            let p = Parameters { gestational_weeks: weeks, ..Parameters::default() };
            let interior = AbdominalWall::of(&p).interior();
            let semi = Proportions::of(&p).cavity_semi + super::super::proportions::UTERINE_WALL_MM;
            for axis in [Vec3::X, Vec3::Y, Vec3::Z] {
                let d = interior.distance_mm(axis * semi);
                assert!(d < 0.6, "{axis} at {weeks} weeks: {d}");
            }
        }
    }
}
