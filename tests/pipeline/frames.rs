//! Cadence, order and states of frames.

use super::*;

#[test]
fn without_a_generator_every_tick_is_a_frame_and_as_old_as_it_took() {
    let _guard = beside_others();
    let (clock, log) = (clock(), Log::default());
    let summary = Session { sinks: vec![logger(&log)], ..Session::new(&clock, moving) }.run();
    let frames = seen(&log);
    assert_eq!((summary.produced, frames.len() as u64), (200, summary.presented));
    assert!(frames.iter().enumerate().all(|(i, f)| f.number == i as u64 && f.age == 20 * MS), "{frames:?}");
    assert!(frames.windows(2).all(|w| w[1].presented - w[0].presented == 50 * MS));
    assert!(frames.iter().all(|f| f.source == FrameSource::Raw && f.generator.is_none() && f.first_pixel == 1));
    let latency = summary.pose_to_present.unwrap();
    assert!(latency.p50_ms >= 25.0 && latency.max_ms < 25.1, "5 ms of age when sampled: {latency:?}");
    assert!((summary.frames_per_s - 20.0).abs() < 0.01);
}

#[test]
fn the_same_session_runs_the_same_way_each_time() {
    let _guard = beside_others();
    let run = || {
        let (clock, log) = (clock(), Log::default());
        let generators = Some(generator(&clock, 63 * MS));
        let session = Session::new(&clock, |now| tracked(now, (now.as_secs_f64() * 3.0).sin().max(0.0)));
        Session { generators, sinks: vec![logger(&log)], service: 37 * MS, ..session }.run();
        seen(&log)
    };
    let first = run();
    assert!(first.len() > 150);
    assert_eq!(first, run());
}

#[test]
fn a_device_slower_than_the_ticks_is_kept_busy_without_a_queue() {
    let _guard = beside_others();
    let (clock, log) = (clock(), Log::default());
    let summary = Session { service: 80 * MS, sinks: vec![logger(&log)], ..Session::new(&clock, moving) }.run();
    let frames = seen(&log);
    assert!(summary.frames_per_s > 12.4, "80 ms a frame: {}", summary.frames_per_s);
    assert!(frames[10..].iter().all(|f| f.age <= 86 * MS), "poses don't wait in the device's queue");
    assert!(summary.missed_ticks > 60, "ticks are counted, not caught up: {}", summary.missed_ticks);
}

#[test]
fn stale_and_lost_poses_are_shown_as_such() {
    let _guard = beside_others();
    let (clock, log) = (clock(), Log::default());
    // Each second: 0.2 s in each state.
    let poses = |now: Duration| {
        let phase = now.as_secs_f64().fract();
        let state = match phase {
            p if p < 0.2 => TrackingState::Good,
            p if p < 0.4 => TrackingState::Held,
            p if p < 0.6 => TrackingState::Stuck,
            p if p < 0.8 => TrackingState::Stale,
            _ => TrackingState::Lost,
        };
        Estimate { state, ..tracked(now, phase) }
    };
    let generators = Some(generator(&clock, 10 * MS));
    let summary = Session { generators, sinks: vec![logger(&log)], ..Session::new(&clock, poses) }.run();
    let frames = seen(&log);
    for frame in &frames {
        let lost = frame.tracking == TrackingState::Lost;
        assert_eq!(frame.x.is_none(), lost, "{frame:?}");
        assert_eq!(frame.first_pixel == 0, lost, "a lost pose has no picture, old or new");
    }
    assert!(summary.by_tracking.iter().all(|n| *n >= 30), "{:?}", summary.by_tracking);
    assert!(frames.windows(2).all(|w| w[1].number == w[0].number + 1 && w[1].presented > w[0].presented));
}

#[test]
fn exactly_as_many_frames_as_were_asked_for() {
    let _guard = beside_others();
    let (clock, log) = (clock(), Log::default());
    let limits = Limits { duration: None, frames: Some(17) };
    let summary = Session { limits, sinks: vec![logger(&log)], ..Session::new(&clock, moving) }.run();
    assert_eq!((summary.presented, seen(&log).len()), (17, 17));
}

#[test]
fn an_observer_hears_every_event_pose_and_setting() {
    let _guard = beside_others();
    let clock = clock();
    let heard = Arc::<Heard>::default();
    let (sender, controls) = tokio::sync::mpsc::channel(1);
    sender.try_send(Control::set("gain_db", 2.0)).unwrap();
    let observer: Option<Arc<dyn Observer>> = Some(heard.clone());
    let faults: Arc<dyn Fn(u64) -> bool + Send + Sync> = Arc::new(|n| n == 20);
    let summary = Session { observer, controls, faults, ..Session::new(&clock, moving) }.run();
    let heard = heard.0.lock().unwrap();
    assert_eq!((heard.poses, heard.settings), (summary.produced, 2), "the settings at the start, and the changed ones");
    assert_eq!(heard.events[0].1, "tracking");
    let (time_ns, text) = &heard.events[1];
    assert!(text.contains("device lost at frame 20"), "{text}");
    assert_eq!((time_ns - START_NS) / 1_000_000, 1020);
}
