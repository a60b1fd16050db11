//! Which of several generators runs: the best that keeps the budget. Pure: the caller brings the time.

use std::time::Duration;

use super::budget::{Budget, RunTimes};

/// Failed runs in a row after which a tier is given up.
const FAILURES: u32 = 3;

/// How a run ended.
#[derive(Debug, Clone, PartialEq, Eq)]
pub enum Outcome {
    /// With an image.
    Done,
    /// It was stopped.
    Stopped,
    /// With an error, in words.
    Failed(String),
}

/// What must be done about a run that takes too long.
#[derive(Debug, Clone, Copy, PartialEq, Eq)]
pub enum Intervention {
    /// Stop the run of this tier by its [`Terminator`](super::Terminator).
    Stop(usize),
    /// The run of this tier does not end: leave its thread and its generator to themselves.
    Abandon(usize),
}

/// A change of tier; none stands for the rendered image.
#[derive(Debug, Clone, PartialEq, Eq)]
pub struct Change {
    /// Tier before.
    pub from: Option<usize>,
    /// Tier from now on.
    pub to: Option<usize>,
    /// Why, in words.
    pub reason: String,
}

/// Whether a tier can run.
#[derive(Debug, Clone, PartialEq, Eq)]
pub enum TierState {
    /// It keeps the budget, as far as is known.
    Ready,
    /// It did not keep the budget; it is tried again after this time.
    OverBudget {
        /// Session time.
        retry_at: Duration,
    },
    /// Its fastest run is over the budget: it is never started.
    TooSlow,
    /// It failed again and again, the last time for this reason.
    Failed(String),
    /// A run of it does not end.
    Abandoned,
}

/// What a tier did.
#[derive(Debug, Clone, PartialEq)]
pub struct TierReport {
    /// Its generator's name.
    pub name: String,
    /// Whether it can run.
    pub state: TierState,
    /// Runs that gave an image.
    pub runs: u64,
    /// Runs over the budget, stopped ones among them.
    pub overshoots: u64,
    /// Runs that were stopped.
    pub stopped: u64,
    /// Runs that failed.
    pub failures: u64,
    /// Half of the latest runs took at most this long.
    pub p50: Option<Duration>,
    /// 95 of 100 of the latest runs took at most this long.
    pub p95: Option<Duration>,
}

/// A run that has begun.
#[derive(Debug, Clone, Copy, PartialEq, Eq)]
pub struct RunTicket {
    /// Tier that runs.
    pub tier: usize,
    number: u64,
}

#[derive(Debug)]
struct Tier {
    name: String,
    can_stop: bool,
    state: TierState,
    times: RunTimes,
    /// Time from a failed step up to the next attempt.
    hold: Duration,
    overshoots_in_a_row: u32,
    failures_in_a_row: u32,
    runs: u64,
    overshoots: u64,
    stopped: u64,
    failures: u64,
}

#[derive(Debug, Clone, Copy)]
struct Run {
    ticket: RunTicket,
    started: Duration,
    /// When it was told to stop, or should have been.
    overdue: Option<Duration>,
}

/// Decides between tiers, the best first. Times are those of the session's clock, which must not run backward; one that
/// does counts as one that stands still.
#[derive(Debug)]
pub struct Tiers {
    budget: Budget,
    tiers: Vec<Tier>,
    current: Option<usize>,
    /// Since when `current` is what it is.
    since: Duration,
    running: Option<Run>,
    runs: u64,
}

impl Tiers {
    /// No tier yet.
    pub fn new(budget: Budget) -> Self {
        Self { budget, tiers: Vec::new(), current: None, since: Duration::ZERO, running: None, runs: 0 }
    }

    /// Adds a tier below those there are, with the times of runs made before the session. One whose fastest run is over
    /// the budget is never started; one whose 95th percentile is, not at first.
    pub fn add(&mut self, name: &str, can_stop: bool, measured: &[Duration]) {
        let budget = self.budget;
        let mut times = RunTimes::new(budget.window);
        measured.iter().for_each(|time| times.push(*time));
        let state = if measured.iter().min().is_some_and(|fastest| *fastest > budget.run) {
            TierState::TooSlow
        } else if times.percentile(0.95).is_some_and(|p95| p95 > budget.run) {
            TierState::OverBudget { retry_at: budget.hold }
        } else {
            TierState::Ready
        };
        if self.current.is_none() && state == TierState::Ready {
            self.current = Some(self.tiers.len());
        }
        self.tiers.push(Tier {
            name: name.to_owned(),
            can_stop,
            state,
            times,
            hold: budget.hold,
            overshoots_in_a_row: 0,
            failures_in_a_row: 0,
            runs: 0,
            overshoots: 0,
            stopped: 0,
            failures: 0,
        });
    }

