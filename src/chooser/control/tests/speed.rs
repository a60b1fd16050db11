//! Tests: which operating point the controller chooses at each speed of the probe.

use super::*;
use crate::pose::Speed;
use crate::random::SplitMix64;

const REST: Speed = Speed { mm_s: 0.0, deg_s: 0.0 };
const FAST: Speed = Speed { mm_s: 0.0, deg_s: 20.0 };

/// Controller whose generators do not improve the picture while the probe moves fast; the times are those of two cores.
fn controller() -> PointController {
    let candidates = TWO_CORES.candidates().into_iter().map(|candidate| {
        let at_rest = candidate.error.at_rest;
        let fast = if candidate.generator.is_some() { 40.0 } else { at_rest };
        Candidate { error: BySpeed::new([at_rest, at_rest, fast]), ..candidate }
    });
    let budget = FrameBudget { frame_ms: Some(71.0), run_ms: f64::INFINITY, apart: false, spread: TWO_CORES.spread };
    let names = GENERATORS.map(|(name, ..)| name.to_owned()).into();
    PointController::new(candidates.collect(), names, budget).unwrap()
}

/// Runs a session in which `speed` gives the probe's speed every half second. Returns the changes.
fn moved(
    controller: &mut PointController,
    seconds: f64,
    mut speed: impl FnMut(f64) -> Speed,
    mut load: impl FnMut(f64) -> (f64, f64),
) -> Vec<(f64, String, String)> {
    let (mut changes, mut now_s) = (Vec::new(), 0.0);
    while now_s < seconds {
        controller.moves(now_s, speed(now_s));
        changes.extend(session(controller, &TWO_CORES, now_s, 0.5, &mut load).changes);
        now_s += 0.5;
    }
    changes
}

#[test]
fn the_best_point_of_each_speed_is_taken_at_once_and_does_not_delay_others() {
    let mut controller = controller();
    let begun = controller.point();
    assert!(begun.generator.is_some());
    let before = controller.changes;
    let speed = |now_s: f64| if (20.0..40.0).contains(&now_s) { FAST } else { REST };
    let changes = moved(&mut controller, 60.0, speed, |_| (1.0, 1.0));
    let [(away_s, _, away), (back_s, _, back)] = &changes[..] else { panic!("{changes:?}") };
    assert!((20.0..22.0).contains(away_s) && (41.0..43.5).contains(back_s), "{changes:?}");
    assert!(away.contains("the probe moves fast") && back.contains("the probe is at rest"), "{changes:?}");
    assert_eq!((controller.point(), controller.changes), (begun, before));
}

#[test]
fn a_restless_probe_does_not_make_it_flicker() {
    let mut random = SplitMix64::new(3);
    let mut controller = controller();
    let speed = |_: f64| if random.unit() < 0.5 { FAST } else { REST };
    let restless = moved(&mut controller, 300.0, speed, |_| (1.0, 1.0));
    assert!(restless.len() <= 30, "{restless:?}");
    assert!(restless.windows(2).all(|pair| pair[1].0 - pair[0].0 >= RISE_S), "{restless:?}");
    // Five seconds fast and five at rest, in turns.
    let mut controller = self::controller();
    let speed = |now_s: f64| if now_s % 10.0 < 5.0 { FAST } else { REST };
    let changes = moved(&mut controller, 300.0, speed, |_| (1.0, 1.0));
    assert!(changes.len() > 10, "it follows the speed: {changes:?}");
    assert!(changes.windows(2).all(|pair| pair[1].0 - pair[0].0 >= RISE_S), "{changes:?}");
}

#[test]
fn what_was_better_before_the_probe_moved_waits_as_ever() {
    // The load falls as the probe starts to move: a rendered point is better at any speed.
    let mut controller = Machine { run_ms: [500.0, 500.0], ..TWO_CORES }.controller(60.0);
    moved(&mut controller, 30.0, |_| REST, |_| (1.9, 1.0));
    let (mut changes, mut now_s) = (Vec::new(), 30.0);
    while now_s < 60.0 {
        controller.moves(now_s, FAST);
        changes.extend(session(&mut controller, &TWO_CORES, now_s, 0.5, |_| (1.0, 1.0)).changes);
        now_s += 0.5;
    }
    let (at_s, _, reason) = &changes[0];
    assert!(*at_s >= 30.0 + RISE_S && reason.contains("expected to take"), "{changes:?}");
}
