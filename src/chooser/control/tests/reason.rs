//! Tests of the text that says why a generator runs or not.

use super::*;

/// Controller of one rendered point (error, frame time) and one with a generator (error, frame time, run time).
fn controller(raw: (f64, f64), generated: (f64, f64, f64), budget: FrameBudget) -> PointController {
    let rolling = |rays, layers| FrameQuality { angles: 9, ..FrameQuality::new(rays, layers) };
    let candidates = vec![
        Candidate {
            quality: rolling(4, 3),
            generator: None,
            error: BySpeed::all(raw.0),
            render_ms: raw.1,
            run_ms: 0.0,
        },
        Candidate {
            quality: FrameQuality::LQ,
            generator: Some(0),
            error: BySpeed::all(generated.0),
            render_ms: generated.1,
            run_ms: generated.2,
        },
    ];
    PointController::new(candidates, vec!["fast_msa".into()], budget).unwrap()
}

fn budget(frame_ms: f64) -> FrameBudget {
    FrameBudget { frame_ms: Some(frame_ms), run_ms: f64::INFINITY, apart: false, spread: 1.05 }
}

#[test]
fn the_two_best_points_that_fit_are_compared() {
    let without = controller((14.9, 55.1), (23.7, 25.0, 31.0), budget(64.0));
    let reason =
        "no generator: 4x3 of 9 angles (55 ms, error 14.9) beats 1x1 + fast_msa (56 ms, error 23.7) within 64 ms";
    assert_eq!(without.generator_reason(), Some(reason));
    assert_eq!(without.summary().generator_reason.as_deref(), Some(reason));
    let with = controller((14.9, 55.1), (11.5, 25.0, 31.0), budget(64.0));
    assert_eq!(
        with.generator_reason().unwrap(),
        "generator fast_msa: 1x1 + fast_msa (56 ms, error 11.5) beats 4x3 of 9 angles (55 ms, error 14.9) within 64 ms"
    );
}

#[test]
fn of_many_points_the_best_of_the_other_kind_is_named() {
    let controller = TWO_CORES.controller(71.0);
    // The points with less error, 1x3 + fast_1x3 and 4x3, don't fit.
    assert_eq!(
        controller.generator_reason().unwrap(),
        "generator fast: 1x1 + fast (55 ms, error 14.0) beats 2x3 (42 ms, error 17.0) within 71 ms"
    );
}

#[test]
fn a_better_point_that_is_too_slow_is_named_with_what_it_exceeds() {
    let slow = controller((14.9, 55.1), (11.5, 25.0, 37.0), budget(64.0));
    assert_eq!(
        slow.generator_reason().unwrap(),
        "no generator: 4x3 of 9 angles (55 ms, error 14.9) keeps 64 ms, 1x1 + fast_msa (62 ms, error 11.5) does not: \
         its 95th percentile is 65 ms"
    );
    let near = controller((14.9, 55.1), (11.5, 25.0, 35.0), budget(64.0));
    let near = near.generator_reason().unwrap();
    assert!(near.ends_with("its 95th percentile is 63 ms, above 92 % of the budget"), "{near}");
    let runs = controller((14.9, 55.1), (11.5, 20.0, 30.0), FrameBudget { run_ms: 28.0, ..budget(64.0) });
    assert!(runs.generator_reason().unwrap().ends_with("the 95th percentile of its runs is 32 ms of 28"));
    let none_fits = controller((14.9, 55.1), (11.5, 40.0, 37.0), budget(30.0));
    assert_eq!(
        none_fits.generator_reason().unwrap(),
        "no generator: nothing keeps 30 ms; 4x3 of 9 angles (55 ms, error 14.9) is faster than \
         1x1 + fast_msa (77 ms, error 11.5)"
    );
}

#[test]
fn a_fixed_quality_compares_runs_alone() {
    let fixed = |run_ms| {
        let budget = FrameBudget { frame_ms: None, run_ms: 50.0, apart: false, spread: 1.05 };
        controller((2.0, 300.0), (1.0, 300.0, run_ms), budget).generator_reason().unwrap().to_owned()
    };
    assert_eq!(fixed(40.0), "generator fast_msa: 1x1 + fast_msa (40 ms a run) beats 4x3 of 9 angles within 50 ms");
    assert!(
        fixed(60.0).starts_with("no generator: 4x3 of 9 angles keeps 50 ms, 1x1 + fast_msa (60 ms a run) does not")
    );
}

#[test]
fn stations_without_generators_say_nothing_and_unusable_ones_are_named() {
    let raw = Candidate {
        quality: FrameQuality::LQ,
        generator: None,
        error: BySpeed::all(9.0),
        render_ms: 20.0,
        run_ms: 0.0,
    };
    let of = |names: Vec<String>| PointController::new(vec![raw], names, budget(64.0)).unwrap();
    assert_eq!(of(vec![]).generator_reason(), None);
    let unusable = of(vec!["fast_msa".into()]);
    assert!(unusable.generator_reason().unwrap().contains("no frames for fast_msa"));
}
