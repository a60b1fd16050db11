//! Values that keys of a station file take.

use std::fmt;

use crate::settings::{Kind, Setting};

/// Values that a key takes.
#[derive(Debug, Clone, Copy, PartialEq)]
pub enum Accepts {
    /// A number.
    Number {
        /// Least.
        min: f64,
        /// Greatest.
        max: f64,
    },
    /// A whole number.
    Integer {
        /// Least.
        min: i64,
        /// Greatest.
        max: i64,
    },
    /// Numbers in brackets.
    Numbers {
        /// Number of values.
        count: usize,
        /// Greatest magnitude of each.
        limit: f64,
    },
    /// One of some words.
    OneOf(&'static [&'static str]),
    /// Any of some words, in brackets.
    AnyOf(&'static [&'static str]),
    /// Any text, with what it says.
    Text(&'static str),
    /// Texts in brackets, with what each says.
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
            Kind::Numbers(count) => Self::Numbers { count, limit: setting.max },
            Kind::Switch => Self::Bool,
        }
    }
}

/// The address that a server listens at.
pub(super) const LISTEN_ADDRESS: &str = "an IP address, as \"127.0.0.1\" or \"0.0.0.0\"";
/// Axes of the scene in the patient.
pub(super) const AXES: &str = "three letters of R or L, A or P, S or I, right-handed, as \"RAS\", \"LPS\" or \"LSA\"";
/// The token of a page.
pub(super) const TOKEN: &str = "16 or more of A-Z a-z 0-9 - _";
/// The name of a station in its network.
pub(super) const HOST_NAME: &str = "a name without port, as \"station.local\"";
