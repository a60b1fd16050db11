//! The session's choice between rendered and generated pictures.

use super::*;

#[test]
fn a_fast_generator_is_shown_steadily_and_within_the_budget() {
    let _guard = beside_others();
    let (clock, log) = (clock(), Log::default());
    let generators = Some(generator(&clock, 30 * MS));
    let summary = Session { generators, sinks: vec![logger(&log)], ..Session::new(&clock, moving) }.run();
    let frames = seen(&log);
    assert_eq!(changes(&frames), (1, false), "once from rendered to generated");
    assert!(frames[12..].iter().all(|f| f.source == FrameSource::Generated && f.first_pixel == 200));
    assert!(frames[12..].iter().all(|f| f.age == 50 * MS && f.generator.as_deref() == Some("fake")), "20 + 30 ms");
    assert!(summary.generated_ratio > 0.9);
    assert!(summary.inference.unwrap().p50_ms > 29.9);
}

#[test]
fn a_frame_whose_run_fails_is_shown_as_soon_as_it_has() {
    let _guard = beside_others();
    let (clock, log) = (clock(), Log::default());
    let (clock_of_run, mut run) = (clock.clone(), 0);
    let work = move |frame: &Frame, out: &mut Vec<u8>| {
        run += 1;
        let fails = run % 20 == 0;
        clock_of_run.sleep_until(clock_of_run.now() + if fails { 10 * MS } else { 30 * MS });
        out.resize(frame.bmode.len(), 200);
        if fails { Err(GenerateError::Failed("pixel 7 is NaN".to_owned())) } else { Ok(()) }
    };
    let generators = Some(translate(work));
    let summary = Session { generators, sinks: vec![logger(&log)], ..Session::new(&clock, moving) }.run();
    assert!(summary.generator.unwrap().failed >= 9);
    let ages: Vec<_> = seen(&log).iter().map(|frame| frame.age).collect();
    // 20 ms alone, 30 ms with a failed run of 10 ms, 50 ms with a run of 30 ms; the deadline is 100 ms.
    assert!(ages.iter().all(|age| [20 * MS, 30 * MS, 50 * MS].contains(age)), "{ages:?}");
    assert!(ages.iter().filter(|age| **age == 30 * MS).count() >= 2, "{ages:?}");
}

#[test]
fn a_slow_generator_costs_no_frame_and_no_time_and_is_held_while_the_probe_rests() {
    let _guard = beside_others();
    let (clock, log) = (clock(), Log::default());
    let generators = Some(generator(&clock, 300 * MS));
    // Moves for 4 s, rests for 4 s, moves on.
    let poses = |now: Duration| {
        let s = now.as_secs_f64();
        tracked(now, 20.0 * (s.min(4.0) + (s - 8.0).max(0.0)))
    };
    let summary = Session { generators, sinks: vec![logger(&log)], ..Session::new(&clock, poses) }.run();
    let frames = seen(&log);
    assert_eq!(summary.presented, 200, "the cadence holds");
    assert!(frames.iter().all(|f| f.age == 20 * MS), "no frame waits for what can't be in time");
    assert_eq!(changes(&frames), (2, false));
    for frame in &frames {
        match frame.presented.as_secs_f64() {
            s if !(4.0..8.1).contains(&s) => assert_eq!(frame.source, FrameSource::Raw, "{frame:?}"),
            s if (5.2..8.0).contains(&s) => assert_eq!(frame.source, FrameSource::HeldGenerated, "{frame:?}"),
            _ => {}
        }
    }
    let generator = summary.generator.unwrap();
    assert!(generator.late == generator.done && generator.done >= 30 && generator.dropped > 100, "{generator:?}");
}

#[test]
fn a_generator_at_its_limit_does_not_flicker() {
    let _guard = beside_others();
    let (clock, log) = (clock(), Log::default());
    let (clock_of, mut run) = (clock.clone(), 0_u64);
    let work = move |frame: &Frame, out: &mut Vec<u8>| {
        run += 1;
        // Most runs are in time, every fifth is not.
        clock_of.sleep_until(clock_of.now() + if run.is_multiple_of(5) { 110 * MS } else { 40 * MS });
        out.resize(frame.bmode.len(), 200);
        Ok(())
    };
    let generators = Some(translate(work));
    let summary = Session {
        generators,
        sinks: vec![logger(&log)],
        limits: Limits { duration: Some(60 * SECOND), frames: None },
        ..Session::new(&clock, moving)
    }
    .run();
    let frames = seen(&log);
    let (count, flickers) = changes(&frames);
    assert!(!flickers && count <= 6, "{count} changes");
    assert!(frames.iter().all(|f| f.age <= 100 * MS), "the deadline holds");
    assert!(summary.presented >= 1195);
}

#[test]
fn a_generator_that_gives_nonsense_is_left_and_tried_again() {
    let _guard = beside_others();
    let (clock, log) = (clock(), Log::default());
    let mut run = 0;
    let work = move |frame: &Frame, out: &mut Vec<u8>| {
        run += 1;
        match run {
            20 => out.resize(frame.bmode.len() - 1, 0),
            21..=25 => return Err(GenerateError::Failed("pixel 7 is NaN".to_owned())),
            _ => out.resize(frame.bmode.len(), 200),
        }
        Ok(())
    };
    let generators = Some(translate(work));
    // Three failures in a row: it is left for a minute, after the next three for two.
    let limits = Limits { duration: Some(240 * SECOND), frames: None };
    let points = Some(with_generator());
    let summary =
        Session { generators, limits, points, sinks: vec![logger(&log)], ..Session::new(&clock, moving) }.run();
    let frames = seen(&log);
    assert_eq!(frames.len(), 4800);
    assert!(frames.iter().all(|f| matches!((f.source, f.first_pixel), (FrameSource::Raw, 1) | (_, 200))));
    assert_eq!(changes(&frames), (3, false));
    assert!(frames.iter().any(|f| f.notice.as_ref().is_some_and(|n| n.contains("fake failed: it gave 31 pixels"))));
    let generator = summary.generator.unwrap();
    assert_eq!(generator.failed, 6, "no back-off but the controller's");
    let said: Vec<String> = summary.points.unwrap().changes.into_iter().map(|change| change.reason).collect();
    assert_eq!(said.len(), 4, "{said:?}");
    assert!([0, 2].iter().all(|&nth| said[nth] == "fake failed 3 times in a row: pixel 7 is NaN"), "{said:?}");
    assert_eq!(frames.last().unwrap().source, FrameSource::Generated, "it is back at the end");
}
