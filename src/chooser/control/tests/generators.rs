//! Tests: generators that fail, that are late, or that watchers don't want.

use super::*;

#[test]
fn a_generator_that_fails_is_left_and_tried_again_later() {
    // Only one generator keeps the budget.
    let mut controller = TWO_CORES.controller(68.5);
    let generator = controller.point().generator.unwrap();
    controller.failed(generator, "pixel 7 is NaN");
    controller.failed(generator, "pixel 7 is NaN");
    assert_eq!(controller.change(1.0), None);
    controller.ran(1.0, generator, 30.0);
    (0..3).for_each(|_| controller.failed(generator, "pixel 7 is NaN"));
    let change = controller.change(2.0).unwrap();
    assert_ne!(change.to.generator, Some(generator));
    assert!(change.reason.contains("failed 3 times in a row: pixel 7 is NaN"), "{}", change.reason);
    let seen = session(&mut controller, &TWO_CORES, 2.0, 50.0, |_| (1.0, 1.0));
    assert!(seen.changes.is_empty(), "{:?}", seen.changes);
    session(&mut controller, &TWO_CORES, 52.0, 60.0, |_| (1.0, 1.0));
    assert_eq!(controller.point().generator, Some(generator));
}

#[test]
fn generators_that_nobody_wants_are_left_at_once() {
    let mut controller = TWO_CORES.controller(71.0);
    session(&mut controller, &TWO_CORES, 0.0, 10.0, |_| (1.0, 1.0));
    controller.allow_generators(false);
    let change = controller.change(10.0).unwrap();
    assert_eq!((change.to.generator, change.to.quality), (None, FrameQuality::new(4, 3)));
    let seen = session(&mut controller, &TWO_CORES, 10.0, 100.0, |_| (1.0, 1.0));
    assert!(seen.changes.iter().all(|(_, name, _)| !name.contains('+')), "{:?}", seen.changes);
    controller.allow_generators(true);
    session(&mut controller, &TWO_CORES, 110.0, 100.0, |_| (1.0, 1.0));
    assert!(controller.point().generator.is_some());
}

#[test]
fn without_a_frame_budget_only_runs_are_limited() {
    let quality = FrameQuality::new(8, 3);
    let of = |generator: Option<usize>, error, run_ms| Candidate {
        quality,
        generator,
        error: BySpeed::all(error),
        render_ms: 900.0,
        run_ms,
    };
    let candidates = vec![of(None, 20.0, 0.0), of(Some(0), 10.0, 70.0), of(Some(1), 12.0, 40.0)];
    let budget = FrameBudget { frame_ms: None, run_ms: 50.0, apart: false, spread: 1.1 };
    let mut controller = PointController::new(candidates, vec!["slow".into(), "fast".into()], budget).unwrap();
    assert_eq!(controller.name(&controller.point()), "8x3 + fast");
    for frame in 0..30 {
        controller.rendered(f64::from(frame), quality, 900.0);
        controller.ran(f64::from(frame), 1, 60.0);
    }
    let change = controller.change(30.0).unwrap();
    assert_eq!((change.to.generator, change.reason.starts_with("frames take 60 ms of 50")), (None, true), "{change:?}");
}

#[test]
fn frames_and_runs_on_other_hardware_overlap() {
    let budget = FrameBudget { frame_ms: Some(60.0), run_ms: f64::INFINITY, apart: true, spread: 1.1 };
    let names = GENERATORS.map(|(name, ..)| name.to_owned()).into();
    let controller = PointController::new(TWO_CORES.candidates(), names, budget).unwrap();
    assert_eq!(controller.name(&controller.point()), "1x3 + middle_1x3");
    assert_eq!(controller.expected_ms(&controller.point()), 50.0);
}

#[test]
fn a_generator_whose_runs_do_not_end_is_left() {
    let mut controller = TWO_CORES.controller(71.0);
    let point = controller.point();
    let mut changed = None;
    for tick in 0..40 {
        let now_s = f64::from(tick) * PERIOD_S;
        controller.rendered(now_s, point.quality, point.render_ms);
        changed = changed.or_else(|| controller.change(now_s).map(|change| (tick, change)));
    }
    let (tick, change) = changed.unwrap();
    assert_eq!((tick, change.reason.as_str()), (16, "no run has ended for 16 frames"));
    assert_ne!(change.to, point);
}

#[test]
fn a_burden_of_runs_alone_is_forgotten() {
    let mut controller = TWO_CORES.controller(71.0);
    let begun = controller.point();
    let burdened = |now_s: f64| if now_s < 60.0 { (1.0, 3.0) } else { (1.0, 1.0) };
    session(&mut controller, &TWO_CORES, 0.0, 60.0, burdened);
    assert_eq!(controller.point().generator, None);
    session(&mut controller, &TWO_CORES, 60.0, 300.0, burdened);
    assert_eq!(controller.point(), begun);
}

#[test]
fn runs_keep_their_own_budget() {
    let budget = FrameBudget { frame_ms: Some(120.0), run_ms: 45.0, apart: false, spread: 1.15 };
    let names = GENERATORS.map(|(name, ..)| name.to_owned()).into();
    let mut controller = PointController::new(TWO_CORES.candidates(), names, budget).unwrap();
    assert_eq!(controller.name(&controller.point()), "1x3 + fast_1x3");
    let seen = session(&mut controller, &TWO_CORES, 0.0, 120.0, |_| (1.0, 1.0));
    assert!(seen.changes.is_empty(), "{:?}", seen.changes);
}

#[test]
fn a_generator_over_its_own_budget_is_left() {
    // Frames with runs keep the frame budget; the runs exceed their own.
    let budget = FrameBudget { frame_ms: Some(120.0), run_ms: 30.0, apart: false, spread: 1.1 };
    let names = GENERATORS.map(|(name, ..)| name.to_owned()).into();
    let mut controller = PointController::new(TWO_CORES.candidates(), names, budget).unwrap();
    let point = controller.point();
    let generator = point.generator.unwrap();
    let mut changed = None;
    for tick in 0..20 {
        let now_s = f64::from(tick) * PERIOD_S;
        controller.rendered(now_s, point.quality, point.render_ms);
        controller.terminated(now_s, generator, 60.0);
        changed = changed.or_else(|| controller.change(now_s));
    }
    let change = changed.unwrap();
    assert_eq!((change.to.generator, change.reason.as_str()), (None, "runs take 60 ms of 30"));
}
