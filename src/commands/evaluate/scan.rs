//! Scanlines of the pictures of a data set.

use std::path::Path;

use insonify::dataset::{Dataset, Row as TupleRow};
use insonify::files::{self, FileKind};
use insonify::quality::Scanlines;
use insonify::station::Station;
use insonify::transducer::ScanGeometry;

/// Scanlines of pictures of one station and size.
pub(super) struct Scan {
    /// Scanline and depth of every pixel.
    pub(super) scanlines: Scanlines,
    pub(super) geometry: ScanGeometry,
}

/// Scanlines of a tuple's image, from the station's file in the data set.
pub(super) fn scan(dataset: &Dataset, row: &TupleRow) -> Result<Scan, anyhow::Error> {
    let text = files::read_text(&dataset.directory.join(&row.station), FileKind::Station)?;
    let directory = dataset.header.stations.iter().find(|s| s.file == row.station).map_or("", |s| &s.directory);
    let station = Station::parse(&text, Path::new(directory))?;
    let [width, height] = row.size;
    Ok(Scan {
        scanlines: Scanlines::new(&station.probe, width, height),
        geometry: ScanGeometry::fit(&station.probe, width, height),
    })
}
