//! Coordinates of a scanline: across it, across the slice, and along it.

use glam::{DMat3, DVec3};
use insonify_core::transducer::Probe;

/// A scanline in the probe's frame.
#[derive(Debug, Clone, Copy)]
pub(super) struct Scanline {
    origin_mm: DVec3,
    lateral: DVec3,
    axial: DVec3,
}

impl Scanline {
    /// The scanline at a fraction of the face's extent, steered by `steer_rad`. Fractions may lie outside 0..=1.
    pub(super) fn at(probe: &Probe, fraction: f64, steer_rad: f64) -> Self {
        let (origin_mm, direction) = probe.ray(probe.lateral_coordinate(fraction));
        let axial = DMat3::from_rotation_y(steer_rad) * direction;
        Self { origin_mm, lateral: DVec3::new(axial.z, 0.0, -axial.x), axial }
    }

    /// A vector of the probe's frame in coordinates of the scanline: lateral, elevational, axial.
    pub(super) fn vector(&self, v: DVec3) -> DVec3 {
        DVec3::new(v.dot(self.lateral), v.y, v.dot(self.axial))
    }

    /// A point of the probe's frame, mm, in coordinates of the scanline.
    pub(super) fn point_mm(&self, point_mm: DVec3) -> DVec3 {
        self.vector(point_mm - self.origin_mm)
    }
}

/// A straight piece of the needle in coordinates of a scanline. Positions are counted in mm from the tip's end.
#[derive(Debug, Clone, Copy)]
pub(super) struct Line {
    /// Point at the position 0, mm.
    pub(super) start_mm: DVec3,
    /// Unit vector towards the hub.
    pub(super) direction: DVec3,
}

impl Line {
    /// Point at a position, mm.
    pub(super) fn at(&self, position_mm: f64) -> DVec3 {
        self.start_mm + self.direction * position_mm
    }

    /// Positions within `offset_mm` of the scanline, across it; `None` if there are none in the range `of`.
    pub(super) fn within(&self, offset_mm: f64, [from, to]: [f64; 2]) -> Option<[f64; 2]> {
        let slope = self.direction.x;
        let [low, high] = if slope.abs() < 1e-9 {
            if self.start_mm.x.abs() > offset_mm {
                return None;
            }
            [from, to]
        } else {
            let [a, b] = [-offset_mm, offset_mm].map(|x| (x - self.start_mm.x) / slope);
            [a.min(b).max(from), a.max(b).min(to)]
        };
        (low < high).then_some([low, high])
    }
}
