//! Spatial compounding: the mean of pictures whose scanlines are steered by several angles.
//!
//! Amplitudes are averaged, not their logarithms: speckle of different angles then averages as independent estimates of
//! one amplitude do (Trahey, Smith and von Ramm, IEEE Trans UFFC 33:257, 1986).
//!
//! In a live session each angle has its own pose. Pictures are stored unchanged, and resampled at the present pose for
//! each new mean. Resampling follows the rigid motion within the slice. A picture's weight falls with its distance
//! across the slice.

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

/// Rows of the picture per task.
const ROWS: usize = 8;

/// Steering angles in the order in which they are rendered, radians. The last one is 0; frames carry its lines and
/// maps.
pub(crate) fn steering(angles: u32, span_deg: f64) -> Vec<f64> {
    let half = f64::from(angles / 2);
    let step = if half > 0.0 { 0.5 * span_deg.to_radians() / half } else { 0.0 };
    // Successive angles alternate between the sides, so that a moving picture leans to neither.
    let sides = (1..=angles / 2).rev().flat_map(|i| [-f64::from(i), f64::from(i)]);
    sides.chain([0.0]).map(|i| i * step).collect()
}

/// The latest picture of each angle, and the mean of these pictures.
#[derive(Debug)]
pub(super) struct Compounding {
    sector: Sector,
    /// 255 inside the sector [height × width].
    mask: Arc<[u8]>,
    /// First column inside the sector and first one beyond it, for each row.
    spans: Vec<[usize; 2]>,
    /// Bit set of the angles that show each pixel [height × width].
    covered: Vec<u16>,
    angles: Vec<Codes>,
    /// Pose and contact of each angle's picture; `None` without a picture, or if the rules have excluded it.
    places: Vec<Option<Place>>,
    /// Angles that the present mean includes.
    sources: Vec<Source>,
    dynamic_range_db: f64,
    of_levels: [u16; 256],
}

impl Compounding {
    /// Prepares for pictures of `angles` angles. `covered` says which of them show each pixel.
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

    /// Forgets all pictures, and sets the dynamic range of new pictures, dB.
    pub(super) fn restart(&mut self, dynamic_range_db: f64) {
        self.places.fill(None);
        if self.dynamic_range_db != dynamic_range_db {
            self.dynamic_range_db = dynamic_range_db;
            self.of_levels = codes::of_levels(dynamic_range_db);
        }
    }

    /// Stores the picture of an angle, then replaces `picture` by the mean of the latest pictures of all angles that
    /// `rules` include.
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
