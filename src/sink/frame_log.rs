//! A line of JSON a frame.

use std::fs::File;
use std::io::{BufWriter, Write};
use std::path::{Path, PathBuf};

use serde::Serialize;

use super::frame_line::FrameLine;
use super::live::{LiveSink, PresentedFrame};
use super::{SinkError, create_dir};

/// Lines that are brought to the file together at most.
const LINES: u32 = 32;

/// Writes a JSON line for each frame that it is given. What was written before a kill can be read.
#[derive(Debug)]
pub struct FrameLog {
    lines: JsonLines,
}

impl FrameLog {
    /// Replaces the file at `path`.
    ///
    /// # Errors
    /// The file cannot be created.
    pub fn create(path: &Path) -> Result<Self, SinkError> {
        Ok(Self { lines: JsonLines::create(path, LINES)? })
    }
}

impl LiveSink for FrameLog {
    fn name(&self) -> &str {
        "metrics"
    }

    fn present(&mut self, frame: &PresentedFrame) -> Result<(), SinkError> {
        self.lines.push(&FrameLine::new(frame))
    }

    fn finish(self: Box<Self>) -> Result<(), SinkError> {
        self.lines.finish()
    }
}

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
