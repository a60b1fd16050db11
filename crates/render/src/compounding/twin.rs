//! Mean of the pictures of all angles, in f64, pixel by pixel.

use glam::{DVec2, DVec3};
use insonify_core::pose::Pose;
use insonify_core::transducer::Sector;

use crate::angle_order::ACROSS_SIGMA_MM;

/// An angle's picture: its pose, whether it shows each pixel, and its grey levels.
#[derive(Debug, Clone)]
pub(super) struct AnglePicture {
    pub(super) pose: Pose,
    pub(super) covers: Vec<bool>,
    pub(super) levels: Vec<u8>,
}

impl AnglePicture {
    /// Weighted amplitude and weight at a position (column, row), interpolated between pixels; whole numbers are
    /// centres of pixels.
    fn at(&self, sector: &Sector, place: DVec2, dynamic_range_db: f64) -> (f64, f64) {
        let first = place.floor();
        let (mut sum, mut weight) = (0.0, 0.0);
        for (right, below) in [(0, 0), (1, 0), (0, 1), (1, 1)] {
            let corner = first + DVec2::new(f64::from(right), f64::from(below));
            let inside = corner.cmpge(DVec2::ZERO).all()
                && corner.x < f64::from(sector.width)
                && corner.y < f64::from(sector.height);
            let part = (1.0 - (place - corner).abs()).element_product();
            if !inside {
                continue;
            }
            let pixel = corner.y as usize * sector.width as usize + corner.x as usize;
            if self.covers[pixel] {
                sum += part * amplitude(self.levels[pixel], dynamic_range_db);
                weight += part;
            }
        }
        (sum, weight)
    }
}

fn amplitude(level: u8, dynamic_range_db: f64) -> f64 {
    10f64.powf((f64::from(level) / 255.0 - 1.0) * dynamic_range_db / 20.0)
}

/// Grey levels 0..=255 of the mean of `angles` at the pose `present`; 0 where no angle shows the pixel.
pub(super) fn compounded(sector: &Sector, angles: &[AnglePicture], present: &Pose, dynamic_range_db: f64) -> Vec<f64> {
    let pixel = |i: u32| {
        let point = sector.pixel_centre_mm(i % sector.width, i / sector.width);
        let world_mm = present.transform_point(DVec3::new(point.x, 0.0, point.y));
        let (mut sum, mut weight) = (0.0, 0.0);
        for angle in angles {
            let there_mm = angle.pose.orientation.inverse() * (world_mm - angle.pose.position_mm);
            let place = sector.pixel_from_probe(DVec2::new(there_mm.x, there_mm.z)) - 0.5;
            let near = 1.0 - there_mm.y.powi(2) / (8.0 * ACROSS_SIGMA_MM.powi(2));
            let near = near.max(0.2).powi(8);
            let (amplitude, shown) = angle.at(sector, place, dynamic_range_db);
            sum += near * amplitude;
            weight += near * shown;
        }
        // The weight is 0 except for rounding.
        if weight < 1.0e-12 {
            return 0.0;
        }
        255.0 * (1.0 + 20.0 * (sum / weight).log10() / dynamic_range_db).clamp(0.0, 1.0)
    };
    (0..sector.width * sector.height).map(pixel).collect()
}
