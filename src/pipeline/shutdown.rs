//! Shutdown of a session: one stop request, then each thread is joined in turn, with a bounded wait.

use std::io;
use std::sync::atomic::{AtomicBool, Ordering};
use std::sync::{Arc, Mutex};
use std::thread::JoinHandle;
use std::time::Duration;

use super::clock::{Clock, Signal, lock};

/// Stop request of a session; clones share it.
#[derive(Debug, Clone)]
pub struct Stop {
    clock: Arc<dyn Clock>,
    inner: Arc<Inner>,
}

#[derive(Debug, Default)]
struct Inner {
    requested: AtomicBool,
    /// Time and reason of the first request.
    first: Mutex<Option<(Duration, String)>>,
    signal: Signal,
}

impl Stop {
    /// The stop request of a session on `clock`, not yet made.
    pub fn new(clock: &Arc<dyn Clock>) -> Self {
        Self { clock: clock.clone(), inner: Arc::default() }
    }

    /// Requests the end of the session; the first reason is kept.
    pub fn request(&self, reason: &str) {
        lock(&self.inner.first).get_or_insert_with(|| (self.clock.now(), reason.to_owned()));
        self.inner.requested.store(true, Ordering::Release);
        self.clock.notify(&self.inner.signal);
    }

    /// Whether a stop was requested.
    pub fn is_requested(&self) -> bool {
        self.inner.requested.load(Ordering::Acquire)
    }

    /// Reason of the request; none before one.
    pub fn reason(&self) -> Option<String> {
        lock(&self.inner.first).as_ref().map(|(_, reason)| reason.clone())
    }

    /// Time of the request; none before one.
    pub fn requested_at(&self) -> Option<Duration> {
        lock(&self.inner.first).as_ref().map(|(time, _)| *time)
    }

    /// Waits for the request, `until` at the latest. Returns whether a stop was requested.
    pub fn wait(&self, until: Duration) -> bool {
        while !self.is_requested() && self.clock.now() < until {
            let seen = self.inner.signal.generation();
            if !self.is_requested() {
                self.clock.wait(&self.inner.signal, seen, until);
            }
        }
        self.is_requested()
    }
}

/// A part of a session with a thread of its own, for example a tracker or a recorder.
pub trait Part: Send {
    /// Name in messages.
    fn name(&self) -> &str;

    /// Requests the part's end, without waiting.
    fn stop(&mut self);

    /// Whether the part's thread has ended. Polled every few ms.
    fn has_ended(&mut self) -> bool;
}

/// A running thread.
#[derive(Debug)]
pub struct Thread<T> {
    name: String,
    clock: Arc<dyn Clock>,
    ended: Arc<Ended>,
    handle: JoinHandle<T>,
}

#[derive(Debug, Default)]
struct Ended {
    ended: AtomicBool,
    signal: Signal,
}

/// Reports the thread's end to the clock when dropped, also after a panic.
struct AtEnd {
    clock: Arc<dyn Clock>,
    ended: Arc<Ended>,
    index: usize,
}

impl Drop for AtEnd {
    fn drop(&mut self) {
        self.ended.ended.store(true, Ordering::Release);
        self.clock.notify(&self.ended.signal);
        self.clock.leave(self.index);
    }
}

/// Outcome of joining a thread.
#[derive(Debug)]
pub enum Joined<T> {
    /// The thread's result.
    Done(T),
    /// The thread panicked.
    Panicked,
    /// The thread did not end in time; it is detached.
    Stuck,
}

impl<T> Thread<T> {
    /// Name of the thread.
    pub fn name(&self) -> &str {
        &self.name
    }

    /// Waits for the thread to end, `until` at the latest.
    pub fn join(self, until: Duration) -> Joined<T> {
        loop {
            let seen = self.ended.signal.generation();
            if self.ended.ended.load(Ordering::Acquire) {
                return self.handle.join().map_or(Joined::Panicked, Joined::Done);
            }
            if self.clock.now() >= until {
                return Joined::Stuck;
            }
            self.clock.wait(&self.ended.signal, seen, until);
        }
    }
}

/// Starts a thread that waits through `clock`.
///
/// # Errors
/// The system cannot start another thread.
pub fn spawn<T: Send + 'static>(
    clock: &Arc<dyn Clock>,
    name: &str,
    work: impl FnOnce() -> T + Send + 'static,
) -> io::Result<Thread<T>> {
    let index = clock.enrol();
    let ended = Arc::<Ended>::default();
    let at_end = AtEnd { clock: clock.clone(), ended: ended.clone(), index };
    let started = std::thread::Builder::new().name(name.to_owned()).spawn(move || {
        let at_end = at_end;
        at_end.clock.enter(index);
        work()
    });
    Ok(Thread { name: name.to_owned(), clock: clock.clone(), ended, handle: started? })
}

#[cfg(test)]
mod tests {
    use super::super::clock::NEVER;
    use super::super::simulated::SimulatedClock;
    use super::*;

    const SECOND: Duration = Duration::from_secs(1);

    fn clock() -> Arc<dyn Clock> {
        Arc::new(SimulatedClock::new())
    }

    #[test]
    fn a_thread_that_ends_is_joined_and_one_that_hangs_is_left() {
        let clock = clock();
        let (a, b) = (clock.clone(), clock.clone());
        let quick = spawn(&clock, "quick", move || {
            a.sleep_until(SECOND);
            7
        });
        let hangs = spawn(&clock, "hangs", move || b.sleep_until(NEVER));
        assert!(matches!(quick.unwrap().join(2 * SECOND), Joined::Done(7)));
        assert_eq!(clock.now(), SECOND);
        assert!(matches!(hangs.unwrap().join(3 * SECOND), Joined::Stuck));
        assert_eq!(clock.now(), 3 * SECOND);
    }

    #[test]
    fn a_thread_that_panics_is_known_to() {
        let clock = clock();
        let thread = spawn(&clock, "panics", || std::panic::resume_unwind(Box::new(())));
        assert!(matches!(thread.unwrap().join(SECOND), Joined::<()>::Panicked));
    }

    #[test]
    fn the_first_reason_to_stop_counts() {
        let clock = clock();
        let stop = Stop::new(&clock);
        assert!(!stop.wait(SECOND));
        stop.clone().request("first");
        stop.request("second");
        assert!(stop.wait(NEVER));
        assert_eq!(stop.reason().as_deref(), Some("first"));
    }
}
