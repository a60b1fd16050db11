//! High quality rendered again with other seeds: the part of the target that no generator can predict.

use super::EvaluationError;
use crate::dataset::{Dataset, Progress, Row, TupleRenderer};
use crate::render::Backend;
use crate::render::twin::hash::pcg3d;

/// Request to render the high quality again with other random choices.
#[derive(Debug, Clone, Copy)]
pub struct Again<'a> {
    /// Renderer.
    pub backend: &'a Backend,
    /// Renders of each tuple, at least 1; their mean is judged, too.
    pub renders: u32,
}

/// Renders the high quality of tuples again.
pub(super) struct Renders<'a> {
    dataset: &'a Dataset,
    renderer: TupleRenderer<'a>,
    renders: u32,
    sums: Vec<u32>,
    /// Stations checked by rendering one tuple with its own seed.
    seen: Vec<String>,
    /// Checked stations whose tuple differs from the data set.
    pub(super) foreign: Vec<String>,
}

impl<'a> Renders<'a> {
    pub(super) fn new(
        again: &Again<'a>,
        dataset: &'a Dataset,
        progress: &'a Progress<'a>,
    ) -> Result<Self, EvaluationError> {
        let Again { backend, renders } = *again;
        if renders == 0 {
            return Err(EvaluationError::Renders { renders });
        }
        let renderer = TupleRenderer::new(backend, dataset.header.classes.clone(), progress);
        Ok(Self { dataset, renderer, renders, sums: Vec::new(), seen: Vec::new(), foreign: Vec::new() })
    }

    /// Renders the tuple of `row`, with the high quality `hq`, `renders` times. Returns the first image and the mean of
    /// all.
    pub(super) fn render(&mut self, row: &Row, hq: &[u8]) -> Result<[Vec<u8>; 2], EvaluationError> {
        let station = self.dataset.station(row)?;
        if !self.seen.contains(&row.station) {
            self.seen.push(row.station.clone());
            let image = self.renderer.high_quality(&station, row, row.seed)?;
            if image.len() != hq.len() {
                return Err(EvaluationError::Pixels {
                    index: row.index,
                    expected: hq.len(),
                    station: row.station.clone(),
                    found: image.len(),
                });
            }
            if image != hq {
                self.foreign.push(row.station.clone());
            }
        }
        let mut one = Vec::new();
        self.sums.clear();
        self.sums.resize(hq.len(), 0);
        for number in 1..=self.renders {
            // Hashed, so that the seeds are unrelated.
            let seed = pcg3d([row.seed, number, 0])[0];
            let image = self.renderer.high_quality(&station, row, seed)?;
            self.sums.iter_mut().zip(image).for_each(|(sum, &level)| *sum += u32::from(level));
            if number == 1 {
                one.extend_from_slice(image);
            }
        }
        let mean = self.sums.iter().map(|sum| ((sum + self.renders / 2) / self.renders) as u8).collect();
        Ok([one, mean])
    }
}
