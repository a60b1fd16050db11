//! Choice among several generators: the best that keeps the budget. Pure: the caller passes the time.

use std::time::Duration;

use super::budget::{Budget, RunTimes};

/// Consecutive failed runs after which a tier is given up.
const FAILURES: u32 = 3;

/// Outcome of a run.
#[derive(Debug, Clone, PartialEq, Eq)]
pub enum Outcome {
    /// It gave an image.
    Done,
    /// It was stopped.
    Stopped,
    /// It failed with this message.
    Failed(String),
}

/// A change of tier; None is the rendered image.
#[derive(Debug, Clone, PartialEq, Eq)]
pub struct Change {
    /// Tier before.
    pub from: Option<usize>,
    /// Tier from now on.
    pub to: Option<usize>,
    /// Reason, as text.
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
    /// It failed repeatedly; this is the last reason.
    Failed(String),
}

/// Totals of a tier.
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
    /// Median duration of the latest runs, by nearest rank.
    pub p50: Option<Duration>,
    /// 95th percentile of those durations, by nearest rank.
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
    /// Its totals, without percentiles.
    totals: TierReport,
    times: RunTimes,
    /// Time from a failed step up to the next attempt.
    hold: Duration,
    overshoots_in_a_row: u32,
    failures_in_a_row: u32,
}

#[derive(Debug, Clone, Copy)]
struct Run {
    ticket: RunTicket,
    started: Duration,
}

/// Chooses among tiers, the best first. Times are those of the session's clock; if it runs backward, elapsed times
/// count as 0.
#[derive(Debug)]
pub struct Tiers {
    budget: Budget,
    tiers: Vec<Tier>,
    current: Option<usize>,
    /// Time of the last change of `current`.
    since: Duration,
    running: Option<Run>,
    runs: u64,
}

impl Tiers {
    /// No tier yet.
    pub fn new(budget: Budget) -> Self {
        Self { budget, tiers: Vec::new(), current: None, since: Duration::ZERO, running: None, runs: 0 }
    }

    /// Adds a tier below the others, with durations measured before the session. It is never started if the fastest is
    /// over the budget, and not at first if the 95th percentile is.
    pub fn add(&mut self, name: &str, measured: &[Duration]) {
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
        let name = name.to_owned();
        let totals = TierReport { name, state, runs: 0, overshoots: 0, stopped: 0, failures: 0, p50: None, p95: None };
        self.tiers.push(Tier { totals, times, hold: budget.hold, overshoots_in_a_row: 0, failures_in_a_row: 0 });
    }

    /// The current tier; None if only the rendered image is available.
    pub fn current(&self) -> Option<usize> {
        self.current
    }

    /// The current tier's name.
    pub fn name(&self) -> Option<&str> {
        self.current.and_then(|i| self.tiers.get(i)).map(|tier| tier.totals.name.as_str())
    }

    /// The tier to step up to now, if any. Call it before [`Tiers::start`].
    pub fn next_up(&mut self, now: Duration) -> Option<usize> {
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
            // It has kept the budget, so earlier failed steps no longer count.
            tier.hold = self.budget.hold;
        }
        let due = |tier: &Tier| matches!(tier.totals.state, TierState::OverBudget { retry_at } if now >= retry_at);
        // The closest better tier.
        self.tiers.iter().take(self.current.unwrap_or(self.tiers.len())).rposition(due)
    }

    /// Steps up to [`Tiers::next_up`], if there is one.
    pub fn step_up(&mut self, now: Duration) -> Option<Change> {
        let to = self.next_up(now)?;
        self.tiers[to].totals.state = TierState::Ready;
        Some(self.change(now, Some(to), "there is time to spare".to_owned()))
    }

    /// Begins a run of the current tier; None without one, or while a run is in progress.
    pub fn start(&mut self, now: Duration) -> Option<RunTicket> {
        let tier = self.current?;
        if self.running.is_some() {
            return None;
        }
        self.runs += 1;
        let ticket = RunTicket { tier, number: self.runs };
        self.running = Some(Run { ticket, started: now });
        Some(ticket)
    }

    /// Ends a run; a ticket of any other run is ignored.
    pub fn finish(&mut self, ticket: RunTicket, now: Duration, outcome: &Outcome) -> Option<Change> {
        let run = self.running.filter(|run| run.ticket == ticket)?;
        self.running = None;
        let budget = self.budget;
        let took = now.saturating_sub(run.started);
        let tier = self.tiers.get_mut(ticket.tier)?;
        if let Outcome::Failed(reason) = outcome {
            tier.totals.failures += 1;
            tier.failures_in_a_row += 1;
            if tier.failures_in_a_row < FAILURES {
                return None;
            }
            tier.totals.state = TierState::Failed(reason.clone());
            let reason = format!("`{}` failed {FAILURES} times in a row: {reason}", tier.totals.name);
            return self.leave(ticket.tier, now, reason);
        }
        tier.failures_in_a_row = 0;
        tier.times.push(took);
        let stopped = *outcome == Outcome::Stopped;
        tier.totals.stopped += u64::from(stopped);
        tier.totals.runs += u64::from(!stopped);
        if stopped || took > budget.run {
            tier.totals.overshoots += 1;
            tier.overshoots_in_a_row += 1;
        } else {
            tier.overshoots_in_a_row = 0;
        }
        let p95 = tier.times.percentile(0.95).filter(|p95| *p95 > budget.run && tier.times.len() >= budget.settle);
        let reason = if tier.overshoots_in_a_row >= budget.overshoots {
            format!("`{}` was over its budget {} times in a row", tier.totals.name, tier.overshoots_in_a_row)
        } else if let Some(p95) = p95 {
            let [p95, limit] = [p95, budget.run].map(|t| t.as_secs_f64() * 1e3);
            format!("`{}` takes {p95:.1} ms (95 %) of {limit:.1} ms", tier.totals.name)
        } else {
            return None;
        };
        tier.totals.state = TierState::OverBudget { retry_at: now + tier.hold };
        tier.hold = (tier.hold * 2).min(budget.longest_hold);
        self.leave(ticket.tier, now, reason)
    }

    /// Totals of each tier, the best first.
    pub fn report(&mut self) -> Vec<TierReport> {
        let report = |tier: &mut Tier| {
            let [p50, p95] = [0.5, 0.95].map(|part| tier.times.percentile(part));
            TierReport { p50, p95, ..tier.totals.clone() }
        };
        self.tiers.iter_mut().map(report).collect()
    }

    /// Switches to the best ready tier below `tier`, which is no longer ready.
    fn leave(&mut self, tier: usize, now: Duration, reason: String) -> Option<Change> {
        if self.current != Some(tier) {
            return None;
        }
        let below = self.tiers.iter().enumerate().skip(tier + 1);
        let to = below.filter(|(_, t)| t.totals.state == TierState::Ready).map(|(i, _)| i).next();
        Some(self.change(now, to, reason))
    }

    fn change(&mut self, now: Duration, to: Option<usize>, reason: String) -> Change {
        let from = std::mem::replace(&mut self.current, to);
        self.since = now;
        if let Some(tier) = to.and_then(|i| self.tiers.get_mut(i)) {
            // Durations under another load don't apply to this one.
            tier.times.clear();
            tier.overshoots_in_a_row = 0;
        }
        Change { from, to, reason }
    }
}
