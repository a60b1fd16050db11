//! Skin, fat, fascia and muscles of a pregnant belly, and the tissue inside.

use glam::Vec3;

use super::organ;
use crate::anatomy::phantom::organ::Organ;
use crate::anatomy::phantom::sdf::{Solid, ellipsoid, half_space, plate, rounded_box, smooth_union, union};

/// Height of the belly's skin above the origin, mm.
pub(in crate::anatomy::phantom) const BELLY_TOP_MM: f32 = 86.0;

const SKIN_MM: f32 = 2.0;
const FAT_MM: f32 = 13.5;
const FASCIA_MM: f32 = 0.8;
const MUSCLE_MM: f32 = 8.0;

/// The torso segment up to the skin.
fn torso() -> Solid {
    let trunk = rounded_box(Vec3::new(0.0, 0.0, -35.0), Vec3::new(140.0, 170.0, 75.0), 55.0);
    let belly = ellipsoid(Vec3::new(0.0, 0.0, -20.0), Vec3::new(128.0, 155.0, BELLY_TOP_MM + 20.0));
    smooth_union([trunk, belly], 40.0)
}

/// What the abdominal wall encloses.
pub(super) fn interior() -> Solid {
    torso().grown(-(SKIN_MM + FAT_MM + 2.0 * FASCIA_MM + MUSCLE_MM))
}

/// Skin, fat, fascia, muscles and interior, each closed and around the next.
pub(super) fn organs() -> Vec<Organ> {
    let torso = torso();
    let under_fat = torso.grown(-(SKIN_MM + FAT_MM));
    vec![
        organ("skin", "skin", 10, 7.0, 30.0, torso.clone()),
        organ("subcutaneous_fat", "fat", 12, 7.0, 30.0, torso.grown(-SKIN_MM)),
        organ("abdominal_fascia", "fascia", 14, 6.5, 30.0, under_fat.clone()),
        organ("abdominal_muscles", "muscle", 16, 4.5, 10.0, muscles(&under_fat)),
        organ("abdominal_interior", "soft_tissue_maternal", 18, 7.0, 30.0, interior()),
    ]
}

/// Both recti beside the linea alba, the flat muscles of the flanks beside the lineae semilunares.
fn muscles(under_fat: &Solid) -> Solid {
    let outer = under_fat.grown(-FASCIA_MM);
    let inner = under_fat.grown(-(FASCIA_MM + MUSCLE_MM));
    // In pregnancy the recti part: the linea alba is wide.
    let linea_alba = plate(Vec3::ZERO, Vec3::X, 4.0);
    let semilunaris = plate(Vec3::new(76.0, 0.0, 0.0), Vec3::new(0.94, 0.0, -0.34), 2.5).with_mirror_image();
    let front = half_space(Vec3::new(0.0, 0.0, -20.0), Vec3::NEG_Z);
    let gaps = union([linea_alba, semilunaris]).intersect(front);
    outer.subtract(inner).smooth_subtract(gaps, 4.0)
}
