//! Vertebrae as three ossification centres each, spinal canal and cord.

use glam::Vec3;

use super::organ;
use crate::anatomy::phantom::attitude::{Attitude, VERTEBRAE};
use crate::anatomy::phantom::organ::Organ;
use crate::anatomy::phantom::sdf::{Solid, catmull_rom, ellipsoid, round_cone, sweep, union};

/// The canal's centre behind the vertebral bodies' centres, mm.
const CANAL_MM: f32 = -4.0;

/// Canal, cord and vertebrae.
pub(super) fn organs(attitude: &Attitude) -> Vec<Organ> {
    let tube = |from: f32, to: f32, radius: f32| {
        let knots: Vec<(Vec3, f32)> = (0..=20)
            .map(|i| from + (to - from) * i as f32 / 20.0)
            .map(|level| (attitude.trunk(level, 0.0, CANAL_MM), radius * taper(level)))
            .collect();
        sweep(&catmull_rom(&knots, 3))
    };
    // At 22 weeks the cord ends at about L3; the sac goes on to the sacrum.
    vec![
        organ("spinal_canal", "csf", 130, 0.75, 2.8, tube(0.2, 26.0, 2.5)),
        organ("spinal_cord", "brain", 132, 0.6, 1.8, tube(0.2, 21.5, 1.35)),
        organ("vertebrae", "bone_fetal", 134, 0.5, 1.4, vertebrae(attitude)),
    ]
}

fn taper(level: f32) -> f32 {
    1.0 - 0.35 * ((level - 20.0) / 6.0).clamp(0.0, 1.0)
}

fn vertebrae(attitude: &Attitude) -> Solid {
    union((0..VERTEBRAE).map(|i| {
        let level = i as f32 + 0.5;
        // Width grows to the loins and falls in the sacrum.
        let size = match i {
            0..7 => 0.82,
            7..19 => 0.88 + 0.012 * (i - 7) as f32,
            19..24 => 1.06,
            _ => 1.0 - 0.11 * (i - 24) as f32,
        };
        let v = |left: f32, up: f32, ventral: f32| Vec3::new(left * size, up, ventral * size);
        let height = 0.5 * attitude.trunk(level - 0.5, 0.0, 0.0).distance(attitude.trunk(level + 0.5, 0.0, 0.0));
        let body = ellipsoid(Vec3::ZERO, Vec3::new(2.5 * size, 0.70 * height, 2.0 * size));
        // Pedicle to lamina, beside and behind the canal.
        let arch = union([
            round_cone(v(3.3, 0.0, -2.6), v(3.5, 0.0, -4.6), 0.75, 0.8),
            round_cone(v(3.5, 0.0, -4.6), v(1.9, -0.4, -6.6), 0.8, 0.6),
        ])
        .with_mirror_image();
        union([body, arch]).placed(attitude.vertebra(level))
    }))
}