    /// The budget.
    pub fn budget(&self) -> &Budget {
        &self.budget
    }

    /// The tier at work; none while the rendered image is all there is.
    pub fn current(&self) -> Option<usize> {
        self.current
    }

    /// The current tier's name.
    pub fn name(&self) -> Option<&str> {
        self.current.and_then(|i| self.tiers.get(i)).map(|tier| tier.name.as_str())
    }

    /// A step up, if it is time for one. To be called before [`Tiers::start`].
    pub fn step_up(&mut self, now: Duration) -> Option<Change> {
        if self.running.is_some() || now.saturating_sub(self.since) < self.budget.hold {
            return None;
        }
        let limit = self.budget.run.mul_f64(self.budget.headroom);
        if let Some(tier) = self.current.and_then(|i| self.tiers.get_mut(i)) {
            let at_ease =
                tier.times.len() >= self.budget.settle && tier.times.percentile(0.95).is_some_and(|p| p <= limit);
            if !at_ease {
                return None;
            }
            // It has kept the budget for so long: whatever it did before is forgiven.
            tier.hold = self.budget.hold;
        }
        let due = |tier: &Tier| matches!(tier.state, TierState::OverBudget { retry_at } if now >= retry_at);
        // The nearest better one.
        let to = self.tiers.iter().take(self.current.unwrap_or(self.tiers.len())).rposition(due)?;
        self.tiers[to].state = TierState::Ready;
        Some(self.change(now, Some(to), "there is time to spare".to_owned()))
    }

    /// Begins a run of the current tier; none where nothing may run, or a run is still in progress.
    pub fn start(&mut self, now: Duration) -> Option<RunTicket> {
        let tier = self.current?;
        if self.running.is_some() {
            return None;
        }
        self.runs += 1;
        let ticket = RunTicket { tier, number: self.runs };
        self.running = Some(Run { ticket, started: now, overdue: None });
        Some(ticket)
    }

    /// Ends a run. The end of an abandoned one is not counted.
    pub fn finish(&mut self, ticket: RunTicket, now: Duration, outcome: &Outcome) -> Option<Change> {
        let run = self.running.filter(|run| run.ticket == ticket)?;
        self.running = None;
        let budget = self.budget;
        let took = now.saturating_sub(run.started);
        let tier = self.tiers.get_mut(ticket.tier)?;
        if let Outcome::Failed(reason) = outcome {
            tier.failures += 1;
            tier.failures_in_a_row += 1;
            if tier.failures_in_a_row < FAILURES {
                return None;
            }
            tier.state = TierState::Failed(reason.clone());
            let reason = format!("`{}` failed {FAILURES} times in a row: {reason}", tier.name);
            return self.leave(ticket.tier, now, reason);
        }
        tier.failures_in_a_row = 0;
        tier.times.push(took);
        let stopped = *outcome == Outcome::Stopped;
        tier.stopped += u64::from(stopped);
        tier.runs += u64::from(!stopped);
        if stopped || took > budget.run {
            tier.overshoots += 1;
            tier.overshoots_in_a_row += 1;
        } else {
            tier.overshoots_in_a_row = 0;
        }
        let p95 = tier.times.percentile(0.95).filter(|p95| *p95 > budget.run && tier.times.len() >= budget.settle);
        let reason = if tier.overshoots_in_a_row >= budget.overshoots {
            format!("`{}` was over its budget {} times in a row", tier.name, tier.overshoots_in_a_row)
        } else if let Some(p95) = p95 {
            let [p95, limit] = [p95, budget.run].map(|t| t.as_secs_f64() * 1e3);
            format!("`{}` takes {p95:.1} ms (95 %) of {limit:.1} ms", tier.name)
        } else {
            return None;
        };
        tier.state = TierState::OverBudget { retry_at: now + tier.hold };
        tier.hold = (tier.hold * 2).min(budget.longest_hold);
        self.leave(ticket.tier, now, reason)
    }

