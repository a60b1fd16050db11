//! Sinks that block, fail or panic.

use super::*;

#[test]
fn a_sink_that_blocks_for_ever_harms_nobody_also_not_at_the_end() {
    let _guard = beside_others();
    let (clock, log) = (clock(), Log::default());
    let clock_of = clock.clone();
    let dead = sink("dead", move |frame| {
        if frame.number == 10 {
            clock_of.sleep_until(NEVER);
        }
        Ok(())
    });
    let summary = Session { sinks: vec![dead, logger(&log)], ..Session::new(&clock, moving) }.run();
    assert_eq!(seen(&log).len(), 200);
    let [dead, log] = &summary.sinks[..] else { panic!() };
    assert!(dead.stuck && dead.taken == 10 && dead.dropped == 189, "{dead:?}");
    assert_eq!((log.taken, log.dropped, log.stuck), (200, 0, false));
    assert_eq!(summary.stuck, ["dead"]);
    assert!(clock.now() < 25 * SECOND, "the end is bounded");
}

#[test]
fn a_sink_that_really_blocks_is_left_behind_on_the_machines_clock() {
    let _guard = beside_others();
    let clock: Arc<dyn Clock> = Arc::new(SystemClock::new());
    let (_never, blocks) = mpsc::channel::<()>();
    let dead = sink("dead", move |_| {
        let _ = blocks.recv();
        Ok(())
    });
    let log = Log::default();
    let mut session = Session::new(&clock, |_| Estimate {
        scene_from_probe: Some(pose(0.0)),
        state: TrackingState::Good,
        ..Estimate::default()
    });
    session.poses = Box::new(insonify::pipeline::StandingPose(pose(0.0)));
    session.sinks = vec![dead, logger(&log)];
    session.service = MS;
    session.settings.frame_rate_hz = 200.0;
    // The others must end in that time, however busy the machine is.
    session.settings.finish_ms = 2000.0;
    session.limits = Limits { duration: None, frames: Some(5) };
    let summary = session.run();
    assert_eq!((summary.presented, summary.stuck), (5, vec!["dead".to_owned()]));
}

#[test]
fn a_sink_that_fails_again_and_again_is_closed_and_one_that_fails_once_is_not() {
    let _guard = beside_others();
    let (clock, log) = (clock(), Log::default());
    let full = sink("full disk", |frame| if frame.number < 3 { Ok(()) } else { Err(broken()) });
    let hiccup = sink("hiccup", |frame| if frame.number.is_multiple_of(7) { Err(broken()) } else { Ok(()) });
    let summary = Session { sinks: vec![full, hiccup, logger(&log)], ..Session::new(&clock, moving) }.run();
    let [full, hiccup, _] = &summary.sinks[..] else { panic!() };
    assert_eq!((full.taken, full.failed, full.dropped, full.stuck), (3, 5, 192, false));
    assert!(full.error.as_ref().unwrap().contains("5 times in a row"));
    assert_eq!((hiccup.failed, hiccup.taken, hiccup.error.is_none()), (29, 171, true));
    let said = seen(&log).iter().any(|f| f.notice.as_ref().is_some_and(|n| n.contains("full disk")));
    assert!(said, "whoever watches another sink hears of it");
}

#[test]
fn a_sink_that_panics_is_closed() {
    let _guard = beside_others();
    let (clock, log) = (clock(), Log::default());
    let panics = sink("panics", |frame| {
        if frame.number == 4 {
            std::panic::resume_unwind(Box::new("a bug"));
        }
        Ok(())
    });
    let session = Session { sinks: vec![panics, logger(&log)], ..Session::new(&clock, moving) };
    let summary = session.run();
    assert_eq!(seen(&log).len(), 200);
    let panics = &summary.sinks[0];
    assert_eq!((panics.taken, panics.failed, panics.error.as_deref()), (4, 1, Some("it panicked")));
}
