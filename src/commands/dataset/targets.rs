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
        let refused = |what: String| Failure::Input(anyhow!("--hq-from {}: {what}", directory.display()));
        let values = [
            ("hq", format!("{:?}", found.hq), format!("{:?}", header.hq), "--hq"),
            ("look.hq_angles", found.look.hq_angles.to_string(), header.look.hq_angles.to_string(), "--angles"),
            ("look.span_deg", found.look.span_deg.to_string(), header.look.span_deg.to_string(), "--span"),
            ("seed", found.seed.to_string(), header.seed.to_string(), "--seed"),
        ];
        if let Some((key, found, wanted, by)) = values.into_iter().find(|(_, found, wanted, _)| found != wanted) {
            return Err(refused(format!("{key} is {found} there, {wanted} is wanted here: {by} says so")));
        }
        let same_stations = found.stations.len() == header.stations.len()
            && found.stations.iter().zip(&header.stations).all(|(found, wanted)| found.same_files(wanted));
        let lists = [("stations", same_stations), ("classes", found.classes == header.classes)];
        if let Some((key, _)) = lists.iter().find(|(_, same)| !same) {
            return Err(refused(format!("{key} differ from those of this command: name the stations that made it")));
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