    /// What must be done about the run in progress, if anything. Each intervention is told once.
    pub fn watch(&mut self, now: Duration) -> Option<Intervention> {
        let run = self.running.as_mut()?;
        let tier = run.ticket.tier;
        match run.overdue {
            None if now.saturating_sub(run.started) >= self.budget.stop_after => {
                run.overdue = Some(now);
                // One that cannot be stopped gets the time that stopping would take.
                self.tiers.get(tier)?.can_stop.then_some(Intervention::Stop(tier))
            }
            Some(overdue) if now.saturating_sub(overdue) >= self.budget.abandon_after => {
                Some(Intervention::Abandon(tier))
            }
            _ => None,
        }
    }

    /// When [`Tiers::watch`] is to be called next; none while nothing runs.
    pub fn watch_at(&self) -> Option<Duration> {
        let run = self.running?;
        Some(run.overdue.map_or(run.started + self.budget.stop_after, |overdue| overdue + self.budget.abandon_after))
    }

    /// Gives up the run in progress and its tier, after [`Intervention::Abandon`] or when the tier's thread is gone.
    pub fn abandon(&mut self, now: Duration) -> Option<Change> {
        let run = self.running.take()?;
        let tier = self.tiers.get_mut(run.ticket.tier)?;
        tier.state = TierState::Abandoned;
        tier.overshoots += 1;
        let reason = format!("a run of `{}` does not end", tier.name);
        self.leave(run.ticket.tier, now, reason)
    }

    /// What each tier did, the best first.
    pub fn report(&mut self) -> Vec<TierReport> {
        let report = |tier: &mut Tier| TierReport {
            name: tier.name.clone(),
            state: tier.state.clone(),
            runs: tier.runs,
            overshoots: tier.overshoots,
            stopped: tier.stopped,
            failures: tier.failures,
            p50: tier.times.percentile(0.5),
            p95: tier.times.percentile(0.95),
        };
        self.tiers.iter_mut().map(report).collect()
    }

    /// Goes on with the best ready tier below `tier`, which is not ready any more.
    fn leave(&mut self, tier: usize, now: Duration, reason: String) -> Option<Change> {
        if self.current != Some(tier) {
            return None;
        }
        let below = self.tiers.iter().enumerate().skip(tier + 1);
        let to = below.filter(|(_, t)| t.state == TierState::Ready).map(|(i, _)| i).next();
        Some(self.change(now, to, reason))
    }

    fn change(&mut self, now: Duration, to: Option<usize>, reason: String) -> Change {
        let from = std::mem::replace(&mut self.current, to);
        self.since = now;
        if let Some(tier) = to.and_then(|i| self.tiers.get_mut(i)) {
            // Times of another load say nothing about this one.
            tier.times.clear();
            tier.overshoots_in_a_row = 0;
        }
        Change { from, to, reason }
    }
}

#[cfg(test)]
mod tests {
    use super::*;
    use proptest::prelude::*;

    fn ms(n: u64) -> Duration {
        Duration::from_millis(n)
    }

    /// Tiers within a budget of 50 ms that were measured to take so long, and a clock.
    struct Bench {
        tiers: Tiers,
        now: Duration,
        changes: Vec<(Option<usize>, Option<usize>)>,
    }

    impl Bench {
        fn new(measured: &[u64]) -> Self {
            let mut tiers = Tiers::new(Budget::new(ms(50)));
            for (i, n) in measured.iter().enumerate() {
                tiers.add(&format!("tier {i}"), true, &[ms(*n); 5]);
            }
            Self { tiers, now: Duration::ZERO, changes: Vec::new() }
        }

        /// A run of the current tier that takes `n` ms, and a pause.
        fn run(&mut self, n: u64) {
            let up = self.tiers.step_up(self.now);
            let ticket = self.tiers.start(self.now);
            self.now += ms(n);
            let down = ticket.and_then(|t| self.tiers.finish(t, self.now, &Outcome::Done));
            self.now += ms(5);
            self.changes.extend(up.into_iter().chain(down).map(|c| (c.from, c.to)));
        }
    }

