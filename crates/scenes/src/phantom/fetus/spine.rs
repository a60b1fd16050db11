//! Fetal spine: vertebrae with three ossification centres each in their cartilage, spinal canal and cord.

use glam::Vec3;
use insonify_core::anatomy::sdf::{Solid, ellipsoid, round_cone, smooth_sweep, smooth_union, union};

use crate::phantom::attitude::{Attitude, VERTEBRAE};
use crate::phantom::organ::{Body::Fetus, Organ};

/// Position of the canal's centre relative to the vertebral bodies' centres, mm as drawn; negative is dorsal.
const CANAL_MM: f32 = -4.0;

/// Organs of the spine: cartilage with discs, canal, cord and vertebrae.
pub(super) fn organs(attitude: &Attitude) -> Vec<Organ> {
    let scale = attitude.biometry.trunk_scale();
    let tube = |from: f32, to: f32, ventral: f32, radius: f32| {
        let knots: Vec<(Vec3, f32)> = (0..=20)
            .map(|i| from + (to - from) * i as f32 / 20.0)
            .map(|level| attitude.knot(level, 0.0, ventral, radius * taper(level)))
            .collect();
        smooth_sweep(&knots, 3)
    };
    // Unossified cartilage and discs.
    let cartilage = smooth_union([tube(0.4, 28.6, 0.0, 2.9), tube(0.4, 26.0, CANAL_MM, 3.1)], 1.5 * scale);
    // At 22 weeks the cord ends at about L3; the sac continues to the sacrum.
    vec![
        Fetus.organ("spinal_cartilage", "cartilage", 129, 0.95, 3.2 * scale, cartilage),
        Fetus.organ("spinal_canal", "csf", 130, 0.75, 2.8 * scale, tube(0.2, 26.0, CANAL_MM, 2.5)),
        Fetus.organ("spinal_cord", "brain", 132, 0.6, 1.8 * scale, tube(0.2, 21.5, CANAL_MM, 1.35)),
        Fetus.organ("vertebrae", "bone_fetal", 134, 0.5, 1.4 * scale, vertebrae(attitude)),
    ]
}

fn taper(level: f32) -> f32 {
    1.0 - 0.35 * ((level - 20.0) / 6.0).clamp(0.0, 1.0)
}

/// Ossified vertebrae: one centre in each body and one in each half of the arch.
fn vertebrae(attitude: &Attitude) -> Solid {
    let scale = attitude.biometry.trunk_scale();
    union((0..VERTEBRAE).map(|i| {
        let level = i as f32 + 0.5;
        // Vertebrae widen from the neck to the loins and narrow in the sacrum.
        let size = match i {
            0..7 => 0.82,
            7..19 => 0.88 + 0.012 * (i - 7) as f32,
            19..24 => 1.06,
            _ => 1.0 - 0.11 * (i - 24) as f32,
        };
        let v = |left: f32, up: f32, ventral: f32| Vec3::new(left * size, up, ventral * size);
        let height = 0.5
            * attitude.vertebra(level - 0.5).translation.distance(attitude.vertebra(level + 0.5).translation)
            / scale;
        let body = ellipsoid(Vec3::ZERO, Vec3::new(2.5 * size, 0.70 * height, 2.0 * size));
        // Pedicle to lamina: lateral of the canal and behind it.
        let arch = union([
            round_cone(v(3.3, 0.0, -2.6), v(3.5, 0.0, -4.6), 0.75, 0.8),
            round_cone(v(3.5, 0.0, -4.6), v(1.9, -0.4, -6.6), 0.8, 0.6),
        ])
        .with_mirror_image();
        attitude.in_trunk(level, union([body, arch]))
    }))
}

/// Centres of the left arch, the right arch and the body of the vertebra at `level`, as in the axial view of the
/// spine; fetal frame, mm.
pub(in crate::phantom) fn ossification_centres(attitude: &Attitude, level: f32) -> [Vec3; 3] {
    [attitude.trunk(level, 3.3, -4.6), attitude.trunk(level, -3.3, -4.6), attitude.trunk(level, 0.0, 0.0)]
}
