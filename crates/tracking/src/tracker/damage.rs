//! Report of a stream's damaged pieces.

use std::fmt;
use std::time::Duration;

use insonify_core::names::counted;

use super::DecodeError;

/// Damaged pieces since the last report.
#[derive(Debug, Clone, PartialEq)]
pub struct Damage {
    /// Number of pieces that are not a record.
    pub damaged: u64,
    /// Number of errors reported by the device, and of requests that it did not answer.
    pub reported: u64,
    /// Number of records of all sensors in the same time.
    pub records: u64,
    /// Time since the last report.
    pub time: Duration,
    /// The last damaged piece or reported error.
    pub example: DecodeError,
    /// Likely cause and remedy, if known.
    pub remedy: Option<String>,
}

impl fmt::Display for Damage {
    fn fmt(&self, f: &mut fmt::Formatter<'_>) -> fmt::Result {
        let Self { damaged, reported, records, time, example, remedy } = self;
        let what = match (*damaged, *reported) {
            (0, reported) => counted(reported as usize, "error report"),
            (damaged, _) => counted(damaged as usize, "damaged piece"),
        };
        let records = counted(*records as usize, "record");
        write!(f, "{what} and {records} in {:.1} s; the last: {example}", time.as_secs_f64())?;
        remedy.as_ref().map_or(Ok(()), |remedy| write!(f, "; {remedy}"))
    }
}
