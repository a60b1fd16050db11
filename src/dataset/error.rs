//! Errors of data sets.

use std::path::PathBuf;

use thiserror::Error;

/// Error in planning or reading a data set.
#[derive(Debug, Error)]
pub enum DatasetError {
    /// Failed file access.
    #[error("cannot read {path}: {source}")]
    Io {
        /// File or directory.
        path: PathBuf,
        /// Cause.
        source: std::io::Error,
    },
    /// An invalid `dataset.json`.
    #[error("{path} is no data set's header: {source}")]
    Header {
        /// File.
        path: PathBuf,
        /// Cause.
        source: serde_json::Error,
    },
    /// A data set of another format version.
    #[error("{path} has format {found}; this version of insonify reads {expected}")]
    Format {
        /// File.
        path: PathBuf,
        /// Its format.
        found: u32,
        /// Supported format.
        expected: u32,
    },
    /// An invalid row in a manifest.
    #[error("{path}, line {line}: {reason}")]
    Row {
        /// Manifest.
        path: PathBuf,
        /// Line, from 1.
        line: usize,
        /// Description of the fault.
        reason: String,
    },
    /// An array that does not hold what its row says.
    #[error("{path}: {reason}")]
    Array {
        /// File.
        path: PathBuf,
        /// Description of the fault.
        reason: String,
    },
    /// A request that cannot be planned.
    #[error("{0}")]
    Plan(String),
}
