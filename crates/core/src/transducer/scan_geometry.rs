//! Positions of a probe's scanlines in a picture.

use glam::DVec2;

use super::{Probe, ProbeKind, Sector};

/// Maps between pixels of a picture and its scanlines.
#[derive(Debug, Clone, Copy, PartialEq)]
pub struct ScanGeometry {
    /// Shape of the face.
    pub kind: ProbeKind,
    /// Depth of the picture from the face, mm.
    pub depth_mm: f64,
    /// Placement of the sector in the picture.
    pub sector: Sector,
}

impl ScanGeometry {
    /// Geometry of pictures of `probe` with `width` × `height` pixels.
    pub fn fit(probe: &Probe, width: u32, height: u32) -> Self {
        Self::new(probe, Sector::fit(probe, width, height))
    }

    /// Geometry of pictures of `probe` with the given placement of the sector.
    pub fn new(probe: &Probe, sector: Sector) -> Self {
        Self { kind: probe.kind, depth_mm: probe.depth_mm, sector }
    }

    fn probe(&self) -> Probe {
        Probe { kind: self.kind, depth_mm: self.depth_mm, ..Probe::default() }
    }

    /// Pixel (column, row), with fractions, of the point on the ray at `fraction` (0..=1) of the lateral extent,
    /// `depth_mm` from the face. The first pixel's centre is (0, 0).
    pub fn pixel_at(&self, fraction: f64, depth_mm: f64) -> DVec2 {
        let probe = self.probe();
        let (origin, direction) = probe.ray(probe.lateral_coordinate(fraction));
        let point = origin + depth_mm * direction;
        self.sector.pixel_from_probe(DVec2::new(point.x, point.z)) - 0.5
    }

    /// Fraction (0..1) of the lateral extent, and depth from the face (mm), of a pixel's centre; `None` outside the
    /// sector.
    pub fn beam_at(&self, column: u32, row: u32) -> Option<(f64, f64)> {
        Sector::polar(&self.probe(), self.sector.pixel_centre_mm(column, row))
    }
}

#[cfg(test)]
mod tests {
    use super::*;

    #[test]
    fn pixels_and_beams_are_inverse_for_every_face() {
        for kind in [
            ProbeKind::Convex { radius_mm: 40.0, fov_deg: 70.0 },
            ProbeKind::Linear { width_mm: 40.0 },
            ProbeKind::Phased { fov_deg: 90.0 },
        ] {
            let geometry = ScanGeometry::fit(&Probe { kind, ..Probe::default() }, 320, 300);
            let mut seen = 0;
            for (column, row) in (0..320).step_by(7).flat_map(|c| (0..300).step_by(11).map(move |r| (c, r))) {
                if let Some((fraction, depth_mm)) = geometry.beam_at(column, row) {
                    let back = geometry.pixel_at(fraction, depth_mm);
                    assert!((back - DVec2::new(column.into(), row.into())).length() < 1e-6, "{kind:?}: {back}");
                    seen += 1;
                }
            }
            assert!(seen > 100, "{kind:?}: {seen}");
        }
    }
}
