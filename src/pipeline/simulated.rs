//! A clock for tests: time passes only while every thread waits, and one thread runs at a time.

use std::cell::Cell;
use std::collections::VecDeque;
use std::sync::{Arc, Condvar, Mutex, PoisonError};
use std::time::Duration;

use super::clock::{Clock, NEVER, Signal, lock};

/// 2026-01-01 00:00 UTC, so that no test depends on the date.
const START_UNIX_NS: u64 = 1_767_225_600_000_000_000;

thread_local! {
    /// Index of this thread.
    static THREAD: Cell<Option<usize>> = const { Cell::new(None) };
}

/// Simulated time. A thread runs until it waits; then the next ready thread runs, in the order in which they became
/// ready. If none is ready, time jumps to the earliest timeout. A session on this clock is therefore deterministic,
/// independent of the machine's load.
#[derive(Debug)]
pub struct SimulatedClock {
    state: Mutex<State>,
}

#[derive(Debug)]
struct State {
    now: Duration,
    /// Index of the running thread; `None` if no thread can go on.
    turn: Option<usize>,
    waiters: Vec<Waiter>,
    ready: VecDeque<usize>,
    /// Condition variables by thread index, on which the threads wait for their turn.
    turns: Vec<Arc<Condvar>>,
}

#[derive(Debug)]
struct Waiter {
    thread: usize,
    /// Address of the signal that the thread waits for.
    signal: usize,
    until: Duration,
}

impl State {
    /// Gives the turn to the next ready thread, advancing time if necessary.
    fn pass_on(&mut self) {
        if self.ready.is_empty() {
            let earliest = self.waiters.iter().map(|w| w.until).min().filter(|until| *until < NEVER);
            if let Some(time) = earliest {
                self.now = self.now.max(time);
                self.ready_where(|w| w.until <= time);
            }
        }
        self.turn = self.ready.pop_front();
        if let Some(turn) = self.turn.and_then(|thread| self.turns.get(thread)) {
            turn.notify_one();
        }
    }

    /// Makes the waiters ready for which `can_go_on` holds, in the order in which they began to wait.
    fn ready_where(&mut self, can_go_on: impl Fn(&Waiter) -> bool) {
        let ready = &mut self.ready;
        self.waiters.retain(|waiter| {
            let goes = can_go_on(waiter);
            if goes {
                ready.push_back(waiter.thread);
            }
            !goes
        });
    }
}

impl SimulatedClock {
    /// A clock at zero, with the calling thread as its first thread.
    #[allow(clippy::new_without_default, reason = "the calling thread is bound to it")]
    pub fn new() -> Self {
        THREAD.set(Some(0));
        let state = State {
            now: Duration::ZERO,
            turn: Some(0),
            waiters: Vec::with_capacity(64),
            ready: VecDeque::with_capacity(64),
            turns: vec![Arc::new(Condvar::new())],
        };
        Self { state: Mutex::new(state) }
    }

    /// Blocks until it is the turn of `thread`.
    fn await_turn(&self, mut state: std::sync::MutexGuard<'_, State>, thread: usize) {
        let Some(turn) = state.turns.get(thread).cloned() else { return };
        while state.turn != Some(thread) {
            state = turn.wait(state).unwrap_or_else(PoisonError::into_inner);
        }
    }
}

impl Clock for SimulatedClock {
    fn now(&self) -> Duration {
        lock(&self.state).now
    }

    fn start_unix_ns(&self) -> u64 {
        START_UNIX_NS
    }

    fn wait(&self, signal: &Signal, seen: u64, until: Duration) {
        let Some(thread) = THREAD.get() else { return };
        let mut state = lock(&self.state);
        if signal.generation() != seen || state.now >= until {
            return;
        }
        state.waiters.push(Waiter { thread, signal: std::ptr::from_ref(signal).addr(), until });
        state.pass_on();
        self.await_turn(state, thread);
    }

    fn notify(&self, signal: &Signal) {
        let mut state = lock(&self.state);
        *lock(&signal.generation) += 1;
        let address = std::ptr::from_ref(signal).addr();
        state.ready_where(|waiter| waiter.signal == address);
        if state.turn.is_none() {
            state.pass_on();
        }
    }

    fn enrol(&self) -> usize {
        let mut state = lock(&self.state);
        let thread = state.turns.len();
        state.turns.push(Arc::new(Condvar::new()));
        state.ready.push_back(thread);
        if state.turn.is_none() {
            state.pass_on();
        }
        thread
    }

    fn enter(&self, thread: usize) {
        THREAD.set(Some(thread));
        self.await_turn(lock(&self.state), thread);
    }

    fn leave(&self, _: usize) {
        lock(&self.state).pass_on();
    }
}

#[cfg(test)]
mod tests {
    use super::super::shutdown::spawn;
    use super::*;

    const MS: Duration = Duration::from_millis(1);

    #[test]
    fn threads_take_turns_in_the_order_of_their_times() {
        let clock: Arc<dyn Clock> = Arc::new(SimulatedClock::new());
        let log = Arc::new(Mutex::new(Vec::new()));
        for (name, every) in [("a", 3), ("b", 2)] {
            let (clock_of, log) = (clock.clone(), log.clone());
            let _ = spawn(&clock, name, move || {
                for i in 1..=3 {
                    clock_of.sleep_until(MS * every * i);
                    lock(&log).push((name, clock_of.now()));
                }
            })
            .unwrap();
        }
        clock.sleep_until(MS * 100);
        assert_eq!(
            *lock(&log),
            [("b", MS * 2), ("a", MS * 3), ("b", MS * 4), ("a", MS * 6), ("b", MS * 6), ("a", MS * 9)]
        );
        assert_eq!(clock.now(), MS * 100);
    }

    #[test]
    fn a_signal_wakes_its_waiter_before_its_time() {
        let clock: Arc<dyn Clock> = Arc::new(SimulatedClock::new());
        let signal = Arc::new(Signal::default());
        let woken = Arc::new(Mutex::new(None));
        let (clock_of, signal_of, woken_of) = (clock.clone(), signal.clone(), woken.clone());
        let _ = spawn(&clock, "waiter", move || {
            clock_of.wait(&signal_of, signal_of.generation(), NEVER);
            *lock(&woken_of) = Some(clock_of.now());
        })
        .unwrap();
        clock.sleep_until(MS * 5);
        clock.notify(&signal);
        clock.sleep_until(MS * 6);
        assert_eq!(*lock(&woken), Some(MS * 5));
    }
}
