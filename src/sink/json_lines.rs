//! A growing file of JSON lines.

use std::fs::File;
use std::io::{BufWriter, Write};
use std::path::{Path, PathBuf};

use serde::Serialize;

use super::{SinkError, create_dir};

/// A growing file of JSON lines.
#[derive(Debug)]
pub(crate) struct JsonLines {
    path: PathBuf,
    writer: BufWriter<File>,
    waiting: u32,
    limit: u32,
}

impl JsonLines {
    /// Replaces the file at `path`; at most `limit` lines wait in memory.
    pub(crate) fn create(path: &Path, limit: u32) -> Result<Self, SinkError> {
        if let Some(directory) = path.parent().filter(|d| !d.as_os_str().is_empty()) {
            create_dir(directory)?;
        }
        let file = File::create(path).map_err(SinkError::io(path))?;
        Ok(Self { path: path.to_owned(), writer: BufWriter::with_capacity(1 << 16, file), waiting: 0, limit })
    }

    pub(crate) fn push(&mut self, line: &impl Serialize) -> Result<(), SinkError> {
        serde_json::to_writer(&mut self.writer, line)
            .map_err(|source| SinkError::Json { path: self.path.clone(), source })?;
        self.writer.write_all(b"\n").map_err(SinkError::io(&self.path))?;
        self.waiting += 1;
        if self.waiting >= self.limit {
            self.waiting = 0;
            self.writer.flush().map_err(SinkError::io(&self.path))?;
        }
        Ok(())
    }

    pub(crate) fn finish(mut self) -> Result<(), SinkError> {
        self.writer.flush().map_err(SinkError::io(&self.path))
    }
}