    #[test]
    fn a_tier_that_cannot_keep_the_budget_is_never_started() {
        let mut bench = Bench::new(&[70, 30, 10]);
        assert_eq!((bench.tiers.current(), bench.tiers.name()), (Some(1), Some("tier 1")));
        (0..2000).for_each(|_| bench.run(20));
        assert_eq!((bench.changes, bench.tiers.report()[0].runs), (vec![], 0));
        assert_eq!(bench.tiers.report()[0].state, TierState::TooSlow);
        assert_eq!(Bench::new(&[70, 60]).tiers.current(), None);
        assert_eq!(Bench::new(&[]).tiers.start(ms(1)), None);
    }

    #[test]
    fn one_that_was_slow_when_measured_but_can_be_fast_is_tried_later() {
        let mut tiers = Tiers::new(Budget::new(ms(50)));
        tiers.add("best", true, &[ms(40), ms(90)]);
        assert_eq!((tiers.current(), tiers.step_up(ms(4999))), (None, None));
        assert_eq!(tiers.step_up(ms(5000)).unwrap().to, Some(0));
    }

    #[test]
    fn single_overshoots_are_counted_and_forgiven() {
        let mut bench = Bench::new(&[30, 10]);
        for i in 0..300 {
            bench.run(if i % 30 == 29 { 60 } else { 30 });
        }
        let report = &bench.tiers.report()[0];
        assert_eq!((&bench.changes[..], report.overshoots, report.runs), (&[][..], 10, 300));
        assert_eq!((report.p50, report.p95), (Some(ms(30)), Some(ms(30))));
    }

    #[test]
    fn overshoots_in_a_row_step_down_at_once() {
        let mut bench = Bench::new(&[30, 10]);
        [30, 60, 60, 30, 60, 60, 60].into_iter().for_each(|n| bench.run(n));
        assert_eq!(bench.changes, [(Some(0), Some(1))]);
    }

    #[test]
    fn a_high_95th_percentile_steps_down_once_it_has_settled() {
        let mut bench = Bench::new(&[30, 10]);
        // Five measured runs and these: the twentieth settles it.
        (0..14).for_each(|i| bench.run(30 + 30 * (i % 2)));
        assert_eq!(bench.changes, []);
        bench.run(30);
        assert_eq!(bench.changes, [(Some(0), Some(1))]);
    }

    #[test]
    fn steps_up_again_ever_more_rarely_while_it_fails() {
        let mut bench = Bench::new(&[30, 10]);
        let mut ups = Vec::new();
        while bench.now < Duration::from_secs(300) {
            let before = bench.changes.len();
            // The better tier takes 70 ms, the other 10 ms.
            bench.run(if bench.tiers.current() == Some(0) { 70 } else { 10 });
            let up = bench.changes[before..].contains(&(Some(1), Some(0)));
            ups.extend(up.then_some(bench.now.as_secs()));
        }
        let gaps: Vec<_> = ups.windows(2).map(|w| w[1] - w[0]).collect();
        assert!((3..=6).contains(&ups.len()), "{ups:?}");
        assert!(gaps.windows(2).all(|w| w[0] <= w[1] + 1), "{gaps:?}");
        assert!(gaps.last().unwrap() >= &75, "{gaps:?}");
        // The load is gone: it steps up and stays.
        for _ in 0..20_000 {
            bench.run(if bench.tiers.current() == Some(0) { 30 } else { 10 });
        }
        assert_eq!(bench.tiers.current(), Some(0));
        let changes = bench.changes.len();
        (0..500).for_each(|_| bench.run(30));
        assert_eq!(bench.changes.len(), changes);
    }

    #[test]
    fn a_tier_without_time_to_spare_does_not_step_up() {
        let mut bench = Bench::new(&[30, 10]);
        (0..3).for_each(|_| bench.run(60));
        (0..1000).for_each(|_| bench.run(45));
        assert_eq!(bench.tiers.current(), Some(1));
    }

    #[test]
    fn without_any_tier_the_last_is_tried_again_first() {
        let mut bench = Bench::new(&[30, 10]);
        (0..6).for_each(|_| bench.run(60));
        assert_eq!((bench.tiers.current(), bench.tiers.start(bench.now)), (None, None));
        bench.now += ms(20_000);
        bench.run(10);
        assert_eq!(bench.changes, [(Some(0), Some(1)), (Some(1), None), (None, Some(1))]);
    }

