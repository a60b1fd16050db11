//! The time of a session: the machine's, or one that a test simulates.
//!
//! Whatever waits in the pipeline waits on a [`Signal`] through its [`Clock`], and every thread of it is started by
//! [`super::shutdown::spawn`]. That is what lets a [`super::SimulatedClock`] run ten minutes in a second.

use std::fmt::Debug;
use std::sync::{Condvar, Mutex, MutexGuard, PoisonError};
use std::time::{Duration, Instant};

/// A time that never comes: waits for a signal alone.
pub const NEVER: Duration = Duration::MAX;

/// Locks, whatever a thread that panicked left: every value behind a lock of the pipeline is whole at each moment.
pub(super) fn lock<T>(mutex: &Mutex<T>) -> MutexGuard<'_, T> {
    mutex.lock().unwrap_or_else(PoisonError::into_inner)
}

/// Running mean of times after the next one, which has this weight; the first one itself.
pub(super) fn smoothed(mean: Duration, next: Duration, weight: f64) -> Duration {
    if mean.is_zero() { next } else { mean.mul_f64(1.0 - weight) + next.mul_f64(weight) }
}

/// A time in ms, for logs.
pub(super) fn ms(time: Duration) -> f64 {
    time.as_secs_f64() * 1e3
}

/// Something that threads wait for. Each notification raises its generation, so that none is missed.
#[derive(Debug, Default)]
pub struct Signal {
    pub(super) generation: Mutex<u64>,
    pub(super) changed: Condvar,
}

impl Signal {
    /// Notifications so far: read it before looking at what the signal is about, and give it to [`Clock::wait`].
    pub fn generation(&self) -> u64 {
        *lock(&self.generation)
    }
}

/// Tells the time and waits.
pub trait Clock: Debug + Send + Sync {
    /// Time since the session began; it never runs backward.
    fn now(&self) -> Duration;

    /// When the session began, ns since 1970 (UTC).
    fn start_unix_ns(&self) -> u64;

    /// Waits until `signal` has another generation than `seen`, or until the time `until`.
    fn wait(&self, signal: &Signal, seen: u64, until: Duration);

    /// Wakes whatever waits for `signal`.
    fn notify(&self, signal: &Signal);

    /// Takes a place for a thread that is about to be started.
    fn enrol(&self) -> usize;

    /// The first thing that the thread of place `place` does.
    fn enter(&self, place: usize);

    /// The last thing that it does.
    fn leave(&self, place: usize);

    /// The present, ns since 1970 (UTC): a steady clock, whatever becomes of the machine's calendar meanwhile.
    fn unix_ns(&self) -> u64 {
        self.unix_ns_at(self.now())
    }

    /// A time of the session, ns since 1970 (UTC).
    fn unix_ns_at(&self, time: Duration) -> u64 {
        self.start_unix_ns().saturating_add(u64::try_from(time.as_nanos()).unwrap_or(u64::MAX))
    }

    /// A time in ns since 1970 (UTC) as one of the session; before its start, its start.
    fn since_start(&self, unix_ns: u64) -> Duration {
        Duration::from_nanos(unix_ns.saturating_sub(self.start_unix_ns()))
    }

    /// Waits until the time `until`.
    fn sleep_until(&self, until: Duration) {
        let never = Signal::default();
        while self.now() < until {
            self.wait(&never, 0, until);
        }
    }
}

/// The machine's monotonic clock, from the moment at which this is made.
#[derive(Debug)]
pub struct SystemClock {
    start: Instant,
    start_unix_ns: u64,
}

impl SystemClock {
    /// A session that begins now.
    pub fn new() -> Self {
        // The clock that the tracker's bytes are stamped by.
        Self { start_unix_ns: crate::tracker::host_time_ns(), start: Instant::now() }
    }
}

impl Default for SystemClock {
    fn default() -> Self {
        Self::new()
    }
}

impl Clock for SystemClock {
    fn now(&self) -> Duration {
        self.start.elapsed()
    }

    fn start_unix_ns(&self) -> u64 {
        self.start_unix_ns
    }

    fn wait(&self, signal: &Signal, seen: u64, until: Duration) {
        let mut generation = lock(&signal.generation);
        while *generation == seen {
            let left = until.saturating_sub(self.now());
            if left.is_zero() {
                return;
            }
            let waited = signal.changed.wait_timeout(generation, left);
            generation = waited.unwrap_or_else(PoisonError::into_inner).0;
        }
    }

    fn notify(&self, signal: &Signal) {
        *lock(&signal.generation) += 1;
        signal.changed.notify_all();
    }

    fn enrol(&self) -> usize {
        0
    }

    fn enter(&self, _: usize) {}

    fn leave(&self, _: usize) {}
}

#[cfg(test)]
mod tests {
    use super::*;

    #[test]
    fn a_signal_given_before_the_wait_is_not_missed() {
        let (clock, signal) = (SystemClock::new(), Signal::default());
        let seen = signal.generation();
        clock.notify(&signal);
        clock.wait(&signal, seen, NEVER);
        assert_ne!(signal.generation(), seen);
    }

    #[test]
    fn a_wait_ends_at_its_time() {
        let (clock, signal) = (SystemClock::new(), Signal::default());
        let until = clock.now() + Duration::from_millis(2);
        clock.wait(&signal, signal.generation(), until);
        assert!(clock.now() >= until);
        clock.wait(&signal, signal.generation(), Duration::ZERO);
    }

    #[test]
    fn times_of_the_calendar_are_times_of_the_session() {
        let clock = SystemClock::new();
        let time = Duration::from_millis(1234);
        assert_eq!(clock.since_start(clock.unix_ns_at(time)), time);
        assert_eq!(clock.since_start(0), Duration::ZERO);
    }
}
