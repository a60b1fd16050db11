//! Station files, scenes and classes of a data set.

use std::path::{Path, PathBuf};

use super::sum::sha256;
use super::{Dataset, DatasetError, Exam, HEADER_FILE, Header, Row, ScanRow, StationRow};
use crate::anatomy::planes::planes_path;
use crate::files::{self, FileError, FileKind};
use crate::station::{SceneSource, Station};

/// Content of a station or scene file.
pub(super) fn read(path: &Path, kind: FileKind) -> Result<Vec<u8>, DatasetError> {
    Ok(files::read(path, kind).map_err(FileError::at("read", path))?)
}

/// Text of a station file.
pub(super) fn read_station(path: &Path) -> Result<String, DatasetError> {
    Ok(files::read_text(path, FileKind::Station).map_err(FileError::at("read", path))?)
}

impl StationRow {
    /// Row of `station`, which must have been loaded from a file. A hash of the content names the station's file in the
    /// data set.
    ///
    /// # Errors
    /// The station's file, its folder or its scene cannot be read.
    pub fn of(station: &Station) -> Result<Self, DatasetError> {
        let text = read(&station.path, FileKind::Station)?;
        let name = station.path.file_stem().map(|s| s.to_string_lossy().into_owned()).unwrap_or_default();
        let directory = station.path.parent().filter(|d| !d.as_os_str().is_empty()).unwrap_or(Path::new("."));
        let directory = directory.canonicalize().map_err(FileError::at("read", directory))?;
        let sum_of = |path: &Path| read(path, FileKind::Scene).map(|bytes| sha256(&bytes));
        Ok(Self {
            file: format!("stations/{name}_{}.toml", &sha256(&text)[..16]),
            directory: directory.display().to_string(),
            scene_sha256: station.scene_file().map(sum_of).transpose()?,
            scan: Some(ScanRow::new(&station.probe, station.settings.image.width, station.settings.image.height)),
        })
    }
}

impl Dataset {
    /// The station of the tuple of `row`, with the tuple's phantom as its scene.
    ///
    /// # Errors
    /// The row names an unknown station; the station file can't be read; the scene differs from the data set's; or
    /// the phantom is outside its range.
    pub fn station(&self, row: &Row) -> Result<Station, DatasetError> {
        station_of(&self.directory, &self.header, row)
    }
}

/// The station of the tuple of `row`, with the tuple's phantom as its scene. The data set is in `directory`.
pub(super) fn station_of(directory: &Path, header: &Header, row: &Row) -> Result<Station, DatasetError> {
    let mut station = open(directory, header, &row.station)?;
    if let (SceneSource::ObstetricPhantom(options), Some(phantom)) = (&mut station.scene, &row.phantom) {
        phantom.parameters.validate().map_err(|source| DatasetError::Phantom { index: row.index, source })?;
        *options = *phantom;
    }
    Ok(station)
}

/// Loads the station `file` of the data set in `directory`, and checks its scene file.
fn open(directory: &Path, header: &Header, file: &str) -> Result<Station, DatasetError> {
    let path = directory.join(file);
    let known = header.stations.iter().find(|station| station.file == file);
    let known = known
        .ok_or_else(|| DatasetError::UnknownStation { path: directory.join(HEADER_FILE), file: PathBuf::from(file) })?;
    let mut station = Station::parse(&read_station(&path)?, Path::new(&known.directory))?;
    station.path = path;
    if let (Some(scene), Some(expected)) = (station.scene_file(), &known.scene_sha256)
        && sha256(&read(scene, FileKind::Scene)?) != *expected
    {
        return Err(DatasetError::OtherScene { path: scene.to_owned() });
    }
    Ok(station)
}

/// Copy of `station` with the exam's phantom as its scene.
pub(super) fn with_phantom(station: &Station, exam: &Exam) -> Station {
    let mut station = station.clone();
    if let (SceneSource::ObstetricPhantom(options), Some(parameters)) = (&mut station.scene, exam.phantom) {
        options.parameters = parameters;
    }
    station
}

/// Whether the station's scene has standard planes. A scene file has them in a file next to it.
pub(super) fn has_planes(station: &Station) -> bool {
    station.scene_file().is_none_or(|path| planes_path(path).exists())
}

/// Name of the class for pixels outside the sector.
pub(super) const OUTSIDE: &str = "outside";

/// Names of all classes: [`OUTSIDE`], then each tissue of the stations once.
pub(super) fn classes(stations: &[Station]) -> Result<Vec<String>, DatasetError> {
    let mut classes = vec![OUTSIDE.to_owned()];
    for name in stations.iter().flat_map(|station| station.tissues.names()) {
        if !classes.contains(name) {
            classes.push(name.clone());
        }
    }
    match classes.len() {
        0..=256 => Ok(classes),
        count => Err(DatasetError::Tissues { count: count - 1 }),
    }
}

/// Class index of each tissue number. Number 0 is the outside, number i + 1 is `tissues[i]`.
pub(super) fn class_of(classes: &[String], tissues: &[String]) -> Result<Vec<u8>, DatasetError> {
    let class = |name: &str| {
        let found = classes.iter().position(|class| class == name).and_then(|at| u8::try_from(at).ok());
        found.ok_or_else(|| DatasetError::UnknownTissue { tissue: name.to_owned(), known: classes.join(", ") })
    };
    std::iter::once(OUTSIDE).chain(tissues.iter().map(String::as_str)).map(class).collect()
}
