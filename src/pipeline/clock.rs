//! Clock of a session: the machine's, or a simulated one for tests.
//!
//! The pipeline waits only on a [`Signal`] through its [`Clock`], and starts all its threads by
//! [`super::shutdown::spawn`]. A [`super::SimulatedClock`] can therefore run ten minutes in a second.

use std::fmt::Debug;
use std::sync::{Condvar, Mutex, MutexGuard, PoisonError};
use std::time::{Duration, Instant};

/// No timeout: a wait until `NEVER` ends only by its signal.
pub const NEVER: Duration = Duration::MAX;

/// Locks `mutex`, even if poisoned: no thread leaves a value of the pipeline half-written.
pub(super) fn lock<T>(mutex: &Mutex<T>) -> MutexGuard<'_, T> {
    mutex.lock().unwrap_or_else(PoisonError::into_inner)
}

/// Next value of an exponential moving average of durations: `next` has the weight `weight` (0..=1). A zero `mean`
/// means that there is no average yet; the result is then `next`.
pub(super) fn smoothed(mean: Duration, next: Duration, weight: f64) -> Duration {
    if mean.is_zero() { next } else { mean.mul_f64(1.0 - weight) + next.mul_f64(weight) }
}

/// A time in ms, for logs.
pub(super) fn ms(time: Duration) -> f64 {
    time.as_secs_f64() * 1e3
}

/// Condition that threads wait for. Each notification raises its generation, so no notification is missed.
#[derive(Debug, Default)]
pub struct Signal {
    pub(super) generation: Mutex<u64>,
    pub(super) changed: Condvar,
}

impl Signal {
    /// Number of notifications so far. Read it before checking the condition, and pass it to [`Clock::wait`].
    pub fn generation(&self) -> u64 {
        *lock(&self.generation)
    }
}

/// Time source of a session, and its waits.
pub trait Clock: Debug + Send + Sync {
    /// Time since the start of the session; it never runs backward.
    fn now(&self) -> Duration;

    /// Start of the session, ns since 1970 (UTC).
    fn start_unix_ns(&self) -> u64;

    /// Waits until the generation of `signal` differs from `seen`, or until the time `until`.
    fn wait(&self, signal: &Signal, seen: u64, until: Duration);

    /// Wakes all threads that wait for `signal`.
    fn notify(&self, signal: &Signal);

    /// Registers a thread that is about to be started. Returns the thread's index, from 0.
    fn enrol(&self) -> usize;

    /// Enters the thread with the index `thread`; must be the thread's first call.
    fn enter(&self, thread: usize);

    /// Leaves the thread with the index `thread`; must be the thread's last call.
    fn leave(&self, thread: usize);

    /// Current time, ns since 1970 (UTC). Monotonic: changes of the system time during the session have no effect.
    fn unix_ns(&self) -> u64 {
        self.unix_ns_at(self.now())
    }

    /// Converts a time since the start of the session to ns since 1970 (UTC).
    fn unix_ns_at(&self, time: Duration) -> u64 {
        self.start_unix_ns().saturating_add(u64::try_from(time.as_nanos()).unwrap_or(u64::MAX))
    }

    /// Converts ns since 1970 (UTC) to a time since the start of the session; zero for times before the start.
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

/// The machine's monotonic clock. Its time 0 is the construction of this value.
#[derive(Debug)]
pub struct SystemClock {
    start: Instant,
    start_unix_ns: u64,
}

impl SystemClock {
    /// Clock of a session that begins now.
    pub fn new() -> Self {
        // Both clocks are read together: the tracker's time stamps use the clock of `start_unix_ns`.
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
