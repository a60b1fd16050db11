//! Order of a device's measurements by the device's counter and clock.

use super::Measurement;

/// Largest backward step of the counter at which a measurement counts as late, counts. A larger step means that the
/// device restarted.
const LATE_COUNTS: u32 = 64;

/// Largest backward step of the clock at which a measurement counts as late, µs, for a device without a counter.
const LATE_US: u64 = 1_000_000;

/// Largest forward step of the counter that counts as a gap, counts. A larger step means that the device restarted.
const GAP_LIMIT_COUNTS: u32 = 100_000;

/// Number of consecutive late measurements, ascending among themselves, that prove a restart of the device.
const CONFIRMED: u32 = 3;

/// Periods at which device clocks wrap, µs: of a microcontroller's `micros()`, and of milliseconds in 32 bits.
const CLOCK_PERIODS_US: [u64; 2] = [1 << 32, 1000 << 32];

/// Largest time step across a wrap of the clock, µs; a larger step is not taken for a wrap.
const WRAP_REACH_US: u64 = 10_000_000;

/// Position of a measurement in its stream.
#[derive(Debug, Clone, Copy, PartialEq, Eq)]
pub enum StreamPosition {
    /// The next measurement, later than all others so far.
    Next {
        /// Non-decreasing device time, in µs or counts from an unknown origin; `None` without clock and counter.
        ticks: Option<u64>,
        /// Number of measurements missing since the last one.
        missing: u32,
        /// Whether the counter rose but the clock did not.
        clock_stalled: bool,
    },
    /// First measurement of a restarted device; its time is unrelated to earlier ones.
    Restarted {
        /// Device time, as in [`StreamPosition::Next`].
        ticks: Option<u64>,
    },
    /// Repetition of the last measurement.
    Duplicate,
    /// Measured before one that arrived earlier.
    Late,
}

/// Determines the order of one device's measurements.
#[derive(Debug, Clone, Default)]
pub struct StreamOrder {
    last: Option<Stamp>,
    /// Last late measurement, and the length of the ascending run of late measurements that it ends.
    late: Option<(Stamp, u32)>,
}

#[derive(Debug, Clone, Copy)]
struct Stamp {
    sequence: Option<u32>,
    /// Counter value without wraps.
    counts: u64,
    /// Clock value as received, µs.
    clock_us: Option<u64>,
    /// Sum of the clock's periods wrapped so far, µs.
    wrapped_us: u64,
}

impl Stamp {
    fn first(measurement: &Measurement) -> Self {
        let Measurement { sequence, device_time_us: clock_us, .. } = *measurement;
        Self { sequence, counts: sequence.map_or(0, u64::from), clock_us, wrapped_us: 0 }
    }

    /// Clock value if there is one, else the counter. The clock is preferred, since it is correct at any measurement
    /// rate.
    fn ticks(&self) -> Option<u64> {
        match self.clock_us {
            Some(us) => us.checked_add(self.wrapped_us),
            None => self.sequence.map(|_| self.counts),
        }
    }
}

/// Relation of a stamp to the previous one.
enum Step {
    Forward { counts: u32, clock: Option<u64>, wrap_us: u64 },
    Same,
    Back { far: bool },
    Unknown,
}

impl StreamOrder {
    /// Position in the stream of the next measurement received.
    pub fn push(&mut self, measurement: &Measurement) -> StreamPosition {
        let mut stamp = Stamp::first(measurement);
        let Some(last) = self.last else {
            self.last = Some(stamp);
            return StreamPosition::Next { ticks: stamp.ticks(), missing: 0, clock_stalled: false };
        };
        match step(&last, &stamp) {
            Step::Forward { counts, .. } if counts > GAP_LIMIT_COUNTS => self.restart(stamp),
            Step::Forward { counts, clock, wrap_us } => {
                stamp.wrapped_us = last.wrapped_us.saturating_add(wrap_us);
                let stalled = clock == Some(0);
                stamp.counts = last.counts.saturating_add(u64::from(counts));
                let ticks = stamp.ticks().filter(|_| !stalled);
                if stalled {
                    // The clock keeps its highest value so far, with which later measurements are compared.
                    stamp.clock_us = last.clock_us;
                }
                self.last = Some(stamp);
                self.late = None;
                StreamPosition::Next { ticks, missing: counts.saturating_sub(1), clock_stalled: stalled }
            }
            Step::Same => StreamPosition::Duplicate,
            Step::Back { far: true } => self.restart(stamp),
            Step::Back { far: false } => {
                let run = match &self.late {
                    Some((late, run)) if matches!(step(late, &stamp), Step::Forward { .. }) => run + 1,
                    _ => 1,
                };
                if run >= CONFIRMED {
                    return self.restart(stamp);
                }
                self.late = Some((stamp, run));
                StreamPosition::Late
            }
            Step::Unknown => {
                self.last = Some(stamp);
                StreamPosition::Next { ticks: None, missing: 0, clock_stalled: false }
            }
        }
    }

    fn restart(&mut self, stamp: Stamp) -> StreamPosition {
        self.last = Some(stamp);
        self.late = None;
        StreamPosition::Restarted { ticks: stamp.ticks() }
    }
}

