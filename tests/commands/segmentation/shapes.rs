//! Label maps of shapes that formulas describe.

use glam::{DAffine3, DQuat, DVec3};

use super::files::Volume;

/// Side of a voxel, mm.
pub(crate) const VOXEL_MM: f64 = 1.5;
/// Number of voxels along each axis.
pub(crate) const SIZE: [usize; 3] = [84, 76, 72];

/// Meaning of each label, for `--map`.
pub(crate) const MAPS: [&str; 6] = ["1=liver", "2=gallstone", "3=spleen", "4=kidney", "5=blood", "6=muscle"];

/// Centre of the grid, LPS, mm.
pub(crate) const CENTRE: DVec3 = DVec3::new(12.0, -40.0, 310.0);

/// Direction of the tube.
pub(crate) fn tube_axis() -> DVec3 {
    DVec3::new(1.0, 0.45, 0.62).normalize()
}

/// Label at a point (LPS, mm). There are nested balls, touching boxes, an oblique tube three voxels thick, and a ball
/// that the border cuts.
pub(crate) fn label(lps_mm: DVec3) -> u8 {
    let p = lps_mm - CENTRE;
    let within = |low: DVec3, high: DVec3| p.cmpge(low).all() && p.cmplt(high).all();
    let tube = p - DVec3::new(8.0, 10.0, 24.0);
    let along = tube.dot(tube_axis());
    match () {
        () if p.distance(DVec3::new(-20.3, -14.1, -11.2)) < 11.3 => 2,
        () if p.distance(DVec3::new(-22.0, -16.0, -12.0)) < 27.0 => 1,
        () if within(DVec3::new(14.0, -30.0, -30.0), DVec3::new(32.0, 4.0, 6.0)) => 3,
        () if within(DVec3::new(32.0, -26.0, -26.0), DVec3::new(48.0, 0.0, 2.0)) => 4,
        () if (tube - tube_axis() * along).length() < 1.5 * VOXEL_MM && along.abs() < 42.0 => 5,
        () if p.distance(DVec3::new(20.0, 30.0, -0.5 * SIZE[2] as f64 * VOXEL_MM)) < 19.0 => 6,
        () => 0,
    }
}

/// The label map on a grid along the patient's axes, rotated by `turn` about its centre.
pub(crate) fn volume(turn: DQuat) -> Volume {
    let half = DVec3::from_array(SIZE.map(|n| 0.5 * (n as f64 - 1.0)));
    let lps_from_voxel = DAffine3::from_translation(CENTRE)
        * DAffine3::from_quat(turn)
        * DAffine3::from_scale(DVec3::splat(VOXEL_MM))
        * DAffine3::from_translation(-half);
    Volume::of(SIZE, lps_from_voxel, label)
}
