//! Comparison of a data set with what this machine renders from its rows.

use super::scenes::{Scenes, TupleScene};
use super::step::{Progress, Step};
use super::tuple_renderer::TupleRenderer;
use super::{Dataset, DatasetError, Row};
use crate::lanes::in_order;
use crate::render::Backend;
use crate::statistics::evenly;
use serde::Serialize;
use std::sync::Arc;

/// Result of a comparison.
#[derive(Debug, Clone, PartialEq, Eq, Serialize)]
pub struct Verified {
    /// Number of tuples rendered again.
    pub tuples: usize,
    /// Indices of those that differ.
    pub differ: Vec<usize>,
}

impl Dataset {
    /// Renders `count` tuples again, spread evenly over the data set, and compares them bit for bit; 0 is all.
    ///
    /// # Errors
    /// A data set without tuples, or one whose stations or scenes cannot be loaded or rendered.
    pub fn verify(&self, backend: &Backend, count: usize, progress: &Progress<'_>) -> Result<Verified, DatasetError> {
        let total = if count == 0 { self.rows.len() } else { count.min(self.rows.len()) };
        if total == 0 {
            return Err(DatasetError::Empty { directory: self.directory.clone() });
        }
        let mut lanes = TupleRenderer::lanes(backend);
        let mut scenes = Scenes::new(self.header.classes.clone(), progress);
        let rows = evenly(total, self.rows.len()).map(|index| {
            let row = &self.rows[index];
            Ok((scenes.of(&self.station(row)?)?, row))
        });
        let compare = |renderer: &mut TupleRenderer<'_>, (scene, row): (Arc<TupleScene>, &Row)| {
            Ok((row.index, renderer.agrees(&scene, row)?))
        };
        let mut differ = Vec::new();
        progress(Step::Tuples { done: 0, total });
        in_order(&mut lanes, rows, compare, |done, (index, agrees)| {
            differ.extend((!agrees).then_some(index));
            progress(Step::Tuples { done: done + 1, total });
            Ok::<_, DatasetError>(())
        })?;
        Ok(Verified { tuples: total, differ })
    }
}
