//! Tests of the controls that viewers use during a session.

use super::*;

#[test]
fn freezing_stops_the_picture_while_sliders_still_act() {
    let _guard = beside_others();
    let (clock, log) = (clock(), Log::default());
    let (sender, controls) = tokio::sync::mpsc::channel(16);
    let viewer = sink("viewer", move |frame| {
        let send = |control| sender.try_send(control).unwrap();
        match frame.number {
            40 => send(Control::set("frozen", true)),
            60 => send(Control::set("gain_db", 9.0)),
            80 => send(Control::set("gain_db", 150.0)),
            90 => send(Control::set("gain_db", f64::NAN)),
            100 => send(Control::set("frozen", false)),
            120 => send(Control::Quit),
            _ => {}
        }
        Ok(())
    });
    let session = Session { controls, sinks: vec![viewer, logger(&log)], ..Session::new(&clock, moving) };
    let summary = session.run();
    let frames = seen(&log);
    let frozen: Vec<_> = frames.iter().filter(|f| f.frozen).collect();
    assert!(frozen.len() >= 58 && frozen.iter().all(|f| f.x == frozen[0].x), "{}", frozen.len());
    assert!(frozen.iter().all(|f| f.scene_ds == frozen[0].scene_ds), "what moves in the scene stands still, too");
    assert!(frames[110].scene_ds >= frozen[0].scene_ds + 30, "and goes on at the session's time");
    assert!(frames[45].first_pixel == 1 && frames[65].first_pixel == 10 && frames[110].first_pixel == 10);
    assert!(frames.windows(2).filter(|w| !w[1].frozen).all(|w| w[1].x > w[0].x));
    assert_eq!((summary.controls, summary.controls_refused), (5, 1));
    assert!(frames.iter().any(|f| f.notice.as_ref().is_some_and(|n| n.contains("too loud"))), "the device refused");
    assert!(frames.iter().any(|f| f.notice.as_ref().is_some_and(|n| n.contains("image.gain_db"))));
    assert!(frames.len() < 125 && summary.stuck.is_empty(), "and it ends when a watcher asks for it");
}

#[test]
fn marks_are_noted_in_order_up_to_the_end() {
    let _guard = beside_others();
    let clock = clock();
    let (sender, controls) = tokio::sync::mpsc::channel(16);
    let removal = |id: &str| Control::Unmark(vec![id.to_owned()]);
    let viewer = sink("viewer", move |frame| {
        let send = |control| sender.try_send(control).unwrap();
        match frame.number {
            40 => send(removal("a")),
            // A mark just behind the request for the session's end.
            60 => [Control::Quit, removal("c")].into_iter().for_each(send),
            _ => {}
        }
        Ok(())
    });
    let heard = Arc::new(Heard::default());
    let session = Session {
        controls,
        sinks: vec![viewer],
        observer: Some(heard.clone() as Arc<dyn Observer>),
        ..Session::new(&clock, moving)
    };
    let summary = session.run();
    let marks = heard.0.lock().unwrap().marks.clone();
    assert_eq!(marks.iter().map(|(_, control)| control.clone()).collect::<Vec<_>>(), [removal("a"), removal("c")]);
    assert!(marks[0].0 > 0 && marks[0].0 < marks[1].0 && summary.stuck.is_empty(), "{marks:?}");
}

/// A viewer's request for `rays` rays and three layers.
fn quality(rays: u32) -> Control {
    Control::Set(vec![Assignment::new("rays", rays.into()), Assignment::new("layers", 3.0)])
}

