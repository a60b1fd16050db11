//! Comparison of a data set with what this machine renders from its rows.

use super::step::{Progress, Step};
use super::tuple_renderer::TupleRenderer;
use super::{Dataset, DatasetError};
use crate::render::Backend;
use crate::statistics::evenly;
use serde::Serialize;

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
        let mut renderer = TupleRenderer::new(backend, self.header.classes.clone(), progress);
        let mut differ = Vec::new();
        for (done, index) in evenly(total, self.rows.len()).enumerate() {
            progress(Step::Tuples { done, total });
            let row = &self.rows[index];
            if !renderer.agrees(&self.directory, &self.header, row)? {
                differ.push(row.index);
            }
        }
        Ok(Verified { tuples: total, differ })
    }
}
