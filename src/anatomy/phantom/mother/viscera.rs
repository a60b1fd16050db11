//! The mother's bladder, bowel and great vessels.

use glam::Vec3;

use super::{abdominal_wall, organ};
use crate::anatomy::phantom::organ::Organ;
use crate::anatomy::phantom::sdf::{Solid, catmull_rom, ellipsoid, smooth_union, sweep, union};

/// Middle of the bladder's urine, mm.
pub(in crate::anatomy::phantom) const BLADDER_CENTRE: Vec3 = Vec3::new(0.0, -118.0, 19.0);

/// Bladder, bowel with its gas, aorta and vena cava.
pub(super) fn organs() -> Vec<Organ> {
    let urine = smooth_union(
        [
            ellipsoid(BLADDER_CENTRE, Vec3::new(30.0, 14.0, 13.0)),
            ellipsoid(BLADDER_CENTRE + Vec3::new(0.0, 8.0, 6.0), Vec3::new(22.0, 12.0, 8.0)),
        ],
        8.0,
    )
    // The uterus presses its roof in; the wall of the belly bounds it.
    .smooth_intersect(abdominal_wall::interior().grown(-4.0), 6.0);
    vec![
        organ("maternal_bladder_wall", "muscle", 24, 2.6, 8.0, urine.grown(3.0)),
        organ("maternal_bladder", "urine", 26, 2.4, 8.0, urine),
        organ("maternal_bowel", "bowel", 20, 3.6, 8.0, bowel(8.5)),
        organ("bowel_gas", "air", 22, 3.0, 5.0, gas()),
        organ("maternal_vessels", "blood", 28, 2.6, 6.0, great_vessels()),
    ]
}

/// The line of the bowel's left loops, cranial and lateral of the uterus.
fn loops() -> Vec<(Vec3, f32)> {
    let knots = [
        (88.0, 20.0, -56.0),
        (90.0, 52.0, -40.0),
        (84.0, 82.0, -18.0),
        (62.0, 112.0, 0.0),
        (74.0, 118.0, -28.0),
        (58.0, 102.0, -52.0),
        (36.0, 122.0, -34.0),
        (22.0, 130.0, -6.0),
    ];
    catmull_rom(&knots.map(|(x, y, z)| (Vec3::new(x, y, z), 0.0)), 6)
}

fn bowel(radius_mm: f32) -> Solid {
    let tube: Vec<(Vec3, f32)> =
        loops().iter().enumerate().map(|(i, &(p, _))| (p, radius_mm * (1.0 + 0.12 * (i as f32 * 1.1).sin()))).collect();
    sweep(&tube).with_mirror_image()
}

/// Pockets along the middle of the loops.
fn gas() -> Solid {
    let line = loops();
    let pockets = [(3, 9, 4.0f32), (14, 20, 5.0), (26, 30, 4.5), (35, 40, 4.0)];
    union(pockets.map(|(from, to, radius)| {
        let tube: Vec<(Vec3, f32)> = line[from..=to].iter().map(|&(p, _)| (p + Vec3::Z * 1.5, radius)).collect();
        sweep(&tube)
    }))
    .with_mirror_image()
}

/// Aorta left, vena cava right of the middle, before the spine; iliac branches.
fn great_vessels() -> Solid {
    let line = |x: f32, radius: f32| {
        let z = -66.0;
        union([
            sweep(&[
                (Vec3::new(x, 150.0, z - 2.0), radius),
                (Vec3::new(x, 20.0, z), radius),
                (Vec3::new(x, -58.0, z - 1.0), radius),
            ]),
            sweep(&[
                (Vec3::new(x, -58.0, z - 1.0), 0.7 * radius),
                (Vec3::new(x.signum() * 34.0, -92.0, z - 4.0), 0.65 * radius),
                (Vec3::new(x.signum() * 52.0, -132.0, z + 24.0), 0.6 * radius),
            ]),
        ])
    };
    union([line(11.0, 5.2), line(-11.0, 6.0)])
}