    #[test]
    fn a_run_that_hangs_is_stopped_and_then_abandoned() {
        let mut bench = Bench::new(&[30, 10]);
        let tiers = &mut bench.tiers;
        let ticket = tiers.start(ms(1000)).unwrap();
        assert_eq!((tiers.start(ms(1010)), tiers.watch(ms(1099)), tiers.watch_at()), (None, None, Some(ms(1100))));
        assert_eq!(tiers.watch(ms(1100)), Some(Intervention::Stop(0)));
        assert_eq!((tiers.watch(ms(1101)), tiers.watch_at()), (None, Some(ms(2100))), "told once");
        assert_eq!(tiers.watch(ms(2100)), Some(Intervention::Abandon(0)));
        let change = tiers.abandon(ms(2100)).unwrap();
        assert_eq!((change.from, change.to), (Some(0), Some(1)));
        assert!(change.reason.contains("`tier 0`"), "{}", change.reason);
        let next = tiers.start(ms(2101)).unwrap();
        assert_eq!(tiers.finish(ticket, ms(2102), &Outcome::Done), None, "a late end is not counted");
        assert_eq!(tiers.finish(next, ms(2110), &Outcome::Done), None);
        let report = tiers.report();
        assert_eq!((&report[0].state, report[0].runs, report[0].overshoots), (&TierState::Abandoned, 0, 1));
        assert_eq!(tiers.watch(ms(9000)), None);
    }

    #[test]
    fn one_that_cannot_be_stopped_is_abandoned_without_trying() {
        let mut tiers = Tiers::new(Budget::new(ms(50)));
        tiers.add("only", false, &[]);
        tiers.start(ms(0)).unwrap();
        assert_eq!([ms(100), ms(1099)].map(|t| tiers.watch(t)), [None, None]);
        assert_eq!(tiers.watch(ms(1100)), Some(Intervention::Abandon(0)));
        assert_eq!(tiers.abandon(ms(1100)).unwrap().to, None);
    }

    #[test]
    fn stopped_runs_step_down_and_failing_ones_are_given_up() {
        let mut bench = Bench::new(&[30, 10]);
        for _ in 0..3 {
            let ticket = bench.tiers.start(bench.now).unwrap();
            bench.now += ms(100);
            assert_eq!(bench.tiers.watch(bench.now), Some(Intervention::Stop(0)));
            bench.now += ms(1);
            bench.tiers.finish(ticket, bench.now, &Outcome::Stopped);
        }
        assert_eq!((bench.tiers.current(), bench.tiers.report()[0].stopped), (Some(1), 3));
        for i in 0..3 {
            let ticket = bench.tiers.start(bench.now).unwrap();
            let change = bench.tiers.finish(ticket, bench.now + ms(10), &Outcome::Failed("NaN".to_owned()));
            assert_eq!(change.is_some(), i == 2);
        }
        let report = bench.tiers.report();
        assert_eq!((bench.tiers.current(), report[1].failures), (None, 3));
        assert_eq!(report[1].state, TierState::Failed("NaN".to_owned()));
    }

    proptest! {
        #[test]
        fn what_runs_is_always_ready_and_nothing_overflows(
            steps in prop::collection::vec((0u64..400, 0u8..4, 0u64..4000), 1..200),
            measured in prop::collection::vec(1u64..80, 0..4),
        ) {
            let mut bench = Bench::new(&measured);
            for (took, outcome, pause) in steps {
                bench.tiers.step_up(bench.now);
                let started = bench.tiers.start(bench.now);
                prop_assert_eq!(started.map(|t| t.tier), bench.tiers.current());
                // Now and then the clock runs backward.
                bench.now = if outcome == 3 { bench.now.saturating_sub(ms(took)) } else { bench.now + ms(took) };
                if let Some(ticket) = started {
                    match bench.tiers.watch(bench.now) {
                        Some(Intervention::Abandon(_)) => { bench.tiers.abandon(bench.now); }
                        Some(Intervention::Stop(_)) => { bench.tiers.finish(ticket, bench.now, &Outcome::Stopped); }
                        None if outcome == 1 => { bench.tiers.finish(ticket, bench.now, &Outcome::Failed("x".into())); }
                        None => { bench.tiers.finish(ticket, bench.now, &Outcome::Done); }
                    }
                }
                let reports = bench.tiers.report();
                if let Some(current) = bench.tiers.current() {
                    prop_assert_eq!(&reports[current].state, &TierState::Ready);
                }
                bench.now += ms(pause);
            }
        }
    }
}
