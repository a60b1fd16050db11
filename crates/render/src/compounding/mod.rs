//! Spatial compounding: mean of pictures whose scanlines are steered by several angles.
//!
//! Amplitudes are averaged, not their logarithms: the angles' speckle then adds as independent estimates of one amplitude
//! do (Trahey, Smith and von Ramm, IEEE Trans UFFC 33:257, 1986).
//!
//! Live, each angle was made at its own pose. It is kept as it was made, and resampled at the present pose once per
//! picture: by the rigid motion within the slice, weighted by the distance across it.

mod average;
mod codes;
mod registration;
#[cfg(test)]
mod tests;
#[cfg(test)]
mod twin;

use std::sync::Arc;

use insonify_core::transducer::Sector;
use rayon::prelude::*;

use self::average::{Source, View, average_rows};
use self::codes::Codes;
use self::registration::Registration;
use super::angle_order::{Place, Rules};

/// Rows per task.
const ROWS: usize = 8;

/// Steering angles in the order in which they are made, radians. The last one is 0: its lines and maps are kept.
pub(crate) fn steering(angles: u32, span_deg: f64) -> Vec<f64> {
    let half = f64::from(angles / 2);
    let step = if half > 0.0 { 0.5 * span_deg.to_radians() / half } else { 0.0 };
    // Neighbours in time lie on different sides, so that a moving picture leans to neither.
    let sides = (1..=angles / 2).rev().flat_map(|i| [-f64::from(i), f64::from(i)]);
    sides.chain([0.0]).map(|i| i * step).collect()
}

/// The last picture of each angle, and their mean.
#[derive(Debug)]
pub(super) struct Compounding {
    sector: Sector,
    /// 255 inside the sector [height × width].
    mask: Arc<[u8]>,
    /// First column in the sector and the one after the last, of each row.
    spans: Vec<[usize; 2]>,
    /// Angles that show each pixel, one bit each.
    covered: Vec<u16>,
    angles: Vec<Codes>,
    /// Place of each angle's picture; none before it is made.
    places: Vec<Option<Place>>,
    /// Angles in the present picture.
    sources: Vec<Source>,
    dynamic_range_db: f64,
    of_levels: [u16; 256],
}

impl Compounding {
    /// Pictures of a sector, whose pixels the angles of `covered` show.
    pub(super) fn new(
        sector: Sector,
        mask: Arc<[u8]>,
        covered: Vec<u16>,
        angles: usize,
        dynamic_range_db: f64,
    ) -> Self {
        let (width, height) = (sector.width as usize, sector.height as usize);
        let span = |row: &[u8]| {
            let first = row.iter().position(|&inside| inside != 0).unwrap_or(0);
            [first, row.iter().rposition(|&inside| inside != 0).map_or(first, |last| last + 1)]
        };
        Self {
            sector,
            spans: mask.chunks(width.max(1)).map(span).collect(),
            mask,
            covered,
            angles: (0..angles).map(|_| Codes::new(width, height)).collect(),
            places: vec![None; angles],
            sources: Vec::with_capacity(angles),
            dynamic_range_db,
            of_levels: codes::of_levels(dynamic_range_db),
        }
    }

    /// Forgets the pictures so far; those from now on have this dynamic range, dB.
    pub(super) fn restart(&mut self, dynamic_range_db: f64) {
        self.places.fill(None);
        if self.dynamic_range_db != dynamic_range_db {
            self.dynamic_range_db = dynamic_range_db;
            self.of_levels = codes::of_levels(dynamic_range_db);
        }
    }

    /// Takes the picture of an angle, and replaces it by the mean of the last pictures of all angles within reach.
    pub(super) fn add(&mut self, angle: usize, place: Place, rules: Rules, picture: &mut [u8]) {
        let width = self.sector.width as usize;
        let Some(codes) = self.angles.get_mut(angle).filter(|_| picture.len() == self.covered.len()) else { return };
        codes.set(picture, &self.covered, 1 << angle, &self.of_levels);
        if let Some(kept) = self.places.get_mut(angle) {
            *kept = Some(place);
        }
        self.sources.clear();
        for (angle, kept) in self.places.iter_mut().enumerate() {
            *kept = kept.filter(|kept| rules.keep(kept, &place));
            let Some(kept) = kept else {
                continue;
            };
            let registration = match rules.registration {
                true => Registration::new(&self.sector, &kept.pose, &place.pose),
                false => Some(Registration::IDENTITY),
            };
            self.sources.extend(registration.map(|registration| Source { angle, registration }));
        }
        let view = View {
            angles: &self.angles,
            sources: &self.sources,
            straight: self.places.last().is_some_and(Option::is_some),
            mask: &self.mask,
            spans: &self.spans,
            width,
            levels_per_octave: (255.0 * 20.0 * std::f64::consts::LOG10_2 / self.dynamic_range_db) as f32,
        };
        let tasks = picture.par_chunks_mut(ROWS * width).enumerate();
        tasks.for_each(|(task, picture)| average_rows(&view, ROWS * task, picture));
    }
}
