//! Tests: settings that watchers make by hand.

use super::*;

#[test]
fn generated_pictures_return_as_soon_as_they_are_wanted() {
    let mut controller = TWO_CORES.controller(71.0);
    let begun = controller.point();
    session(&mut controller, &TWO_CORES, 0.0, 10.0, |_| (1.0, 1.0));
    // Off and on repeatedly: no change has to wait for an earlier one.
    for nth in 0..6 {
        let now_s = 10.0 + f64::from(nth);
        controller.allow_generators(false);
        assert_eq!(controller.change(now_s).unwrap().to.generator, None);
        assert_eq!(controller.change(now_s + 0.1), None);
        controller.allow_generators(true);
        let change = controller.change(now_s + 0.2).unwrap();
        assert_eq!((change.to, change.reason.as_str()), (begun, "generated pictures are switched on"));
    }
    let summary = controller.summary();
    assert_eq!((summary.lowered, summary.raised, summary.changes.len()), (6, 6, 12));
    // A change because of load does not have to wait either.
    session(&mut controller, &TWO_CORES, 16.0, 10.0, |_| (1.9, 2.0));
    assert_ne!(controller.point(), begun);
    session(&mut controller, &TWO_CORES, 26.0, 20.0, |_| (1.0, 1.0));
    assert_eq!(controller.summary().raised, 7, "{:?}", controller.switches);
}

#[test]
fn switching_on_changes_nothing_where_no_generator_fits() {
    let machine = Machine { run_ms: [500.0, 500.0], ..TWO_CORES };
    let mut controller = machine.controller(71.0);
    controller.allow_generators(false);
    assert_eq!(controller.change(0.0), None);
    controller.allow_generators(true);
    assert_eq!(controller.change(0.1), None);
}

#[test]
fn a_quality_set_by_hand_keeps_the_generator_at_work_under_control() {
    let mut controller = TWO_CORES.controller(71.0);
    let generator = controller.point().generator;
    assert!(generator.is_some() && controller.chooses_quality());
    let quality = FrameQuality::new(6, 2);
    assert!(controller.hold(1.0, quality));
    assert_eq!((controller.point().quality, controller.point().generator), (quality, generator));
    assert!(!controller.chooses_quality());
    // Frame times are not limited any more, so the quality stays.
    let seen = session(&mut controller, &TWO_CORES, 1.0, 60.0, |_| (9.0, 1.0));
    assert!(seen.changes.is_empty(), "{:?}", seen.changes);
    controller.allow_generators(false);
    let change = controller.change(61.0).unwrap();
    assert_eq!((change.to.quality, change.to.generator), (quality, None));
    controller.allow_generators(true);
    assert_eq!(controller.change(61.1).unwrap().to.generator, generator);
    let summary = controller.summary();
    assert!(summary.by_hand && summary.error.is_none(), "{summary:?}");
}

#[test]
fn a_quality_set_by_hand_ends_the_choice_of_a_rendered_point() {
    let machine = Machine { run_ms: [500.0, 500.0], ..TWO_CORES };
    let mut controller = machine.controller(60.0);
    assert!(!controller.hold(1.0, FrameQuality::LQ));
    assert!(controller.summary().by_hand);
}

#[test]
fn a_fixed_quality_keeps_all_its_generators() {
    let of = |generator: Option<usize>, error, run_ms| {
        let (quality, error) = (FrameQuality::LQ, BySpeed::all(error));
        Candidate { quality, generator, error, render_ms: 20.0, run_ms }
    };
    let candidates = vec![of(Some(0), 1.0, 70.0), of(Some(1), 2.0, 40.0), of(None, 3.0, 0.0)];
    let budget = FrameBudget { frame_ms: None, run_ms: 50.0, apart: false, spread: 1.1 };
    let mut controller = PointController::new(candidates, vec!["slow".into(), "fast".into()], budget).unwrap();
    assert_eq!(controller.summary().error, None);
    let quality = FrameQuality::new(2, 3);
    assert!(controller.hold(0.0, quality));
    assert_eq!(controller.name(&controller.point()), "2x3 + fast");
    // Frames of the new quality have no measured time. Generators with long runs are left, and return later.
    for frame in 0..30 {
        controller.rendered(2.0 + f64::from(frame), quality, 900.0);
        controller.ran(2.0 + f64::from(frame), 1, 60.0);
    }
    assert_eq!(controller.change(32.0).unwrap().to.generator, None);
    let mut returned = None;
    for frame in 0..3000 {
        let now_s = 33.5 + f64::from(frame) * PERIOD_S;
        controller.rendered(now_s, quality, 45.0);
        returned = returned.or_else(|| controller.change(now_s).map(|change| change.to.generator));
    }
    assert_eq!(returned, Some(Some(1)));
}
