//! Errors of class tables.

use std::path::PathBuf;

use thiserror::Error;

/// A table or mapping that can't be used.
#[derive(Debug, Error)]
pub enum ClassError {
    /// A name that no built-in table has.
    #[error("no table of classes is called `{name}`{nearest}; there are {known}")]
    UnknownTable {
        /// Name asked for.
        name: String,
        /// Suggestion, as text to append, or empty.
        nearest: String,
        /// Names of all built-in tables.
        known: String,
    },
    /// A file that can't be read.
    #[error("{}: can't be read: {error}", path.display())]
    Read {
        /// Path of the file.
        path: PathBuf,
        /// Cause of the failure.
        error: std::io::Error,
    },
    /// A file that isn't a table of classes.
    #[error("{table}: {error}")]
    Parse {
        /// Path of the file, or name of a built-in table.
        table: String,
        /// Position and cause.
        error: Box<toml::de::Error>,
    },
    /// A class with a wrong value.
    #[error("{table}: class `{class}`: {reason}")]
    Class {
        /// Path of the file, or name of a built-in table.
        table: String,
        /// Name of the class.
        class: String,
        /// Description of the fault.
        reason: String,
    },
    /// A mapping that isn't of the form `NAME=TARGET`.
    #[error(
        "`{mapping}` must be NAME=TISSUE, NAME=CLASS or NAME=ignore, as in `Segment_1=liver`; NAME may be a number"
    )]
    Mapping {
        /// Mapping as given.
        mapping: String,
    },
    /// A mapping of a name with unprintable characters.
    #[error("`{mapping}`: the name has a line break or control character; leave it out")]
    Unprintable {
        /// Mapping, without its unprintable characters.
        mapping: String,
    },
    /// A mapping of a name or number that occurs nowhere.
    #[error("--map: {path} has no `{name}`{nearest}; it has {known}")]
    Unused {
        /// Name or number in the mapping.
        name: String,
        /// Path of the file or folder with the labels.
        path: PathBuf,
        /// Suggestion, as text to append, or empty.
        nearest: String,
        /// The first names and numbers that occur, as text.
        known: String,
    },
    /// A mapping to an unknown target.
    #[error("`{mapping}`: `{target}` is neither a class nor a tissue{nearest}")]
    Target {
        /// Mapping, as given.
        mapping: String,
        /// Text after the `=` of the mapping.
        target: String,
        /// Suggestion, as text to append, or empty.
        nearest: String,
    },
}
