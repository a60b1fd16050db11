//! Lungs and airway.

use glam::Vec3;

use super::{organ, trunk};
use crate::anatomy::phantom::attitude::Attitude;
use crate::anatomy::phantom::biometry::Biometry;
use crate::anatomy::phantom::organ::Organ;
use crate::anatomy::phantom::sdf::{ellipsoid, smooth_union, sweep, union};

/// Lungs, which heart, liver and vessels press into by their priority, and trachea.
pub(super) fn organs(biometry: &Biometry, attitude: &Attitude) -> Vec<Organ> {
    let v = Vec3::new;
    let lung = |side: f32| {
        let upper = ellipsoid(v(side * 8.5, 0.0, 12.5), v(7.5, 9.0, 11.0)).placed(attitude.vertebra(10.8));
        let lower = ellipsoid(v(side * 10.5, 0.0, 14.0), v(9.5, 11.0, 16.5)).placed(attitude.vertebra(13.6));
        smooth_union([upper, lower], 5.0)
    };
    // The chest wall bounds the lungs, within the ribs.
    let cage = trunk::trunk(biometry, attitude, 6.0);
    let lungs = union([lung(1.0), lung(-1.0)]).smooth_intersect(cage, 2.0);
    let line = |level: f32, left: f32, ventral: f32, radius: f32| (attitude.trunk(level, left, ventral), radius);
    let trachea = union([
        sweep(&[
            line(2.2, 0.0, 6.5, 1.2),
            line(5.0, 0.0, 6.5, 1.2),
            line(8.0, 0.0, 7.5, 1.15),
            line(10.8, 0.0, 9.0, 1.1),
        ]),
        sweep(&[line(10.8, 0.0, 9.0, 1.0), line(11.8, 4.6, 10.2, 0.8)]),
        sweep(&[line(10.8, 0.0, 9.0, 1.0), line(11.8, -4.6, 10.2, 0.8)]),
    ]);
    vec![
        organ("lungs", "lung_fetal", 106, 0.9, 5.0, lungs),
        organ("trachea", "amniotic_fluid", 117, 0.55, 1.2, trachea),
    ]
}
