//! The error of all accesses to files.

use std::io;
use std::path::{Path, PathBuf};

use thiserror::Error;

/// Failed access to a file or folder.
#[derive(Debug, Error)]
#[error("cannot {doing} {path}: {source}")]
pub struct FileError {
    /// File or folder.
    pub path: PathBuf,
    /// Attempted action, as in `read the scene`.
    pub doing: &'static str,
    /// Cause.
    pub source: io::Error,
}

impl FileError {
    /// Adds action and path to an I/O error.
    pub fn at(doing: &'static str, path: &Path) -> impl Fn(io::Error) -> Self + Copy {
        move |source| Self { path: path.to_owned(), doing, source }
    }
}
