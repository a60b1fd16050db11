//! Description of a station: its tables, and the station parsed from them.

use std::path::PathBuf;
use std::sync::Arc;

use insonify::render::BackendChoice;
use toml::{Table, Value};

use crate::errors::{Failure, Kind};
use crate::scene::Surfaces;

/// A station as its file and later changes describe it.
#[derive(Clone)]
pub(crate) struct Described {
    pub(crate) table: Table,
    /// Directory at which relative paths start.
    pub(crate) directory: PathBuf,
    /// Station file; none for a station of tables.
    pub(crate) path: Option<PathBuf>,
    pub(crate) arrays: Option<Arc<Surfaces>>,
    /// Choice of the backend, if any; it overrides the file and the environment.
    pub(crate) backend: Option<BackendChoice>,
    pub(crate) station: insonify::Station,
}

impl Described {
    pub(crate) fn new(
        mut table: Table,
        directory: PathBuf,
        path: Option<PathBuf>,
        arrays: Option<Arc<Surfaces>>,
        backend: Option<BackendChoice>,
    ) -> Result<Self, Failure> {
        if let Some(arrays) = &arrays {
            // The parser requires a file. This name is only shown; the file is never read.
            let scene = table.entry("scene").or_insert_with(|| Value::Table(Table::new()));
            if let Value::Table(scene) = scene {
                scene.insert("path".into(), "a scene of arrays".into());
                scene.insert("background".into(), arrays.background.clone().into());
            }
        }
        let text = toml::to_string(&table).map_err(|error| Failure::of(Kind::Station, &error))?;
        let mut station = insonify::Station::parse(&text, &directory)?;
        if let Some(path) = &path {
            station.path = path.clone();
        }
        Ok(Self { table, directory, path, arrays, backend, station })
    }
}
