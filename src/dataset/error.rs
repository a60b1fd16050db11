//! Errors of data sets.

use std::path::PathBuf;

use thiserror::Error;

/// Error in planning or reading a data set.
#[derive(Debug, Error)]
pub enum DatasetError {
    /// The operating system refused.
    #[error("cannot read {path}: {source}")]
    Io {
        /// File or directory.
        path: PathBuf,
        /// Cause.
        source: std::io::Error,
    },
    /// `dataset.json` is none.
    #[error("{path} is no data set's header: {source}")]
    Header {
        /// File.
        path: PathBuf,
        /// Cause.
        source: serde_json::Error,
    },
    /// A data set of another version.
    #[error("{path} has format {found}; this version of insonify reads {expected}")]
    Format {
        /// File.
        path: PathBuf,
        /// Its format.
        found: u32,
        /// The one that is read.
        expected: u32,
    },
    /// A line of a manifest that is no row.
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
    /// A wish that cannot be met.
    #[error("{0}")]
    Plan(String),
}
