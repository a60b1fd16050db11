//! Sessions whose frames and generated pictures share processors, or a GPU.

use super::*;

/// Runs a session at 20 frames/s on shared processors. A frame takes `service`, generator run number n takes `run(n)`.
/// Returns the summary, the frames, and how often both worked at once.
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
    let generators: Box<dyn FrameGenerators> =
        Box::new(Translate { work, terminator: None, compute_device: ComputeDevice::Processors });
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

/// Runs a session at 20 frames/s. A frame takes `service` on the fakes' GPU, a generator run takes `run` on `device`.
/// Returns the summary, the frames, and the total time for which both worked at once.
fn with_runs_on(device: ComputeDevice, service: Duration, run: Duration) -> (Summary, Vec<Seen>, Duration) {
    let (clock, log, frames_busy, runs_busy) = (clock(), Log::default(), Busy::default(), Busy::default());
    let (clock_of_run, busy) = (clock.clone(), runs_busy.clone());
    let work = move |frame: &Frame, out: &mut Vec<u8>| {
        let begins = clock_of_run.now();
        clock_of_run.sleep_until(begins + run);
        busy.lock().unwrap().push((begins, begins + run));
        out.resize(frame.bmode.len(), 200);
        Ok(())
    };
    let generators: Option<Box<dyn FrameGenerators>> =
        Some(Box::new(Translate { work, terminator: None, compute_device: device }));
    let session = Session::new(&clock, moving);
    let summary =
        Session { generators, service, busy: Some(frames_busy.clone()), sinks: vec![logger(&log)], ..session }.run();
    let runs = std::mem::take(&mut *runs_busy.lock().unwrap());
    let frames = std::mem::take(&mut *frames_busy.lock().unwrap());
    // The first run is of unknown duration.
    let pairs = runs[1..].iter().flat_map(|run| frames.iter().map(move |frame| (run, frame)));
    let both = pairs.map(|(run, frame)| run.1.min(frame.1).saturating_sub(run.0.max(frame.0))).sum();
    (summary, seen(&log), both)
}

#[test]
fn frames_and_generated_pictures_take_turns_on_the_same_gpu() {
    let _guard = beside_others();
    // GPUs of which nothing tells them apart count as one.
    for device in [gpu(1), ComputeDevice::UNKNOWN_GPU] {
        let (summary, frames, both) = with_runs_on(device, 25 * MS, 20 * MS);
        assert_eq!((both, summary.missed_ticks, summary.presented), (Duration::ZERO, 0, 200), "{device:?}");
        assert!(frames[8..].iter().all(|frame| frame.source == FrameSource::Generated), "{device:?}");
        // Both take longer than a period.
        let (summary, frames, both) = with_runs_on(device, 30 * MS, 30 * MS);
        assert_eq!(both, Duration::ZERO, "{device:?}");
        assert!((summary.frames_per_s - 1.0 / 0.06).abs() < 0.2, "{}", summary.frames_per_s);
        assert!(frames[8..].iter().all(|frame| frame.source == FrameSource::Generated && frame.age == 60 * MS));
        // Frames alone take longer, so that two would be in flight.
        let (_, _, both) = with_runs_on(device, 70 * MS, 20 * MS);
        assert_eq!(both, Duration::ZERO, "{device:?}");
    }
}

#[test]
fn another_gpu_or_the_processors_generate_while_the_next_frame_is_rendered() {
    let _guard = beside_others();
    for device in [gpu(2), ComputeDevice::Processors] {
        let (summary, frames, both) = with_runs_on(device, 40 * MS, 30 * MS);
        assert_eq!((summary.missed_ticks, summary.presented), (0, 200), "{device:?}");
        assert!(both > SECOND, "{both:?} on {device:?}");
        let generated = frames[8..].iter().filter(|frame| frame.source == FrameSource::Generated).count();
        assert!(
            generated > 180 && frames.iter().all(|frame| frame.age <= 100 * MS),
            "{generated} of 192 on {device:?}"
        );
    }
}
