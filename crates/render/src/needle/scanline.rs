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
}

/// Part of a range of s in which `start` + `slope`·s lies within bounds; `None` if there is none.
pub(super) fn clipped(range: [f64; 2], start: f64, slope: f64, [low, high]: [f64; 2]) -> Option<[f64; 2]> {
    let [from, to] = if slope.abs() < 1e-9 {
        if !(low..=high).contains(&start) {
            return None;
        }
        range
    } else {
        let [a, b] = [low, high].map(|value| (value - start) / slope);
        [a.min(b).max(range[0]), a.max(b).min(range[1])]
    };
    (from < to).then_some([from, to])
}