fn step(last: &Stamp, next: &Stamp) -> Step {
    let clock = match (last.clock_us, next.clock_us) {
        (Some(a), Some(b)) => Some(clock_step(a, b)),
        _ => None,
    };
    let counts = match (last.sequence, next.sequence) {
        (Some(a), Some(b)) => Some(b.wrapping_sub(a)),
        _ => None,
    };
    match (counts, clock) {
        // A constant counter with a running clock is a broken counter, not a repetition.
        (Some(0) | None, Some(ClockStep::Forward { us, wrap_us })) => {
            Step::Forward { counts: 1, clock: Some(us), wrap_us }
        }
        (Some(0), _) | (None, Some(ClockStep::Same)) => Step::Same,
        (Some(counts), _) if counts > u32::MAX / 2 => Step::Back { far: counts.wrapping_neg() > LATE_COUNTS },
        // Decoders extend counters that wrap below 32 bits; here such a wrap would look like a restart.
        (Some(counts), Some(ClockStep::Forward { us, wrap_us })) => Step::Forward { counts, clock: Some(us), wrap_us },
        (Some(_), Some(ClockStep::Back { us })) if us > LATE_US => Step::Back { far: true },
        (Some(counts), Some(_)) => Step::Forward { counts, clock: Some(0), wrap_us: 0 },
        (Some(counts), None) => Step::Forward { counts, clock: None, wrap_us: 0 },
        (None, Some(ClockStep::Back { us })) => Step::Back { far: us > LATE_US },
        (None, None) => Step::Unknown,
    }
}

enum ClockStep {
    Forward { us: u64, wrap_us: u64 },
    Same,
    Back { us: u64 },
}

fn clock_step(last_us: u64, next_us: u64) -> ClockStep {
    if next_us > last_us {
        return ClockStep::Forward { us: next_us - last_us, wrap_us: 0 };
    }
    let back_us = last_us - next_us;
    let wrap = CLOCK_PERIODS_US.into_iter().find(|&period| {
        last_us < period && period.checked_sub(back_us).is_some_and(|forward| forward <= WRAP_REACH_US)
    });
    match wrap {
        Some(period) => ClockStep::Forward { us: period - back_us, wrap_us: period },
        None if back_us == 0 => ClockStep::Same,
        None => ClockStep::Back { us: back_us },
    }
}

#[cfg(test)]
mod tests {
    use super::*;
    use crate::pose::Reading;

    fn positions(stamps: &[(Option<u32>, Option<u64>)]) -> Vec<StreamPosition> {
        let mut order = StreamOrder::default();
        let measurement = |&(sequence, device_time_us)| Measurement {
            host_time_ns: 0,
            device_time_us,
            sequence,
            reading: Reading::OutOfView,
        };
        stamps.iter().map(|stamp| order.push(&measurement(stamp))).collect()
    }

    fn by_count(counts: &[u32]) -> Vec<StreamPosition> {
        positions(&counts.iter().map(|c| (Some(*c), None)).collect::<Vec<_>>())
    }

    fn by_clock(times: &[u64]) -> Vec<StreamPosition> {
        positions(&times.iter().map(|t| (None, Some(*t))).collect::<Vec<_>>())
    }

    fn next(ticks: u64, missing: u32) -> StreamPosition {
        StreamPosition::Next { ticks: Some(ticks), missing, clock_stalled: false }
    }

    #[test]
    fn gaps_repetitions_and_late_measurements_are_distinguished() {
        let found = by_count(&[7, 8, 8, 12, 10, 11, 13]);
        let late = StreamPosition::Late;
        assert_eq!(found, [next(7, 0), next(8, 0), StreamPosition::Duplicate, next(12, 3), late, late, next(13, 0)]);
        let found = by_clock(&[70, 80, 80, 120, 100, 130]);
        assert_eq!(found, [next(70, 0), next(80, 0), StreamPosition::Duplicate, next(120, 0), late, next(130, 0)]);
    }

    #[test]
    fn a_restart_is_detected_after_short_and_long_runs() {
        assert_eq!(by_count(&[5000, 0])[1], StreamPosition::Restarted { ticks: Some(0) });
        assert_eq!(by_clock(&[5_000_000, 3])[1], StreamPosition::Restarted { ticks: Some(3) });
        let near = by_count(&[10, 0, 1, 2, 3]);
        assert_eq!(
            near[1..],
            [StreamPosition::Late, StreamPosition::Late, StreamPosition::Restarted { ticks: Some(2) }, next(3, 0)]
        );
        assert_eq!(by_count(&[3, 4_000_000])[1], StreamPosition::Restarted { ticks: Some(4_000_000) });
    }

    #[test]
    fn counters_and_clocks_wrap() {
        assert_eq!(by_count(&[u32::MAX, 0, 1])[1..], [next(1 << 32, 0), next((1 << 32) + 1, 0)]);
        let (micros, millis) = (1_u64 << 32, 1000_u64 << 32);
        assert_eq!(by_clock(&[micros - 10, 20, 40])[1..], [next(micros + 20, 0), next(micros + 40, 0)]);
        assert_eq!(by_clock(&[millis - 1000, 3000])[1], next(millis + 3000, 0));
        assert_eq!(by_clock(&[micros - 10, 20, micros - 5, 6])[3], next(2 * micros + 6, 0));
    }

    #[test]
    fn a_broken_clock_or_counter_leaves_the_other_usable() {
        let stalled = StreamPosition::Next { ticks: None, missing: 0, clock_stalled: true };
        let found = positions(&[(Some(1), Some(50)), (Some(2), Some(50)), (Some(3), Some(50)), (Some(4), Some(90))]);
        assert_eq!(found[1..], [stalled, stalled, next(90, 0)]);
        let found = positions(&[(Some(0), Some(50)), (Some(0), Some(60)), (Some(0), Some(60))]);
        assert_eq!(found[1..], [next(60, 0), StreamPosition::Duplicate]);
        let none = StreamPosition::Next { ticks: None, missing: 0, clock_stalled: false };
        assert_eq!(positions(&[(None, None), (None, None)]), [none, none]);
    }
}
