//! Scanlines of the pictures of a data set.

use std::path::Path;

use insonify::dataset::{Dataset, Row as TupleRow};
use insonify::files::{self, FileKind};
use insonify::quality::Scanlines;
use insonify::station::Station;
use insonify::transducer::{Probe, ScanGeometry};

/// Scanlines of pictures of one station and size.
pub(super) struct Scan {
    /// Scanline and depth of every pixel.
    pub(super) scanlines: Scanlines,
    pub(super) geometry: ScanGeometry,
}

impl Scan {
    /// Scanlines of a row's pictures.
    pub(super) fn of(dataset: &Dataset, row: &TupleRow) -> Result<Self, anyhow::Error> {
        let (probe, [width, height]) = (probe(dataset, row)?, row.size);
        let geometry = ScanGeometry::fit(&probe, width, height);
        Ok(Self { scanlines: Scanlines::new(&probe, width, height), geometry })
    }
}

/// Probe of a row, from the station's file in the data set.
pub(super) fn probe(dataset: &Dataset, row: &TupleRow) -> Result<Probe, anyhow::Error> {
    let text = files::read_text(&dataset.directory.join(&row.station), FileKind::Station)?;
    let directory = dataset.header.stations.iter().find(|s| s.file == row.station).map_or("", |s| &s.directory);
    Ok(Station::parse(&text, Path::new(directory))?.probe)
}
