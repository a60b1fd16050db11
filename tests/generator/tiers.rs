//! Decisions between tiers, on a simulated clock.

use std::time::Duration;

use insonify::generator::{Budget, Outcome, TierState, Tiers};
use proptest::prelude::*;

fn ms(n: u64) -> Duration {
    Duration::from_millis(n)
}

/// Tiers with given measured times and a budget of 50 ms, and a clock.
struct Bench {
    tiers: Tiers,
    now: Duration,
    changes: Vec<(Option<usize>, Option<usize>)>,
}

impl Bench {
    fn new(measured: &[u64]) -> Self {
        let mut tiers = Tiers::new(Budget::new(ms(50)));
        for (i, n) in measured.iter().enumerate() {
            tiers.add(&format!("tier {i}"), &[ms(*n); 5]);
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
    tiers.add("best", &[ms(40), ms(90)]);
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
    // With the five measured runs: the twentieth run decides.
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
fn stopped_runs_step_down_and_failing_ones_are_given_up() {
    let mut bench = Bench::new(&[30, 10]);
    for _ in 0..3 {
        let ticket = bench.tiers.start(bench.now).unwrap();
        bench.now += ms(100);
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
    fn the_running_tier_is_always_ready_and_nothing_overflows(
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
                let outcome = match outcome {
                    1 => Outcome::Failed("x".into()),
                    2 => Outcome::Stopped,
                    _ => Outcome::Done,
                };
                bench.tiers.finish(ticket, bench.now, &outcome);
            }
            let reports = bench.tiers.report();
            if let Some(current) = bench.tiers.current() {
                prop_assert_eq!(&reports[current].state, &TierState::Ready);
            }
            bench.now += ms(pause);
        }
    }
}
