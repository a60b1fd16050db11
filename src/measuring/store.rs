//! Measured results on disk, for a resumed measurement, and the identity of the measured frames.

use std::fmt::{self, Write};
use std::path::{Path, PathBuf};

use serde::Serialize;
use serde::de::DeserializeOwned;
use sha2::{Digest, Sha256};

use super::MeasuringError;
use crate::anatomy::Scene;
use crate::files::{self, FileError, FileKind, hex};
use crate::sink::{create_dir, remove, write_json};
use crate::station::Station;

/// Result files in a folder. Their names contain a hash of everything that the results depend on.
#[derive(Debug)]
pub(crate) struct Store {
    folder: PathBuf,
    key: String,
}

impl Store {
    /// Opens the store in the folder `out`. `key` names everything that results depend on. Without `resume`, entries of
    /// the same key are deleted.
    pub(crate) fn new(out: &Path, resume: bool, key: &[String]) -> Result<Self, MeasuringError> {
        let folder = out.join("points");
        create_dir(&folder)?;
        let store = Self { folder, key: digest(&[env!("CARGO_PKG_VERSION"), &key.join("\n")]) };
        if !resume {
            let failed = |source| MeasuringError::Read(FileError::at("read", &store.folder)(source));
            let prefix = format!("{}_", store.key);
            for entry in std::fs::read_dir(&store.folder).map_err(failed)? {
                let path = entry.map_err(failed)?.path();
                if path.file_name().is_some_and(|name| name.to_string_lossy().starts_with(&prefix)) {
                    remove(&path)?;
                }
            }
        }
        Ok(store)
    }

    /// Path of the file of entry `name`.
    pub(crate) fn path(&self, name: &str, extension: &str) -> PathBuf {
        self.folder.join(format!("{}_{}.{extension}", self.key, name.replace([' ', '/', '\\'], "_")))
    }

    /// Reads the value that [`Store::write`] wrote under `name`; `None` if there is none.
    pub(crate) fn read<T: DeserializeOwned>(&self, name: &str) -> Result<Option<T>, MeasuringError> {
        let path = self.path(name, "json");
        let text = match files::read(&path, FileKind::Stored) {
            Ok(text) => text,
            Err(e) if e.kind() == std::io::ErrorKind::NotFound => return Ok(None),
            Err(source) => return Err(MeasuringError::Read(FileError::at("read", &path)(source))),
        };
        serde_json::from_slice(&text).map(Some).map_err(|source| MeasuringError::Damaged { path, source })
    }

    /// Writes a value under a name.
    pub(crate) fn write(&self, name: &str, value: &impl Serialize) -> Result<(), MeasuringError> {
        Ok(write_json(&self.path(name, "json"), value)?)
    }
}

fn digest(parts: &[&str]) -> String {
    let mut hash = Sha256::new();
    for part in parts {
        hash.update(part.as_bytes());
        hash.update([0]);
    }
    hex(&hash.finalize()[..6])
}

/// Hash that text is written to.
struct Sum(Sha256);

impl Write for Sum {
    fn write_str(&mut self, text: &str) -> fmt::Result {
        self.0.update(text.as_bytes());
        Ok(())
    }
}

/// Identity of the frames: the station without knobs and poses, and the scene by its content, not its path.
pub(crate) fn identity(station: &Station, scene: &Scene) -> String {
    let mut sum = Sum(Sha256::new());
    // Writing to a hash can't fail.
    let _ = write!(sum, "{scene:?}");
    let sum = hex(&sum.0.finalize());
    let Station { background, motion, probe, settings, generator, tissues, .. } = station;
    format!("{sum} {background} {motion} {probe:?} {settings:?} {generator:?} {tissues:?}")
}
