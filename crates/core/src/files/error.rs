//! Error type of all file accesses.

use std::io;
use std::path::{Path, PathBuf};

use thiserror::Error;

/// Failed access to a file or folder.
#[derive(Debug, Error)]
#[error("cannot {doing} {path}: {source}")]
pub struct FileError {
    /// File or folder.
    pub path: PathBuf,
    /// Attempted action as a verb with its object, for example `read the scene`.
    pub doing: &'static str,
    /// Cause.
    pub source: io::Error,
}

impl FileError {
    /// Function that converts an I/O error into a `FileError` with the action `doing` and the path `path`.
    pub fn at(doing: &'static str, path: &Path) -> impl Fn(io::Error) -> Self + Copy {
        move |source| Self { path: path.to_owned(), doing, source }
    }
}
