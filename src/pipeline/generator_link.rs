//! Generator state shared with the other stages: current run, predicted duration and required inputs.

use std::collections::VecDeque;
use std::sync::Mutex;
use std::time::Duration;

use super::clock::{Clock, Signal, lock, smoothed};
use super::parts::{FrameGenerators, Terminator};
use super::summary::GeneratorSummary;
use crate::render::ComputeDevice;

/// Time after the request to terminate a run, after which a run that continues is given up.
const GIVE_UP: Duration = Duration::from_secs(1);

/// Weight of the latest run in the estimated duration.
const WEIGHT: f64 = 0.2;

/// Factor by which the estimated undisturbed duration may grow per run. The estimate adapts to a slower generator
/// within a dozen runs.
const FORGET: f64 = 1.0625;

/// Number of consecutive frames without a wait after which the next frame always waits. Otherwise frames disturb every
/// run, and the estimated duration never falls.
const TRY_AGAIN: u32 = 16;

/// Capacity of [`GeneratorState::runs`].
const RUNS_WAITING: usize = 16;

/// Outcome of a generator run.
#[derive(Debug, Clone, PartialEq, Eq)]
pub(super) enum RunEnd {
    /// The run produced a picture.
    Done,
    /// The run was terminated because it took too long.
    Terminated,
    /// The run failed, for this reason.
    Failed(String),
}

/// A generator run that ended.
#[derive(Debug, Clone, PartialEq, Eq)]
pub(super) struct Run {
    /// Index of the generator.
    pub(super) generator: usize,
    /// Duration of the run.
    pub(super) took: Duration,
    pub(super) end: RunEnd,
}

/// Watchdog state of a generator run.
#[derive(Debug, Clone, Copy, PartialEq, Eq, Default)]
enum Hang {
    /// Within the time limit.
    #[default]
    No,
    /// Termination was requested at this time, but the run has not ended.
    Told(Duration),
    /// The run does not respond, and no stage waits for it any more. If it returns after all, the generator resumes.
    GivenUp,
}

/// Generator state while it runs, as seen by the other stages.
#[derive(Debug, Default)]
pub(super) struct GeneratorState {
    /// Number of the last frame handed to the generator; `None` once the generator is done with it.
    given: Option<u64>,
    /// Number of the frame being translated, and the start time of its run; `None` between runs.
    busy: Option<(u64, Duration)>,
    /// Expected duration of a run, a moving average; zero before the first run.
    estimate: Duration,
    /// Duration of an undisturbed run: the fastest of recent runs; zero before the first.
    undisturbed: Duration,
    /// Number of consecutive frames that did not wait for the generator.
    passed_over: u32,
    /// Watchdog state of the current run.
    hang: Hang,
    /// Finished generator runs that the controller of operating points has not read yet, oldest first.
    runs: VecDeque<Run>,
    pub(super) counts: GeneratorSummary,
}

impl GeneratorState {
    /// Updates the estimates with the duration of a run.
    pub(super) fn took(&mut self, time: Duration) {
        self.estimate = smoothed(self.estimate, time, WEIGHT);
        // A disturbed run must not raise this estimate: frames would stop waiting for the generator.
        self.undisturbed = match self.undisturbed {
            Duration::ZERO => time,
            least => time.min(least.mul_f64(FORGET)),
        };
    }

    /// Queues a run for the controller. A full queue drops its oldest run.
    pub(super) fn report(&mut self, run: Run) {
        if self.runs.len() == RUNS_WAITING {
            self.runs.pop_front();
        }
        self.runs.push_back(run);
    }

    /// Whether a frame waits for the generator, until the time `until` at the latest. Updates `passed_over`.
    fn takes_a_turn(&mut self, now: Duration, until: Duration) -> bool {
        let Some(end) = self.busy_until(now) else { return false };
        let waits = end <= until || self.passed_over >= TRY_AGAIN;
        self.passed_over = if waits { 0 } else { self.passed_over + 1 };
        waits
    }

