//! Irregularities in a stream of records, with their texts.

use std::fmt;

/// A sign that a stream does not come from one device with a steady clock.
#[derive(Debug, Clone, Copy, PartialEq)]
#[non_exhaustive]
pub enum Irregularity {
    /// The counter or clock restarted.
    Restarted {
        /// Step back of the device's clock, s; `None` without a clock.
        back_s: Option<f64>,
    },
    /// The device's clock jumped ahead.
    Leapt {
        /// Jump beyond the elapsed time, s.
        ahead_s: f64,
    },
    /// The counter or clock repeatedly goes back.
    Interleaved {
        /// Number of backward steps.
        times: u32,
        /// Time in which these steps occurred, s.
        seconds: f64,
    },
    /// The device's clock stands still while its counter rises.
    ClockStands,
    /// The device's counter stands still.
    CounterStands,
    /// Many positions are farther from the previous ones than a hand can move.
    Alternating {
        /// Number of positions out of reach.
        far: u32,
        /// Number of all positions.
        of: u32,
        /// Largest distance, mm.
        distance_mm: f64,
    },
}

impl fmt::Display for Irregularity {
    fn fmt(&self, f: &mut fmt::Formatter<'_>) -> fmt::Result {
        match self {
            Self::Restarted { back_s: Some(back_s) } => {
                write!(f, "the tracker's clock went back by {back_s:.1} s: it was restarted, or its clock was set")
            }
            Self::Restarted { back_s: None } => write!(f, "the tracker's counter began anew: it was restarted"),
            Self::Leapt { ahead_s } => {
                write!(f, "the tracker's clock jumped ahead by {ahead_s:.1} s: was it set while the session runs?")
            }
            Self::Interleaved { times, seconds } => write!(
                f,
                "the tracker's counter or clock went back {times} times in {seconds:.1} s: two devices or sensors share this \
                 stream, or the device restarts again and again; give each device a port of its own"
            ),
            Self::ClockStands => {
                write!(f, "the tracker's clock stands still while its counter rises; arrival times are used instead")
            }
            Self::CounterStands => {
                write!(
                    f,
                    "the tracker's counter (`seq`) stands still: lost records can't be counted; it must rise by one a record"
                )
            }
            Self::Alternating { far, of, distance_mm } => write!(
                f,
                "{far} of {of} positions are farther from the ones before (up to {distance_mm:.0} mm) than a hand moves: two \
                 sensors share this stream, or something disturbs the tracker"
            ),
        }
    }
}
