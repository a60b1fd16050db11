//! Frames and generated pictures on the same processors.

use super::*;

/// Runs a session at 20 frames/s in which rendering for `service` and generator runs of `run(number)` share the
/// processors.
fn on_shared_processors(
    service: Duration,
    run: impl Fn(u64) -> Duration + Send + 'static,
) -> (Summary, Vec<Seen>, u64) {
    let (clock, log, processors) = (clock(), Log::default(), Arc::<Processors>::default());
    let (clock_of_run, shared, mut number) = (clock.clone(), processors.clone(), 0);
    let work = move |frame: &Frame, out: &mut Vec<u8>| {
        shared.work(&clock_of_run, run(number));
        number += 1;
        out.resize(frame.bmode.len(), 200);
        Ok(())
    };
    let generators: Box<dyn FrameGenerators> = Box::new(Translate { work, terminator: None, on_processors: true });
    let session = Session::new(&clock, moving);
    let session = Session {
        generators: Some(generators),
        processors: Some(processors.clone()),
        sinks: vec![logger(&log)],
        service,
        ..session
    };
    let summary = session.run();
    (summary, seen(&log), processors.shared.load(Ordering::Relaxed))
}

#[test]
fn frames_and_generated_pictures_take_turns_on_the_same_processors() {
    let _guard = beside_others();
    // One run in ten is late, but not by half a period.
    let (summary, frames, shared) = on_shared_processors(25 * MS, |n| if n % 10 == 4 { 35 * MS } else { 20 * MS });
    assert_eq!((shared, summary.missed_ticks, summary.presented), (0, 0, 200));
    assert!(frames[8..].iter().all(|frame| frame.source == FrameSource::Generated));
    assert!(frames.iter().all(|frame| frame.age <= 60 * MS), "rendered and translated without an interruption");
}

#[test]
fn frames_slow_down_if_render_and_generator_exceed_a_period() {
    let _guard = beside_others();
    let (summary, frames, shared) = on_shared_processors(30 * MS, |_| 30 * MS);
    assert_eq!(shared, 0);
    assert!((summary.frames_per_s - 1.0 / 0.06).abs() < 0.2, "{}", summary.frames_per_s);
    assert!(frames[8..].iter().all(|frame| frame.source == FrameSource::Generated && frame.age == 60 * MS));
}

#[test]
fn a_generator_that_takes_long_does_not_slow_frames_down() {
    let _guard = beside_others();
    let (summary, _, shared) = on_shared_processors(25 * MS, |_| 300 * MS);
    // It takes turns only in its first run, while its duration is unknown.
    assert!(summary.presented >= 196 && summary.missed_ticks <= 4, "{summary:?}");
    assert!(shared > 100);
    let (summary, frames, _) = on_shared_processors(25 * MS, |n| if n == 30 { 1000 * SECOND } else { 10 * MS });
    assert!(frames.last().unwrap().number >= 150, "{summary:?}");
    assert!(frames[60..].iter().all(|frame| frame.source == FrameSource::Raw), "the generator hangs");
}

#[test]
fn a_frame_that_is_made_where_it_is_submitted_is_not_held_back() {
    let _guard = beside_others();
    let (clock, log, processors) = (clock(), Log::default(), Arc::<Processors>::default());
    let session = Session::new(&clock, moving);
    let processors = Some(processors);
    let summary = Session { service: 70 * MS, processors, sinks: vec![logger(&log)], ..session }.run();
    assert!((summary.frames_per_s - 1.0 / 0.07).abs() < 0.1, "{}", summary.frames_per_s);
    assert!(seen(&log).iter().all(|frame| frame.age == 70 * MS));
}