    /// Predicted completion time of the queued work if nothing disturbs it. `Duration::MAX` if a run is overdue;
    /// `None` if the generator is idle or hangs.
    fn busy_until(&self, now: Duration) -> Option<Duration> {
        let given = self.given.filter(|_| self.hang == Hang::No)?;
        let run = self.undisturbed;
        let Some((busy, started)) = self.busy else { return Some(now + run) };
        let overdue = !run.is_zero() && now > started + 2 * run;
        let end = if overdue { Duration::MAX } else { now.max(started + run) };
        Some(if busy == given { end } else { end.saturating_add(run) })
    }
}

/// Link to the generator, shared by the stages.
pub(super) struct GeneratorLink {
    pub(super) state: Mutex<GeneratorState>,
    terminator: Option<Terminator>,
    hang: Duration,
    /// Device that runs the generator; frames may be rendered on it, too.
    compute_device: ComputeDevice,
    /// Notified after each frame that the generator translated or skipped.
    done: Signal,
    /// Whether each generator reads the frames' segmentation and attenuation, by the generator's index.
    reads_maps: Vec<bool>,
}

impl GeneratorLink {
    pub(super) fn new(generators: &dyn FrameGenerators, hang: Duration) -> Self {
        Self {
            state: Mutex::default(),
            terminator: generators.terminator(),
            hang,
            compute_device: generators.compute_device(),
            done: Signal::default(),
            reads_maps: (0..generators.count()).map(|generator| generators.reads_maps(generator)).collect(),
        }
    }

    /// Whether a generator reads the frames' segmentation and attenuation.
    pub(super) fn reads_maps(&self, generator: usize) -> bool {
        self.reads_maps.get(generator).is_some_and(|reads| *reads)
    }

    /// Takes the oldest run that the controller has not read; `None` if it has read them all.
    pub(super) fn next_run(&self) -> Option<Run> {
        lock(&self.state).runs.pop_front()
    }

    /// Records that frame `number` is about to be handed to the generator.
    pub(super) fn give(&self, number: u64) {
        lock(&self.state).given = Some(number);
    }

    /// Whether a renderer on `device` must take turns with the generator, because both use the same device.
    pub(super) fn takes_turns_with(&self, device: ComputeDevice) -> bool {
        self.compute_device.shares_with(device)
    }

    /// Waits for the generator to finish its queued work, until the time `until` at the latest. Waits only if the
    /// generator should finish by then, or if too many frames in a row have not waited. Returns whether it waited.
    pub(super) fn wait_for_turn(&self, clock: &dyn Clock, until: Duration) -> bool {
        let (seen, now) = (self.done.generation(), clock.now());
        let waits = now < until && lock(&self.state).takes_a_turn(now, until);
        if waits {
            clock.wait(&self.done, seen, until);
        }
        waits
    }

    /// Records the start of a run on frame `number`.
    pub(super) fn begin(&self, number: u64, now: Duration) {
        let mut state = lock(&self.state);
        (state.busy, state.hang) = (Some((number, now)), Hang::No);
    }

    /// Records the end of the run. Returns whether the run had been given up.
    pub(super) fn end(&self) -> bool {
        let mut state = lock(&self.state);
        state.busy = None;
        std::mem::take(&mut state.hang) == Hang::GivenUp
    }

    /// Records that frame `number` was translated or skipped.
    pub(super) fn done_with(&self, number: u64, clock: &dyn Clock) {
        {
            let mut state = lock(&self.state);
            state.given = state.given.filter(|given| *given != number);
        }
        clock.notify(&self.done);
    }

    /// Predicted time at which the generated picture of frame `number` is ready. `None` if the frame is not queued,
    /// before the first run, or while a run hangs.
    pub(super) fn expected(&self, number: u64, now: Duration) -> Option<Duration> {
        let state = lock(&self.state);
        // Neither a hanging run nor the run after it has a predictable end.
        if state.estimate.is_zero() || state.hang != Hang::No {
            return None;
        }
        match state.busy {
            Some((busy, started)) if busy == number => Some(now.max(started + state.estimate)),
            Some((busy, started)) if busy < number => Some(now.max(started + state.estimate) + state.estimate),
            Some(_) => None,
            None => (state.given == Some(number)).then_some(now + state.estimate),
        }
    }

