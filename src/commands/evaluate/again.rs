//! The high quality itself, rendered again with other random choices: what of the target no generator can know.

use insonify::dataset::{Dataset, Row};
use insonify::render::Gpu;

use super::super::Failure;
use super::super::dataset::{Studio, station_of};

/// What tells the seeds of a tuple's renders apart: odd, so that 2³² of them differ.
const SEED_STEP: u32 = 0x9e37_79b9;

/// Renders tuples' high quality anew.
pub(super) struct Again<'a> {
    dataset: &'a Dataset,
    studio: Studio<'a>,
    renders: u32,
    sums: Vec<u32>,
    /// Whether the first tuple came out as the data set has it, its own seed given.
    pub(super) same: Option<bool>,
}

impl<'a> Again<'a> {
    pub(super) fn new(gpu: &'a Gpu, dataset: &'a Dataset, renders: u32) -> Self {
        let studio = Studio::new(gpu, dataset.header.classes.clone());
        Self { dataset, studio, renders, sums: Vec::new(), same: None }
    }

    /// Renders the tuple of `row`, whose high quality is `hq`, as often as asked for: one of the images, and the mean of all.
    pub(super) fn render(&mut self, row: &Row, hq: &[u8]) -> Result<[Vec<u8>; 2], Failure> {
        let station = station_of(&self.dataset.directory, &self.dataset.header, row)?;
        if self.same.is_none() {
            self.same = Some(self.studio.high_quality(&station, row, row.seed)? == hq);
        }
        let mut one = Vec::new();
        self.sums.clear();
        self.sums.resize(hq.len(), 0);
        for number in 1..=self.renders {
            let seed = row.seed.wrapping_add(number.wrapping_mul(SEED_STEP));
            let image = self.studio.high_quality(&station, row, seed)?;
            self.sums.iter_mut().zip(image).for_each(|(sum, &level)| *sum += u32::from(level));
            if number == 1 {
                one.extend_from_slice(image);
            }
        }
        let mean = self.sums.iter().map(|sum| ((sum + self.renders / 2) / self.renders) as u8).collect();
        Ok([one, mean])
    }
}
