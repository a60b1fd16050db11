//! High quality of another data set of the same plan.

use std::collections::HashMap;
use std::path::Path;

use anyhow::anyhow;
use insonify::dataset::{Dataset, Header, Row};

use super::super::{Classify, Failure};

/// A data set whose high quality is taken over.
pub(super) struct Targets {
    dataset: Dataset,
    /// Its rows by index.
    rows: HashMap<usize, usize>,
}

impl Targets {
    /// Opens the data set in `directory`. Refuses one whose high quality isn't that of `header`.
    pub(super) fn open(directory: &Path, header: &Header) -> Result<Self, Failure> {
        let dataset = Dataset::open(directory).input()?;
        let found = &dataset.header;
        let same = [
            ("hq", found.hq == header.hq),
            ("angles", found.look.hq_angles == header.look.hq_angles),
            ("span", found.look.span_deg == header.look.span_deg),
            ("seed", found.seed == header.seed),
            ("stations", found.stations == header.stations),
            ("tissues", found.classes == header.classes),
        ];
        if let Some((what, _)) = same.iter().find(|(_, same)| !same) {
            return Err(Failure::Input(anyhow!(
                "--hq-from {}: it has another {what}: its high quality is not the one wanted",
                directory.display()
            )));
        }
        let rows = dataset.rows.iter().enumerate().map(|(at, row)| (row.index, at)).collect();
        Ok(Self { dataset, rows })
    }

    /// Grey levels of the high quality of `row`.
    pub(super) fn of(&self, row: &Row) -> Result<Vec<u8>, Failure> {
        let refused = |why: &str| {
            let directory = self.dataset.directory.display();
            Failure::Input(anyhow!("--hq-from {directory}: tuple {} {why}", row.index))
        };
        let found = self.rows.get(&row.index).and_then(|&at| self.dataset.rows.get(at));
        let found = found.ok_or_else(|| refused("is missing there: finish that data set first"))?;
        let same = (found.pose, found.time_s, found.settings, found.seed, found.phantom)
            == (row.pose, row.time_s, row.settings, row.seed, row.phantom);
        if !same {
            return Err(refused(
                "shows another pose there: give both data sets the same options but --lq and --lq-angles",
            ));
        }
        Ok(self.dataset.tuple(found).input()?.hq)
    }
}
