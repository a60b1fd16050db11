//! Position of an angle's picture relative to the present picture, after motion of the probe.

use glam::{DQuat, DVec2, DVec3};

use insonify_core::pose::Pose;
use insonify_core::transducer::Sector;

/// Largest displacement at which an angle's picture is still read, pixels.
const FAR: f64 = 1.0e6;

/// Map from pixels of the present picture to positions in an angle's picture, and their distance from that angle's
/// slice.
///
/// The probe's motion is rigid. Points are projected on the angle's slice along the slice's normal.
#[derive(Debug, Clone, Copy, PartialEq)]
pub(super) struct Registration {
    /// Position (column, row) of the present picture's first pixel in the angle's picture; whole numbers are centres of
    /// pixels.
    pub(super) origin: DVec2,
    /// Change of this position per column and per row of the present picture.
    pub(super) per_column: DVec2,
    pub(super) per_row: DVec2,
    /// Distance of the present picture's first pixel from the angle's slice, and its change per column and per row, mm.
    pub(super) across_mm: [f64; 3],
}

impl Registration {
    /// Registration of a probe at rest.
    pub(super) const IDENTITY: Self =
        Self { origin: DVec2::ZERO, per_column: DVec2::X, per_row: DVec2::Y, across_mm: [0.0; 3] };

    /// Registration of a picture made at the pose `made_at`; `None` if it is too far away to overlap.
    pub(super) fn new(sector: &Sector, made_at: &Pose, present: &Pose) -> Option<Self> {
        if made_at == present {
            return Some(Self::IDENTITY);
        }
        let angle_from_world: DQuat = made_at.orientation.inverse();
        let frame_from_present = |point_mm: DVec3| {
            angle_from_world * (present.position_mm - made_at.position_mm)
                + angle_from_world * present.transform_vector(point_mm)
        };
        let first = sector.pixel_centre_mm(0, 0);
        let first_mm = frame_from_present(DVec3::new(first.x, 0.0, first.y));
        let step_mm = |axis: DVec3| angle_from_world * present.transform_vector(sector.pixel_mm * axis);
        let (column_mm, row_mm) = (step_mm(DVec3::X), step_mm(DVec3::Z));
        let of_slice = |v: DVec3| DVec2::new(v.x, v.z);
        let found = Self {
            origin: sector.pixel_from_probe(of_slice(first_mm)) - 0.5,
            per_column: of_slice(column_mm) / sector.pixel_mm,
            per_row: of_slice(row_mm) / sector.pixel_mm,
            across_mm: [first_mm.y, column_mm.y, row_mm.y],
        };
        // A comparison with NaN is false.
        (found.origin.abs().max_element() < FAR).then_some(found)
    }
}
