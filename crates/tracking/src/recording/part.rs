//! Partial file of an unfinished recording.

use std::fs::File;
use std::path::{Path, PathBuf};

use insonify_core::files::{FileError, PartError, PartFile};

use super::RecordingError;

/// `NAME.part`: path of the recording `NAME` until it is finished.
pub fn part_path(path: &Path) -> PathBuf {
    PartFile::appended(path).part
}

/// Creates the `.part` file of `path`, locked while it is open. A `.part` file of an interrupted recording is renamed.
pub(super) fn create(path: &Path) -> Result<File, RecordingError> {
    PartFile::appended(path).create_keeping().map_err(|error| match error {
        PartError::Busy { path } => RecordingError::Busy { path },
        PartError::File(FileError { path, source, .. }) => RecordingError::Write { path, reason: source.to_string() },
    })
}
