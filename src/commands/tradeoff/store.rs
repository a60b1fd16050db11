//! Finished points on disk, for a resumed run.

use std::path::{Path, PathBuf};

use anyhow::Context;
use insonify::files::{self, FileKind};
use insonify::sink::{create_dir, remove, write_json};
use serde::Serialize;
use serde::de::DeserializeOwned;
use sha2::{Digest, Sha256};

use super::super::{Classify, Failure};

/// Files in a folder. Their names contain a hash of everything that they depend on.
pub(super) struct Store {
    folder: PathBuf,
    key: String,
}

impl Store {
    /// Opens the store in `out`. Without `resume`, entries of the same key are deleted.
    pub(super) fn new(out: &Path, resume: bool, key: &[String]) -> Result<Self, Failure> {
        let folder = out.join("points");
        create_dir(&folder)?;
        let store = Self { folder, key: digest(&[env!("CARGO_PKG_VERSION"), &key.join("\n")]) };
        if !resume {
            let prefix = format!("{}_", store.key);
            for entry in std::fs::read_dir(&store.folder).other()? {
                let path = entry.other()?.path();
                if path.file_name().is_some_and(|name| name.to_string_lossy().starts_with(&prefix)) {
                    remove(&path)?;
                }
            }
        }
        Ok(store)
    }

    /// Path of the entry `name`.
    pub(super) fn path(&self, name: &str, extension: &str) -> PathBuf {
        self.folder.join(format!("{}_{}.{extension}", self.key, name.replace([' ', '/', '\\'], "_")))
    }

    /// Reads a value that [`Store::write`] wrote; `None` if there is none.
    pub(super) fn read<T: DeserializeOwned>(&self, name: &str) -> Result<Option<T>, Failure> {
        let path = self.path(name, "json");
        let text = match files::read(&path, FileKind::Stored) {
            Ok(text) => text,
            Err(e) if e.kind() == std::io::ErrorKind::NotFound => return Ok(None),
            Err(e) => return Err(e).with_context(|| format!("cannot read {}", path.display())).other(),
        };
        let value = serde_json::from_slice(&text);
        Ok(Some(value.with_context(|| format!("{} is damaged: run without --resume", path.display())).input()?))
    }

    /// Writes a value under a name.
    pub(super) fn write(&self, name: &str, value: &impl Serialize) -> Result<(), Failure> {
        Ok(write_json(&self.path(name, "json"), value)?)
    }
}

fn digest(parts: &[&str]) -> String {
    let mut hash = Sha256::new();
    for part in parts {
        hash.update(part.as_bytes());
        hash.update([0]);
    }
    insonify::files::hex(&hash.finalize()[..6])
}
