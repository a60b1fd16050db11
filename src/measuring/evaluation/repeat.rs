//! High quality rendered again with other seeds: the part of the target that no generator can predict.

use std::sync::Arc;

use crate::dataset::{Dataset, DatasetError, Progress, Row, Scenes, TupleRenderer, TupleScene};
use crate::measuring::MeasuringError;
use crate::render::Backend;
use crate::render::twin::hash::pcg3d;

/// Request to render the high quality again with other random choices.
#[derive(Debug, Clone, Copy)]
pub struct Repeat<'a> {
    /// Backend of the renders.
    pub backend: &'a Backend,
    /// Renders of each tuple, at least 1. Their mean is judged as well.
    pub renders: u32,
}

impl<'a> Repeat<'a> {
    /// One renderer for each lane, a worker that renders tuples in parallel to others.
    ///
    /// # Errors
    /// A request for zero renders.
    pub(super) fn lanes(&self) -> Result<Vec<Lane<'a>>, MeasuringError> {
        let Self { backend, renders } = *self;
        if renders == 0 {
            return Err(MeasuringError::Renders(renders));
        }
        let lane = |renderer| Lane { renderer, renders, sums: Vec::new() };
        Ok(TupleRenderer::lanes(backend).into_iter().map(lane).collect())
    }
}

/// A tuple whose high quality is to be rendered again.
pub(super) struct RepeatJob<'a> {
    row: &'a Row,
    scene: Arc<TupleScene>,
    /// Whether to render it with the tuple's own seed, too, for comparison with the data set.
    check: bool,
}

/// Makes the jobs. For each station, one tuple is rendered with its own seed as well, as a check.
pub(super) struct Jobs<'a> {
    dataset: &'a Dataset,
    scenes: Scenes<'a>,
    seen: Vec<&'a str>,
}

impl<'a> Jobs<'a> {
    pub(super) fn new(dataset: &'a Dataset, progress: &'a Progress<'a>) -> Self {
        Self { dataset, scenes: Scenes::new(dataset.header.classes.clone(), progress), seen: Vec::new() }
    }

    /// Job to render the high quality of a tuple again.
    pub(super) fn of(&mut self, row: &'a Row) -> Result<RepeatJob<'a>, DatasetError> {
        let scene = self.scenes.of(&self.dataset.station(row)?)?;
        let check = !self.seen.contains(&row.station.as_str());
        if check {
            self.seen.push(&row.station);
        }
        Ok(RepeatJob { row, scene, check })
    }
}

/// High quality of a tuple, rendered again.
pub(super) struct Rendered {
    /// Image with the tuple's own seed; `None` if not requested.
    own: Option<Vec<u8>>,
    /// The first image with another seed, and the mean of all images with other seeds.
    pub(super) images: [Vec<u8>; 2],
}

impl Rendered {
    /// Whether the image with the tuple's own seed equals `hq`; true if that image was not rendered.
    ///
    /// # Errors
    /// Images of different sizes.
    pub(super) fn is_of_this_machine(&self, row: &Row, hq: &[u8]) -> Result<bool, MeasuringError> {
        let Some(own) = &self.own else { return Ok(true) };
        if own.len() != hq.len() {
            return Err(MeasuringError::Pixels {
                index: row.index,
                expected: hq.len(),
                station: row.station.clone(),
                found: own.len(),
            });
        }
        Ok(own == hq)
    }
}

/// Worker that renders the high quality of tuples again.
pub(super) struct Lane<'a> {
    renderer: TupleRenderer<'a>,
    renders: u32,
    sums: Vec<u32>,
}

impl Lane<'_> {
    /// Renders a tuple as often as requested.
    pub(super) fn render(&mut self, job: &RepeatJob<'_>) -> Result<Rendered, DatasetError> {
        let &RepeatJob { row, ref scene, check } = job;
        let own = check.then(|| Ok::<_, DatasetError>(self.renderer.high_quality(scene, row, row.seed)?.to_vec()));
        let own = own.transpose()?;
        let mut one = Vec::new();
        self.sums.clear();
        for number in 1..=self.renders {
            // Hashing makes the seeds unrelated.
            let seed = pcg3d([row.seed, number, 0])[0];
            let image = self.renderer.high_quality(scene, row, seed)?;
            self.sums.resize(image.len(), 0);
            self.sums.iter_mut().zip(image).for_each(|(sum, &level)| *sum += u32::from(level));
            if number == 1 {
                one.extend_from_slice(image);
            }
        }
        let mean = self.sums.iter().map(|sum| ((sum + self.renders / 2) / self.renders) as u8).collect();
        Ok(Rendered { own, images: [one, mean] })
    }
}
