//! Ways of the pass `trace` on a device.

use std::str::FromStr;

use thiserror::Error;

/// Environment variable that names a way.
const VARIABLE: &str = "INSONIFY_TRACE";

/// Way of `trace`.
#[derive(Debug, Clone, Copy, Default, PartialEq, Eq, Hash)]
pub enum TraceBy {
    /// A path by one thread.
    #[default]
    Path,
    /// A path by eight lanes of a subgroup.
    Lanes,
}

insonify_core::names::named!(TraceBy { Path = "path", Lanes = "lanes" });

/// An unknown way of `trace` in the environment.
#[derive(Debug, Error, Clone, PartialEq, Eq)]
#[error("INSONIFY_TRACE: `{found}` is no way of trace; they are {}", TraceBy::NAMES.join(", "))]
pub struct UnknownTrace {
    /// Word found.
    found: String,
}

impl FromStr for TraceBy {
    type Err = UnknownTrace;

    fn from_str(text: &str) -> Result<Self, UnknownTrace> {
        Self::named(text).ok_or_else(|| UnknownTrace { found: text.to_owned() })
    }
}

impl TraceBy {
    /// The way in the environment variable `INSONIFY_TRACE`; none if it is unset or empty.
    ///
    /// # Errors
    /// Another word than `lanes` or `path`.
    pub fn from_environment() -> Result<Option<Self>, UnknownTrace> {
        match std::env::var_os(VARIABLE) {
            Some(word) if !word.is_empty() => word.to_string_lossy().parse().map(Some),
            _ => Ok(None),
        }
    }
}

#[cfg(test)]
mod tests {
    use super::*;

    #[test]
    fn another_word_than_a_way_of_trace_is_refused() {
        assert_eq!("lanes".parse(), Ok(TraceBy::Lanes));
        assert_eq!("path".parse(), Ok(TraceBy::Path));
        let error = "host".parse::<TraceBy>().unwrap_err().to_string();
        assert_eq!(error, "INSONIFY_TRACE: `host` is no way of trace; they are path, lanes");
    }
}
