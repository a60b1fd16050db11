//! Levels of displayed images, averaged over several images, by position in mm.

use glam::DVec2;

use crate::statistics::{sorted, upper_median};
use crate::transducer::Sector;

/// Mean of several images, both in dB above black and in power relative to black.
#[derive(Debug, Clone)]
pub struct Levels {
    sector: Sector,
    dynamic_range_db: f64,
    images: f64,
    sum_db: Vec<f64>,
    sum_power: Vec<f64>,
}

impl Levels {
    /// A mean without images yet, for images of `sector` whose grey levels 0..=255 span `dynamic_range_db`.
    pub fn new(sector: Sector, dynamic_range_db: f64) -> Self {
        let pixels = sector.width as usize * sector.height as usize;
        Self { sector, dynamic_range_db, images: 0.0, sum_db: vec![0.0; pixels], sum_power: vec![0.0; pixels] }
    }

    /// Adds an image, row by row. Returns false without adding it if its size differs.
    pub fn add(&mut self, grey: &[u8]) -> bool {
        if grey.len() != self.sum_db.len() {
            return false;
        }
        for ((db, power), &grey) in self.sum_db.iter_mut().zip(&mut self.sum_power).zip(grey) {
            let level = f64::from(grey) / 255.0 * self.dynamic_range_db;
            *db += level;
            *power += 10f64.powf(0.1 * level);
        }
        self.images += 1.0;
        true
    }

    /// Positions (x, z in the probe frame, mm) and mean power of the pixels in the box `(centre, half size)`.
    pub fn pixels(&self, (centre, half): (DVec2, DVec2)) -> impl Iterator<Item = (DVec2, f64)> + '_ {
        self.indices(centre, half).map(|(i, position)| (position, self.sum_power[i] / self.images.max(1.0)))
    }

    /// Mean power in the box `(centre, half size)`; 0 if the box contains no pixel.
    pub(crate) fn box_power(&self, box_mm: (DVec2, DVec2)) -> f64 {
        let (sum, n) = self.pixels(box_mm).fold((0.0, 0.0), |(sum, n), (_, power)| (sum + power, n + 1.0));
        sum / f64::max(n, 1.0)
    }

    /// Mean level in a disc, dB above black; 0 if the disc contains no pixel.
    pub(crate) fn disc_db(&self, centre: DVec2, radius_mm: f64) -> f64 {
        let inside = self.indices(centre, DVec2::splat(radius_mm)).filter(|(_, p)| p.distance(centre) <= radius_mm);
        let (sum, n) = inside.fold((0.0, 0.0), |(sum, n), (i, _)| (sum + self.sum_db[i], n + 1.0));
        sum / f64::max(n, 1.0) / self.images.max(1.0)
    }

    /// Mean level at a position, dB above black. The power is interpolated bilinearly; outside the image the nearest
    /// pixel counts.
    pub(crate) fn db_at(&self, position: DVec2) -> f64 {
        let at = self.sector.pixel_from_probe(position) - 0.5;
        let (floor, part) = (at.floor(), at - at.floor());
        let mut power = 0.0;
        for (dx, dy) in [(0.0, 0.0), (1.0, 0.0), (0.0, 1.0), (1.0, 1.0)] {
            let weight = (1.0 - (part.x - dx).abs()) * (1.0 - (part.y - dy).abs());
            power += weight * self.sum_power[self.nearest(floor + DVec2::new(dx, dy))];
        }
        10.0 * (power / self.images.max(1.0)).max(1.0).log10()
    }

    /// Level at a depth, dB above black: the mean over the rows within `half_mm` of the depth, then the median over
    /// the columns.
    pub(crate) fn median_row_db(&self, depth_mm: f64, half_mm: f64) -> f64 {
        let middle =
            DVec2::new(self.sector.corner_mm.x + 0.5 * f64::from(self.sector.width) * self.sector.pixel_mm, depth_mm);
        let half = DVec2::new(f64::from(self.sector.width) * self.sector.pixel_mm, half_mm);
        let width = self.sector.width as usize;
        let mut columns = vec![(0.0, 0.0); width];
        for (i, _) in self.indices(middle, half) {
            columns[i % width].0 += self.sum_db[i] / self.images.max(1.0);
            columns[i % width].1 += 1.0;
        }
        let means = sorted(columns.into_iter().filter(|c| c.1 > 0.0).map(|(sum, n)| sum / n));
        upper_median(&means).unwrap_or(0.0)
    }

    /// Full width at half amplitude of the peak nearest to `position`, along `axis` (a unit vector in the image), mm.
    /// The power `noise` is subtracted first.
    pub fn half_width_mm(&self, position: DVec2, axis: DVec2, noise: f64) -> f64 {
        let centre = self.sector.pixel_from_probe(position).floor();
        let amplitude = |i: i32| {
            let power = self.sum_power[self.nearest(centre + axis * f64::from(i))] / self.images.max(1.0);
            (power - noise).max(1e-9).sqrt()
        };
        let top = (-3..=3).max_by(|&a, &b| amplitude(a).total_cmp(&amplitude(b))).unwrap_or(0);
        let half = 0.5 * amplitude(top);
        let reach = self.sector.width.max(self.sector.height).min(i32::MAX as u32) as i32;
        let side = |step: i32| {
            let mut i = top;
            while amplitude(i + step) >= half && (i - top).abs() < reach {
                i += step;
            }
            let (inside, outside) = (amplitude(i), amplitude(i + step));
            f64::from((i - top).abs()) + (inside - half) / (inside - outside).max(1e-12)
        };
        (side(1) + side(-1)) * self.sector.pixel_mm
    }

    fn nearest(&self, pixel: DVec2) -> usize {
        let column = pixel.x.clamp(0.0, f64::from(self.sector.width - 1)) as usize;
        let row = pixel.y.clamp(0.0, f64::from(self.sector.height - 1)) as usize;
        row * self.sector.width as usize + column
    }

    fn indices(&self, centre: DVec2, half: DVec2) -> impl Iterator<Item = (usize, DVec2)> + '_ {
        let limit = |p: DVec2| p.clamp(DVec2::ZERO, DVec2::new(self.sector.width.into(), self.sector.height.into()));
        let low = limit(self.sector.pixel_from_probe(centre - half).floor());
        let high = limit(self.sector.pixel_from_probe(centre + half).ceil());
        let (columns, rows) = (low.x as u32..high.x as u32, low.y as u32..high.y as u32);
        rows.flat_map(move |row| columns.clone().map(move |column| (column, row))).filter_map(move |(column, row)| {
            let position = self.sector.pixel_centre_mm(column, row);
            let near = (position - centre).abs();
            let inside = near.x <= half.x && near.y <= half.y;
            inside.then_some(((row * self.sector.width + column) as usize, position))
        })
    }
}
