//! Controls of viewers during a session.

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
fn switching_the_generator_off_shows_rendered_frames_at_once() {
    let _guard = beside_others();
    let (clock, log) = (clock(), Log::default());
    let (sender, controls) = tokio::sync::mpsc::channel(16);
    let viewer = sink("viewer", move |frame| {
        match frame.number {
            50 => sender.try_send(Control::set("enhance", false)).unwrap(),
            100 => sender.try_send(Control::set("enhance", true)).unwrap(),
            // Images generated before this no longer match.
            150 => sender.try_send(Control::set("gain_db", 3.0)).unwrap(),
            _ => {}
        }
        Ok(())
    });
    let enhancer = Some(generator(&clock, 300 * MS));
    let sinks = vec![viewer, logger(&log)];
    Session { enhancer, controls, sinks, ..Session::new(&clock, resting) }.run();
    let frames = seen(&log);
    let source = |n: usize| frames[n].source;
    assert_eq!(source(49), FrameSource::HeldEnhanced);
    assert!((53..100).all(|n| source(n) == FrameSource::LowQuality));
    assert_eq!(source(149), FrameSource::HeldEnhanced);
    assert!((153..157).all(|n| source(n) == FrameSource::LowQuality && frames[n].first_pixel == 4));
    assert_eq!(source(199), FrameSource::HeldEnhanced);
}
