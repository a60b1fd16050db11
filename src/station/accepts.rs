//! Values that the keys of a station file accept.

use std::fmt;

use crate::settings::{AUTO, Kind, Setting};

/// Values that a key accepts.
#[derive(Debug, Clone, Copy, PartialEq)]
pub enum Accepts {
    /// A number.
    Number {
        /// Smallest accepted value.
        min: f64,
        /// Largest accepted value.
        max: f64,
    },
    /// A whole number.
    Integer {
        /// Smallest accepted value.
        min: i64,
        /// Largest accepted value.
        max: i64,
    },
    /// A whole number, or the word "auto".
    IntegerOrAuto {
        /// Smallest accepted value.
        min: i64,
        /// Largest accepted value.
        max: i64,
    },
    /// An array of numbers.
    Numbers {
        /// Number of values.
        count: usize,
        /// Largest magnitude of each number.
        limit: f64,
    },
    /// One of these words.
    OneOf(&'static [&'static str]),
    /// An array of any of these words.
    AnyOf(&'static [&'static str]),
    /// Any text; the string describes its meaning.
    Text(&'static str),
    /// An array of texts; the string describes the meaning of each.
    Texts(&'static str),
    /// true or false.
    Bool,
    /// A table.
    Table,
}

impl fmt::Display for Accepts {
    fn fmt(&self, f: &mut fmt::Formatter<'_>) -> fmt::Result {
        match self {
            Self::Number { min, max } => write!(f, "a number in {min}..={max}"),
            Self::Integer { min, max } => write!(f, "a whole number in {min}..={max}"),
            Self::IntegerOrAuto { min, max } => write!(f, "a whole number in {min}..={max}, or \"{AUTO}\""),
            Self::Numbers { count, limit } => write!(f, "[{count} numbers within ±{limit}]"),
            Self::OneOf(words) => write!(f, "one of \"{}\"", words.join("\", \"")),
            Self::AnyOf(words) => write!(f, "[any of \"{}\"]", words.join("\", \"")),
            Self::Text(what) => write!(f, "{what} in quotes"),
            Self::Texts(what) => write!(f, "[{what} each, in quotes]"),
            Self::Bool => write!(f, "true or false"),
            Self::Table => write!(f, "a table"),
        }
    }
}

impl From<&Setting> for Accepts {
    fn from(setting: &Setting) -> Self {
        match setting.kind {
            Kind::Number => Self::Number { min: setting.min, max: setting.max },
            Kind::Whole => Self::Integer { min: setting.min as i64, max: setting.max as i64 },
            Kind::WholeOrAuto => Self::IntegerOrAuto { min: setting.min as i64, max: setting.max as i64 },
            Kind::Numbers(count) => Self::Numbers { count, limit: setting.max },
            Kind::Switch => Self::Bool,
            Kind::Word(words) => Self::OneOf(words),
        }
    }
}

/// Listening address of a server.
pub(super) const LISTEN_ADDRESS: &str = "an IP address, as \"127.0.0.1\" or \"0.0.0.0\"";
/// Directions of the scene's axes in the patient.
pub(super) const AXES: &str = "three letters of R or L, A or P, S or I, right-handed, as \"RAS\", \"LPS\" or \"LSA\"";
/// Token of the browser page.
pub(super) const TOKEN: &str = "16 or more of A-Z a-z 0-9 - _";
/// Network name of a station.
pub(super) const HOST_NAME: &str = "a name without port, as \"station.local\"";
/// Address of the page without its path.
pub(super) const ORIGIN: &str =
    "http:// or https://, a name or address, and its port, without path, as \"https://station.local:9000\",";
