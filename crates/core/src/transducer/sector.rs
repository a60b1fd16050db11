//! Placement of the sector in the image.

use glam::DVec2;

use super::{Probe, ProbeKind};

/// Mapping between pixels and the sector. Pixels are square; the whole sector is in the image, centred.
#[derive(Debug, Clone, Copy, PartialEq)]
pub struct Sector {
    /// Image width, pixels.
    pub width: u32,
    /// Image height, pixels.
    pub height: u32,
    /// Side of a square pixel, mm.
    pub pixel_mm: f64,
    /// Probe-frame (x, z) of the image's upper left corner, mm.
    pub corner_mm: DVec2,
}

impl Sector {
    /// Fits `probe`'s sector into `width` × `height` pixels.
    pub fn fit(probe: &Probe, width: u32, height: u32) -> Self {
        let (min, max) = extent_mm(probe);
        let size = max - min;
        let pixel_mm = (size.x / f64::from(width)).max(size.y / f64::from(height));
        let centre = 0.5 * (min + max);
        let image = DVec2::new(f64::from(width), f64::from(height)) * pixel_mm;
        Self { width, height, pixel_mm, corner_mm: centre - 0.5 * image }
    }

    /// Probe-frame (x, z) of a pixel's centre, mm.
    pub fn pixel_centre_mm(&self, column: u32, row: u32) -> DVec2 {
        self.corner_mm + DVec2::new(f64::from(column) + 0.5, f64::from(row) + 0.5) * self.pixel_mm
    }

    /// Pixel (column, row), with fractions, of a probe-frame point (x, z), mm; the first pixel's centre is (0.5, 0.5).
    pub fn pixel_from_probe(&self, point_mm: DVec2) -> DVec2 {
        (point_mm - self.corner_mm) / self.pixel_mm
    }

    /// Lateral fraction 0..1 and depth from the face, mm, of a probe-frame point (x, z), mm, along scanlines steered by
    /// `steer_rad`, positive towards +x. `None` at points that no steered scanline reaches. Not for phased arrays.
    pub fn polar_steered(probe: &Probe, point_mm: DVec2, steer_rad: f64) -> Option<(f64, f64)> {
        let [fraction, depth_mm] = Self::steered(probe, point_mm, steer_rad);
        let inside = (0.0..1.0).contains(&fraction) && (0.0..probe.depth_mm).contains(&depth_mm);
        inside.then_some((fraction, depth_mm))
    }

    /// Lateral fraction and depth from the face, mm, of any probe-frame point (x, z), mm, along scanlines steered by
    /// `steer_rad`. Outside the sector, the fraction may lie outside 0..1, and the depth outside the probe's.
    pub fn steered(probe: &Probe, point_mm: DVec2, steer_rad: f64) -> [f64; 2] {
        let (sin, cos) = steer_rad.sin_cos();
        let (lateral, depth) = match probe.face_radius_mm() {
            Some(radius) => {
                // Triangle of the face's centre of curvature, the scanline's origin on the face, and the point.
                let from_apex = point_mm + DVec2::new(0.0, radius);
                let distance = from_apex.length();
                let at_point = (radius * sin / distance).clamp(-1.0, 1.0).asin();
                (from_apex.x.atan2(from_apex.y) - steer_rad + at_point, distance * at_point.cos() - radius * cos)
            }
            None => (point_mm.x - point_mm.y * sin / cos, point_mm.y / cos),
        };
        [0.5 * (lateral / probe.half_extent() + 1.0), depth]
    }

    /// Position of a probe-frame point (x, z), mm, in the sector: fraction 0..1 of `probe`'s lateral extent, and depth
    /// from the face, mm. `None` outside the sector.
    pub fn polar(probe: &Probe, point_mm: DVec2) -> Option<(f64, f64)> {
        let (lateral, depth) = match probe.face_radius_mm() {
            Some(radius) => {
                let from_apex = point_mm + DVec2::new(0.0, radius);
                (from_apex.x.atan2(from_apex.y), from_apex.length() - radius)
            }
            None => (point_mm.x, point_mm.y),
        };
        let fraction = 0.5 * (lateral / probe.half_extent() + 1.0);
        let inside = (0.0..1.0).contains(&fraction) && (0.0..probe.depth_mm).contains(&depth);
        inside.then_some((fraction, depth))
    }
}

/// Minimum and maximum (x, z) of the sector in the probe frame, mm.
fn extent_mm(probe: &Probe) -> (DVec2, DVec2) {
    let half = probe.half_extent();
    match probe.kind {
        ProbeKind::Linear { .. } => (DVec2::new(-half, 0.0), DVec2::new(half, probe.depth_mm)),
        ProbeKind::Convex { .. } | ProbeKind::Phased { .. } => {
            let radius = probe.face_radius_mm().unwrap_or(0.0);
            let reach = radius + probe.depth_mm;
            let x = reach * half.sin();
            (DVec2::new(-x, radius * half.cos() - radius), DVec2::new(x, probe.depth_mm))
        }
    }
}

#[cfg(test)]
mod tests {
    use super::*;

    #[test]
    fn the_papers_sector_fills_its_image() {
        let sector = Sector::fit(&Probe::default(), 1386, 1000);
        assert!((sector.pixel_mm - 0.15726).abs() < 1e-4, "{}", sector.pixel_mm);
        let polar = |c, r| Sector::polar(&Probe::default(), sector.pixel_centre_mm(c, r));
        assert!(polar(693, 999).is_some() && polar(693, 46).is_some());
        assert!(polar(0, 0).is_none() && polar(1385, 999).is_none());
    }

    #[test]
    fn steered_scanlines_lead_to_their_points() {
        for kind in [ProbeKind::Convex { radius_mm: 40.0, fov_deg: 70.0 }, ProbeKind::Linear { width_mm: 40.0 }] {
            let probe = Probe { kind, ..Probe::default() };
            for (fraction, depth_mm, steer_deg) in
                [(0.3, 20.0, 12.0), (0.5, 120.0, -15.0), (0.7, 1.0, 7.0), (0.2, 60.0, 0.0)]
            {
                let steer = f64::to_radians(steer_deg);
                let (origin, direction) = probe.ray(probe.lateral_coordinate(fraction));
                let turned = glam::DQuat::from_rotation_y(steer) * direction;
                let point = origin + depth_mm * turned;
                let found = Sector::polar_steered(&probe, DVec2::new(point.x, point.z), steer).unwrap();
                assert!((found.0 - fraction).abs() < 1e-9 && (found.1 - depth_mm).abs() < 1e-9, "{kind:?}: {found:?}");
            }
        }
    }

    #[test]
    fn pixels_and_probe_points_are_inverse() {
        let sector = Sector::fit(&Probe::default(), 640, 480);
        let p = sector.pixel_from_probe(sector.pixel_centre_mm(17, 300));
        assert!((p - DVec2::new(17.5, 300.5)).length() < 1e-9);
    }
}
