//! Ways in which a device runs the pass `trace`.

use std::str::FromStr;

use insonify_core::names::word_in_environment;
use thiserror::Error;

/// Environment variable that chooses the way.
const VARIABLE: &str = "INSONIFY_TRACE";

/// How a device runs the pass `trace`.
#[derive(Debug, Clone, Copy, Default, PartialEq, Eq, Hash)]
pub enum TraceBy {
    /// One thread follows a path.
    #[default]
    Path,
    /// Eight lanes of a subgroup follow a path together.
    Lanes,
}

insonify_core::names::named!(TraceBy { Path = "path", Lanes = "lanes" });

/// Error: an unknown value of `INSONIFY_TRACE`.
#[derive(Debug, Error, Clone, PartialEq, Eq)]
#[error("INSONIFY_TRACE: `{found}` is no way of trace; they are {}", TraceBy::NAMES.join(", "))]
pub struct UnknownTrace {
    /// The value that was found.
    found: String,
}

impl FromStr for TraceBy {
    type Err = UnknownTrace;

    fn from_str(text: &str) -> Result<Self, UnknownTrace> {
        Self::named(text).ok_or_else(|| UnknownTrace { found: text.to_owned() })
    }
}

impl TraceBy {
    /// Reads the environment variable `INSONIFY_TRACE`; `None` if it is unset or empty.
    ///
    /// # Errors
    /// A word other than `lanes` or `path`.
    pub fn from_environment() -> Result<Option<Self>, UnknownTrace> {
        word_in_environment(VARIABLE).map(|word| word.parse()).transpose()
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
