//! Comparison of a data set with the frames that this machine renders from its rows.

use super::scenes::{Scenes, TupleScene};
use super::step::{Progress, Step};
use super::tuple_renderer::TupleRenderer;
use super::{Dataset, DatasetError, Row};
use crate::lanes::in_order;
use crate::render::Backend;
use crate::statistics::evenly;
use serde::Serialize;
use std::collections::BTreeSet;
use std::sync::Arc;

/// Result of a comparison.
#[derive(Debug, Clone, PartialEq, Eq, Serialize)]
pub struct Verified {
    /// Number of tuples rendered again.
    pub tuples: usize,
    /// Indices of tuples that this machine renders differently from their rows.
    pub differ: Vec<usize>,
    /// Indices of tuples with missing or damaged files.
    pub damaged: Vec<usize>,
    /// Missing and damaged files, each with the fault.
    pub faults: Vec<String>,
}

impl Verified {
    /// Number of tuples that are neither damaged nor rendered differently.
    pub fn same(&self) -> usize {
        let faulty: BTreeSet<&usize> = self.differ.iter().chain(&self.damaged).collect();
        self.tuples.saturating_sub(faulty.len())
    }
}

impl Dataset {
    /// Renders `count` tuples again, spread evenly over the data set (0 for all), and compares them bit for bit with
    /// their checksums. Also compares their files with the checksums.
    ///
    /// # Errors
    /// The data set has no tuples, or a station or scene can't be loaded or rendered.
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
            Ok((row.index, renderer.agrees(&scene, row)?, self.faults(row)))
        };
        let (mut differ, mut damaged, mut faults) = (Vec::new(), Vec::new(), BTreeSet::new());
        progress(Step::Tuples { done: 0, total });
        in_order(&mut lanes, rows, compare, |done, (index, agrees, found): (usize, bool, Vec<String>)| {
            differ.extend((!agrees).then_some(index));
            damaged.extend((!found.is_empty()).then_some(index));
            // Tuples may share a mask, so each fault is listed once.
            faults.extend(found);
            progress(Step::Tuples { done: done + 1, total });
            Ok::<_, DatasetError>(())
        })?;
        Ok(Verified { tuples: total, differ, damaged, faults: faults.into_iter().collect() })
    }

    /// Faults of the tuple's files, in words.
    fn faults(&self, row: &Row) -> Vec<String> {
        let failed = [self.planes(row).err(), self.mask(row).err()].into_iter().flatten();
        let words = |error: DatasetError| match error {
            DatasetError::Damaged { path } => format!("{} is damaged", path.display()),
            other => other.to_string(),
        };
        failed.map(words).collect()
    }
}