    /// Time of the next watchdog check of the current run; none if idle or given up.
    pub(super) fn hangs_at(&self) -> Option<Duration> {
        let state = lock(&self.state);
        let (_, started) = state.busy?;
        match state.hang {
            Hang::No => Some(started.saturating_add(self.hang)),
            Hang::Told(at) => Some(at.saturating_add(GIVE_UP)),
            Hang::GivenUp => None,
        }
    }

    /// Requests the end of a run that takes too long, and later gives the run up if it does not end. Returns a message
    /// for either step.
    pub(super) fn watch(&self, now: Duration) -> Option<String> {
        let mut state = lock(&self.state);
        let (number, started) = state.busy?;
        let after_s = now.saturating_sub(started).as_secs_f64();
        match state.hang {
            Hang::No if now >= started.saturating_add(self.hang) => {
                state.hang = Hang::Told(now);
                state.counts.hung += 1;
                drop(state);
                let did = match &self.terminator {
                    Some(terminate) => {
                        terminate();
                        "and is told to end"
                    }
                    None => "and its provider cannot end it",
                };
                Some(format!("the generator hangs on frame {number} for {after_s:.1} s {did}; raw frames are shown"))
            }
            Hang::Told(at) if now >= at.saturating_add(GIVE_UP) => {
                state.hang = Hang::GivenUp;
                state.counts.given_up += 1;
                Some(format!(
                    "the generator does not come back from frame {number} after {after_s:.1} s and is given up; raw frames are shown"
                ))
            }
            _ => None,
        }
    }

    /// Terminates the current run at the end of the session.
    pub(super) fn terminate(&self) {
        if lock(&self.state).busy.is_some()
            && let Some(terminate) = &self.terminator
        {
            terminate();
        }
    }
}

#[cfg(test)]
mod tests {
    use super::*;

    const fn ms(n: u64) -> Duration {
        Duration::from_millis(n)
    }

    /// State during a run on frame 1 that began at `started`, after `runs` of these durations, ms.
    fn at_work(started: u64, runs: &[u64]) -> GeneratorState {
        let mut state = GeneratorState { given: Some(1), busy: Some((1, ms(started))), ..GeneratorState::default() };
        runs.iter().for_each(|run| state.took(ms(*run)));
        state
    }

    #[test]
    fn a_frame_waits_for_a_run_that_is_about_to_end() {
        assert!(at_work(0, &[40]).takes_a_turn(ms(10), ms(50)));
        assert!(!at_work(0, &[40]).takes_a_turn(ms(10), ms(30)));
        // One run is in progress and another frame is queued.
        let two = |until| GeneratorState { given: Some(2), ..at_work(0, &[40]) }.takes_a_turn(ms(10), ms(until));
        assert!(two(80) && !two(79));
        assert!(!GeneratorState { given: None, busy: None, ..at_work(0, &[40]) }.takes_a_turn(ms(10), ms(50)));
    }

    #[test]
    fn no_frame_waits_for_a_run_that_is_overdue() {
        assert!(at_work(0, &[40]).takes_a_turn(ms(79), ms(100)));
        assert!(!at_work(0, &[40]).takes_a_turn(ms(81), ms(100)));
    }

    #[test]
    fn runs_that_were_always_disturbed_get_a_turn_now_and_then() {
        let mut state = at_work(0, &[300; 10]);
        let waited: Vec<bool> = (0..34).map(|_| state.takes_a_turn(ms(10), ms(75))).collect();
        assert_eq!(waited.iter().filter(|w| **w).count(), 2);
        assert!(waited[16] && waited[33]);
        // An undisturbed run lowers the estimate again.
        state.took(ms(40));
        assert!(state.takes_a_turn(ms(10), ms(75)));
    }
}
