//! High-quality frames copied from another data set with the same plan.

use std::collections::HashMap;
use std::path::Path;

use super::{Dataset, DatasetError, Header, Row};

/// A data set from which the high quality is copied.
#[derive(Debug)]
pub(super) struct Targets {
    dataset: Dataset,
    /// Position of each tuple index in the data set's rows.
    rows: HashMap<usize, usize>,
}

impl Targets {
    /// Opens the data set in `directory`. Refuses it if its high quality or its plan differs from `header`.
    pub(super) fn open(directory: &Path, header: &Header) -> Result<Self, DatasetError> {
        let dataset = Dataset::open(directory)?;
        let found = &dataset.header;
        let values = [
            ("hq", format!("{:?}", found.hq), format!("{:?}", header.hq)),
            ("look.hq_angles", found.look.hq_angles.to_string(), header.look.hq_angles.to_string()),
            ("look.span_deg", found.look.span_deg.to_string(), header.look.span_deg.to_string()),
            ("seed", found.seed.to_string(), header.seed.to_string()),
        ];
        if let Some((key, found, wanted)) = values.into_iter().find(|(_, found, wanted)| found != wanted) {
            return Err(DatasetError::OtherTarget { directory: directory.to_owned(), key, found, wanted });
        }
        let same_stations = found.stations.len() == header.stations.len()
            && found.stations.iter().zip(&header.stations).all(|(found, wanted)| found.same_files(wanted));
        let lists = [("stations", same_stations), ("classes", found.classes == header.classes)];
        if let Some((key, _)) = lists.iter().find(|(_, same)| !same) {
            let reason = format!("its {key} differ from those given here: give the stations that made it");
            return Err(DatasetError::Target { directory: directory.to_owned(), reason });
        }
        let rows = dataset.rows.iter().enumerate().map(|(at, row)| (row.index, at)).collect();
        Ok(Self { dataset, rows })
    }

    /// Grey levels of the copied high-quality frame for `row`.
    pub(super) fn of(&self, row: &Row) -> Result<Vec<u8>, DatasetError> {
        let refused = |why: &str| DatasetError::Target {
            directory: self.dataset.directory.clone(),
            reason: format!("tuple {} {why}", row.index),
        };
        let found = self.rows.get(&row.index).and_then(|&at| self.dataset.rows.get(at));
        let found = found.ok_or_else(|| refused("is missing there: finish that data set first"))?;
        let same = (found.pose, found.time_s, found.settings, found.seed, found.phantom)
            == (row.pose, row.time_s, row.settings, row.seed, row.phantom);
        if !same {
            return Err(refused("shows another pose there: only the low quality and its angles may differ"));
        }
        Ok(self.dataset.tuple(found)?.hq)
    }
}
