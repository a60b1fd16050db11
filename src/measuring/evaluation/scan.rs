//! Scanlines of the pictures in a data set.

use std::path::Path;

use crate::dataset::{Dataset, Row as TupleRow};
use crate::files::{self, FileError, FileKind};
use crate::quality::Scanlines;
use crate::station::{Station, StationError};
use crate::transducer::{Probe, ScanGeometry};

/// Scanlines of the pictures of one station and size.
pub(super) struct Scan {
    /// Scanline and depth of every pixel.
    pub(super) scanlines: Scanlines,
    pub(super) geometry: ScanGeometry,
}

impl Scan {
    /// Scanlines of the pictures of a tuple.
    pub(super) fn of(dataset: &Dataset, row: &TupleRow) -> Result<Self, StationError> {
        let (probe, [width, height]) = (probe(dataset, row)?, row.size);
        let geometry = ScanGeometry::fit(&probe, width, height);
        Ok(Self { scanlines: Scanlines::new(&probe, width, height), geometry })
    }
}

/// Probe of a tuple, from its station file in the data set. The station's scene need not exist.
pub(super) fn probe(dataset: &Dataset, row: &TupleRow) -> Result<Probe, StationError> {
    let path = dataset.directory.join(&row.station);
    let text = files::read_text(&path, FileKind::Station).map_err(FileError::at("read the station file", &path))?;
    let directory = dataset.header.stations.iter().find(|s| s.file == row.station).map_or("", |s| &s.directory);
    Ok(Station::parse(&text, Path::new(directory))?.probe)
}
