//! Tracked sequences of other programs, imported as recordings.
//!
//! [`meta_image`] reads the `.mha` sequences of [PLUS](https://plustoolkit.github.io) and SlicerIGSIO; [`csv`] reads
//! tables. Their poses are used as `scene_from_probe`: a sequence's tracker frame becomes the scene frame.

use std::io::{BufRead, BufReader, Read};
use std::path::{Path, PathBuf};

use insonify_core::files::{self, FileError, FileKind};
use insonify_core::pose::Pose;
use thiserror::Error;

use super::{Event, IMPORTED, RecordingError, RecordingInfo, RecordingWriter};
use crate::tracker::{Protocol, ascii_line};

pub mod csv;
pub mod meta_image;
mod tracking;

pub use tracking::{tracked, transforms_of};

/// Longest time from the first to the last pose, s: thirty years.
const SPAN_LIMIT_S: f64 = 1e9;

/// Smallest first time that counts as Unix time, s. A sequence that starts earlier has an arbitrary origin.
const UNIX_FROM_S: f64 = 1e8;

/// Errors in imported sequences.
#[derive(Debug, Error)]
pub enum InterchangeError {
    /// The file could not be read.
    #[error(transparent)]
    Read(#[from] FileError),
    /// A line is wrong.
    #[error("{path}, line {line} (byte {byte}): {reason}")]
    Line {
        /// File.
        path: PathBuf,
        /// Line, from 1.
        line: u64,
        /// Offset of the line in the file, bytes.
        byte: u64,
        /// Fault and correct form.
        reason: String,
    },
    /// The file as a whole is wrong.
    #[error("{path}: {reason}")]
    File {
        /// File.
        path: PathBuf,
        /// Fault and correct form.
        reason: String,
    },
    /// The recording could not be written.
    #[error(transparent)]
    Recording(#[from] RecordingError),
}

impl InterchangeError {
    fn file(path: &Path, reason: impl Into<String>) -> Self {
        Self::File { path: path.to_owned(), reason: reason.into() }
    }
}

/// Position of a line in a text file.
#[derive(Debug, Clone, Copy, PartialEq, Eq, Default)]
pub struct LinePosition {
    /// Line, from 1.
    pub line: u64,
    /// Offset of the line in the file, bytes.
    pub byte: u64,
}

impl LinePosition {
    fn error(self, path: &Path, reason: impl Into<String>) -> InterchangeError {
        InterchangeError::Line { path: path.to_owned(), line: self.line, byte: self.byte, reason: reason.into() }
    }
}

/// One row of a sequence.
#[derive(Debug, Clone, PartialEq)]
pub struct TrackedRow {
    /// Time, s from the sequence's origin.
    pub time_s: f64,
    /// `tracker_from_probe`; `None` if the tracker did not see the probe.
    pub pose: Option<Pose>,
    /// Name of an event at that time, if there is one.
    pub event: Option<String>,
    /// Position in the file.
    pub position: LinePosition,
}

/// Reads the rows of a PLUS sequence (.mha, .mhd) or of a table (.csv, .tsv). `transform` is the name of the transform
/// that gives the poses of a sequence.
///
/// # Errors
/// A file of another kind, or an unreadable file.
pub fn read_rows(path: &Path, transform: &str) -> Result<Vec<TrackedRow>, InterchangeError> {
    let extension = path.extension().map(|e| e.to_string_lossy().to_ascii_lowercase());
    match extension.as_deref() {
        Some("mha" | "mhd") => tracked(&meta_image::open(path)?, transform, path),
        Some("csv" | "tsv") => {
            let failed = FileError::at("read", path);
            csv::read(BufReader::new(files::open(path, FileKind::Table).map_err(failed)?), path)
        }
        Some("nrrd" | "nhdr") => Err(InterchangeError::file(
            path,
            "sequences in NRRD aren't read; save it as .igs.mha, by PLUS's EditSequenceFile or 3D Slicer's Sequences module",
        )),
        Some("mcap") => Err(InterchangeError::file(path, "it is a recording already; `insonify inspect` reads it")),
        Some("fcsv" | "json") => Err(InterchangeError::file(
            path,
            "markups hold points, not poses; `insonify calibrate landmarks --tracker STATION --points` takes them",
        )),
        Some("xlsx" | "xls" | "ods") => Err(InterchangeError::file(
            path,
            "it is neither .mha, .mhd nor .csv; save the sheet as CSV in UTF-8, with decimal points",
        )),
        _ => Err(InterchangeError::file(path, "it is neither .mha, .mhd nor .csv")),
    }
}

/// Outcome of [`write_recording`].
#[derive(Debug, Clone, Copy, PartialEq, serde::Serialize)]
pub struct Imported {
    /// Number of poses in the recording.
    pub poses: usize,
    /// Number of rows without a pose, which became gaps.
    pub without_pose: usize,
    /// Number of events in the recording.
    pub events: usize,
    /// Time from the first row to the last, s.
    pub duration_s: f64,
}

/// Writes rows as a recording of [`ascii_line`]s: positions are rounded to 0.1 µm, quaternions to 1e-8.
///
/// `source` is stored as the recording's device, in a form that excludes the poses from any station's calibration. The
/// host time of the first row is its Unix time, or 0 if times have an arbitrary origin. Counters are row numbers, so
/// rows without a pose count as missing records.
///
/// # Errors
/// No row has a pose, times decrease or span more than thirty years, or the recording cannot be written.
pub fn write_recording(rows: &[TrackedRow], source: &Path, path: &Path) -> Result<Imported, InterchangeError> {
    let (Some(first), Some(last)) = (rows.first(), rows.last()) else {
        return Err(InterchangeError::file(source, "it has no rows"));
    };
    if rows.iter().all(|row| row.pose.is_none()) {
        return Err(InterchangeError::file(source, format!("none of its {} rows has a pose", rows.len())));
    }
    let mut before_s = first.time_s;
    for row in rows {
        if row.time_s < before_s {
            let reason =
                format!("time {} s lies before {before_s} s of the row before; times must not fall", row.time_s);
            return Err(row.position.error(source, reason));
        }
        if row.time_s - first.time_s > SPAN_LIMIT_S {
            let reason = format!("time {} s is more than {SPAN_LIMIT_S} s after the first", row.time_s);
            return Err(row.position.error(source, reason));
        }
        before_s = row.time_s;
    }
    let origin_s = if (UNIX_FROM_S..SPAN_LIMIT_S * 10.0).contains(&first.time_s) { first.time_s } else { 0.0 };
    let origin_ns = (origin_s * 1e9).round() as u64;
    let info = RecordingInfo {
        device: format!("{IMPORTED}{}", source.file_name().unwrap_or(source.as_os_str()).display()),
        protocol: Protocol::AsciiLine,
        start_time_ns: origin_ns,
        ..RecordingInfo::default()
    };
    let mut writer = RecordingWriter::create(path, &info)?;
    let mut imported = Imported { poses: 0, without_pose: 0, events: 0, duration_s: last.time_s - first.time_s };
    for (sequence, row) in (0_u32..).zip(rows) {
        let since_ns = ((row.time_s - first.time_s) * 1e9).round() as u64;
        if let Some(event) = &row.event {
            writer.event(&Event::new(origin_ns + since_ns, event))?;
            imported.events += 1;
        }
        match &row.pose {
            Some(pose) => {
                writer.raw(origin_ns + since_ns, ascii_line::encode(sequence, since_ns / 1000, pose).as_bytes())?;
                imported.poses += 1;
            }
            None => imported.without_pose += 1,
        }
    }
    writer.finish()?;
    Ok(imported)
}

/// Reader of lines of bounded length that tracks their positions.
struct Lines<R> {
    source: R,
    path: PathBuf,
    next: LinePosition,
    text: Vec<u8>,
}

impl<R: BufRead> Lines<R> {
    /// Longest line, bytes.
    const LIMIT: u64 = 1 << 16;

    fn new(source: R, path: &Path) -> Self {
        Self { source, path: path.to_owned(), next: LinePosition { line: 1, byte: 0 }, text: Vec::new() }
    }

    /// Next line without its end, and its position; `None` at the end of the file.
    fn next_line(&mut self) -> Result<Option<(LinePosition, &str)>, InterchangeError> {
        self.text.clear();
        let read = self.source.by_ref().take(Self::LIMIT + 1).read_until(b'\n', &mut self.text);
        let read = read.map_err(FileError::at("read", &self.path))? as u64;
        if read == 0 {
            return Ok(None);
        }
        let position = self.next;
        self.next = LinePosition { line: position.line + 1, byte: position.byte + read };
        if read > Self::LIMIT {
            return Err(position.error(&self.path, format!("it is longer than {} bytes", Self::LIMIT)));
        }
        let line = self.text.strip_suffix(b"\n").unwrap_or(&self.text);
        let line = line.strip_suffix(b"\r").unwrap_or(line);
        match std::str::from_utf8(line) {
            Ok(text) => Ok(Some((position, text))),
            Err(error) => {
                let reason = format!("byte {} of the line is no UTF-8 text", error.valid_up_to());
                Err(position.error(&self.path, reason))
            }
        }
    }
}

/// Parses a number; `None` unless it is finite.
fn finite(text: &str) -> Option<f64> {
    text.trim().parse().ok().filter(|number: &f64| number.is_finite())
}