#[test]
fn settings_whose_frames_take_longer_than_a_second_are_taken_back() {
    let _guard = beside_others();
    let (clock, log) = (clock(), Log::default());
    let (sender, controls) = tokio::sync::mpsc::channel(16);
    let viewer = sink("viewer", move |frame| {
        match frame.number {
            40 => sender.try_send(quality(4)).unwrap(),
            60 => sender.try_send(quality(256)).unwrap(),
            _ => {}
        }
        Ok(())
    });
    let extra: Arc<Extra> = Arc::new(|_, quality| match quality.rays {
        256 => 29 * SECOND,
        4 => 900 * MS,
        _ => Duration::ZERO,
    });
    let limits = Limits { duration: Some(120 * SECOND), frames: None };
    let sinks = vec![viewer, logger(&log)];
    let summary = Session { controls, extra, limits, sinks, ..Session::new(&clock, moving) }.run();
    let frames = seen(&log);
    let between: Vec<Duration> = frames.windows(2).map(|w| w[1].presented - w[0].presented).collect();
    let pauses = between.iter().filter(|pause| **pause > 2 * SECOND).count();
    assert!((1..=2).contains(&pauses), "{pauses}: the trial, and the frame submitted before its end");
    // 0.9 s a frame was accepted, and comes again.
    let last = &between[between.len() - 10..];
    assert!(last.iter().all(|pause| (900 * MS..1000 * MS).contains(pause)), "{last:?}");
    let said = frames.iter().filter_map(|frame| frame.notice.as_deref()).find(|notice| notice.contains("not set"));
    assert_eq!(said, Some("not set: a frame (256x3) took 29.0 s, longer than 1 s"));
    assert_eq!((summary.controls, summary.controls_refused), (2, 1));
}

#[test]
fn the_budget_goes_on_choosing_after_a_quality_by_hand_was_taken_back() {
    let _guard = beside_others();
    let clock = clock();
    let (sender, controls) = tokio::sync::mpsc::channel(16);
    let viewer = sink("viewer", move |frame| {
        if frame.number == 40 {
            sender.try_send(quality(256)).unwrap();
        }
        Ok(())
    });
    let candidate = |rays, error, render_ms| Candidate {
        quality: FrameQuality::new(rays, 1),
        generator: None,
        error: BySpeed::all(error),
        render_ms,
        run_ms: 0.0,
    };
    let budget = FrameBudget { frame_ms: Some(40.0), run_ms: 100.0, apart: false, spread: 1.0 };
    let points = PointController::new(vec![candidate(1, 3.0, 10.0), candidate(2, 2.0, 20.0)], vec![], budget);
    // Long after that, two rays exceed the budget.
    let extra: Arc<Extra> = Arc::new(|now, quality| match quality.rays {
        256 => 3 * SECOND,
        2 if now > 60 * SECOND => 30 * MS,
        _ => Duration::ZERO,
    });
    let limits = Limits { duration: Some(80 * SECOND), frames: None };
    let summary =
        Session { controls, extra, points, limits, sinks: vec![viewer], ..Session::new(&clock, moving) }.run();
    assert_eq!(summary.controls_refused, 1);
    let points = summary.points.unwrap();
    assert_eq!((points.begun.as_str(), points.ended.as_str()), ("2x1", "1x1"));
}

#[test]
fn switching_the_generator_off_shows_rendered_frames_at_once() {
    let _guard = beside_others();
    let (clock, log) = (clock(), Log::default());
    let (sender, controls) = tokio::sync::mpsc::channel(16);
    let viewer = sink("viewer", move |frame| {
        match frame.number {
            50 => sender.try_send(Control::set("generator", false)).unwrap(),
            100 => sender.try_send(Control::set("generator", true)).unwrap(),
            // Images generated before this no longer match.
            150 => sender.try_send(Control::set("gain_db", 3.0)).unwrap(),
            _ => {}
        }
        Ok(())
    });
    let generators = Some(generator(&clock, 300 * MS));
    let sinks = vec![viewer, logger(&log)];
    Session { generators, controls, sinks, ..Session::new(&clock, resting) }.run();
    let frames = seen(&log);
    let source = |n: usize| frames[n].source;
    assert_eq!(source(49), FrameSource::HeldGenerated);
    assert!((53..100).all(|n| source(n) == FrameSource::Raw));
    assert_eq!(source(149), FrameSource::HeldGenerated);
    assert!((153..157).all(|n| source(n) == FrameSource::Raw && frames[n].first_pixel == 4));
    assert_eq!(source(199), FrameSource::HeldGenerated);
}
