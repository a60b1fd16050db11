//! Sessions whose generator hangs.

use super::*;

#[test]
fn a_generator_that_hangs_for_ever_leaves_the_station_at_rendered_frames() {
    let _guard = beside_others();
    let (clock, log) = (clock(), Log::default());
    let (clock_of, mut run) = (clock.clone(), 0);
    let work = move |frame: &Frame, out: &mut Vec<u8>| {
        run += 1;
        clock_of.sleep_until(if run == 40 { NEVER } else { clock_of.now() + 20 * MS });
        out.resize(frame.bmode.len(), 200);
        Ok(())
    };
    let generators = Some(translate(work));
    let summary = Session { generators, sinks: vec![logger(&log)], ..Session::new(&clock, moving) }.run();
    let frames = seen(&log);
    // The frame that waited for its deadline comes together with the next one, which replaces it at the sink.
    assert_eq!((summary.presented, frames.len()), (200, 199), "{summary:?}");
    assert_eq!(changes(&frames), (2, false));
    assert!(frames.iter().all(|f| f.age <= 100 * MS));
    assert!(frames[45..].iter().all(|f| f.source == FrameSource::Raw));
    assert!(frames.iter().any(|f| f.notice.as_ref().is_some_and(|n| n.contains("hangs on frame"))));
    let generator = summary.generator.unwrap();
    assert_eq!((generator.hung, generator.given_up, generator.stuck, generator.done), (1, 1, true, 39));
    assert_eq!(summary.stuck, ["generator"]);
}

#[test]
fn a_generator_that_does_not_heed_its_termination_is_given_up_and_may_come_back() {
    let _guard = beside_others();
    let (clock, log) = (clock(), Log::default());
    let told = Arc::<AtomicU64>::default();
    let (clock_of, told_of, mut run) = (clock.clone(), told.clone(), 0);
    let work = move |frame: &Frame, out: &mut Vec<u8>| {
        run += 1;
        // Run 40 returns long after its termination, run 60 never does.
        let time = match run {
            40 => 5 * SECOND,
            60 => NEVER,
            _ => 20 * MS,
        };
        clock_of.sleep_until(clock_of.now().saturating_add(time));
        out.resize(frame.bmode.len(), 200);
        Ok(())
    };
    let terminator: Terminator = Arc::new(move || {
        told_of.fetch_add(1, Ordering::Relaxed);
    });
    let generators: Option<Box<dyn FrameGenerators>> =
        Some(Box::new(Translate { work, terminator: Some(terminator), compute_device: gpu(2) }));
    let limits = Limits { duration: Some(20 * SECOND), frames: None };
    let summary = Session { generators, limits, sinks: vec![logger(&log)], ..Session::new(&clock, moving) }.run();
    let frames = seen(&log);
    assert_eq!(summary.presented, 400, "the cadence holds");
    assert_eq!(changes(&frames), (4, false), "generated, rendered, generated, rendered");
    assert!(frames.iter().all(|f| f.age <= 100 * MS));
    for (from_s, words) in [(4.0, "is told to end"), (5.0, "is given up"), (11.5, "is given up")] {
        let said = |f: &&Seen| f.notice.as_ref().is_some_and(|n| n.contains(words));
        let first = frames.iter().find(|f| f.presented.as_secs_f64() >= from_s && said(f));
        assert!(first.is_some_and(|f| f.presented.as_secs_f64() < from_s + 1.5), "{words}: {first:?}");
    }
    let generator = summary.generator.unwrap();
    // The end of the session terminates the last one again.
    assert_eq!((generator.hung, generator.given_up, told.load(Ordering::Relaxed)), (2, 2, 3));
    assert!(generator.stuck && summary.stuck == ["generator"], "{generator:?}");
    let after = frames.iter().filter(|f| f.presented.as_secs_f64() > 11.0).all(|f| f.source == FrameSource::Raw);
    assert!(after, "nobody waits for one that is given up");
}

#[test]
fn a_generator_that_hangs_is_terminated_where_its_provider_can() {
    let _guard = beside_others();
    let (clock, log) = (clock(), Log::default());
    let stop_run = Arc::new(insonify::pipeline::Signal::default());
    let (clock_of, clock_too, stopped, stops, mut run) = (clock.clone(), clock.clone(), stop_run.clone(), stop_run, 0);
    let work = move |frame: &Frame, out: &mut Vec<u8>| {
        run += 1;
        if run == 40 {
            clock_of.wait(&stopped, stopped.generation(), NEVER);
            return Err(GenerateError::Terminated);
        }
        clock_of.sleep_until(clock_of.now() + 20 * MS);
        out.resize(frame.bmode.len(), 200);
        Ok(())
    };
    let terminator: Option<Terminator> = Some(Arc::new(move || clock_too.notify(&stops)));
    let generators: Option<Box<dyn FrameGenerators>> =
        Some(Box::new(Translate { work, terminator, compute_device: gpu(2) }));
    let summary = Session { generators, sinks: vec![logger(&log)], ..Session::new(&clock, moving) }.run();
    let frames = seen(&log);
    assert_eq!(changes(&frames), (3, false), "and it comes back");
    let generator = summary.generator.unwrap();
    assert_eq!((generator.hung, generator.stuck, generator.failed), (1, false, 1));
    assert!(summary.stuck.is_empty());
}

#[test]
fn a_run_hangs_after_the_stations_own_time_and_not_after_its_budget() {
    let _guard = beside_others();
    let hung = |pipeline: &str| {
        let directory = std::path::Path::new(env!("CARGO_MANIFEST_DIR")).join("configs");
        let text = std::fs::read_to_string(directory.join("live.toml")).unwrap();
        let text = text.replace("[pipeline]", &format!("[pipeline]\n{pipeline}"));
        let station = insonify::Station::parse(&text, &directory).unwrap();
        assert_eq!(station.generator.run_budget_ms, 64.0);
        let clock = clock();
        let generators = Some(generator(&clock, 400 * MS));
        let limits = Limits { duration: Some(5 * SECOND), frames: None };
        let session = Session { generators, limits, settings: station.pipeline, ..Session::new(&clock, resting) };
        let generator = session.run().generator.unwrap();
        assert!(generator.done > 5, "{generator:?}");
        generator.hung
    };
    assert_eq!(hung(""), 0, "5 s by default");
    assert!(hung("hang_ms = 200") > 5);
}
