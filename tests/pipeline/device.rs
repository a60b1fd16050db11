//! Loss of the device during a session.

use super::*;

#[test]
fn a_lost_device_is_built_anew_and_its_frames_are_counted() {
    let _guard = beside_others();
    let (clock, log) = (clock(), Log::default());
    let faults: Arc<dyn Fn(u64) -> bool + Send + Sync> = Arc::new(|n| n == 50 || n == 90);
    let session = Session { faults, build_failures: 3, sinks: vec![logger(&log)], ..Session::new(&clock, moving) };
    let summary = session.run();
    let frames = seen(&log);
    assert_eq!((summary.device_losses, summary.device_rebuilt), (2, 2));
    assert_eq!(summary.drops["lost with the device"], 2);
    let black: Vec<_> = frames.iter().filter(|f| f.x.is_none()).collect();
    assert!(!black.is_empty() && black.iter().all(|f| f.first_pixel == 0));
    assert!(black.iter().all(|f| f.notice.is_some()), "a black frame says why");
    assert!(frames.last().unwrap().x.is_some(), "and there are pictures again");
    assert!(frames.iter().any(|f| f.notice.as_ref().is_some_and(|n| n.contains("still no driver"))));
    // Three failures wait 0.25 + 0.5 + 1 s, each attempt takes 0.2 s.
    let gap = frames.windows(2).map(|w| w[1].presented - w[0].presented).max().unwrap();
    assert!(gap <= 300 * MS, "black frames go on between attempts: {gap:?}");
}

#[test]
fn a_device_that_is_lost_at_once_each_time_is_not_opened_in_a_loop() {
    let _guard = beside_others();
    let clock = clock();
    let limits = Limits { duration: Some(60 * SECOND), frames: None };
    let session = Session { faults: Arc::new(|n| n > 20), limits, ..Session::new(&clock, moving) };
    let summary = session.run();
    assert!((10..25).contains(&summary.device_losses), "{}", summary.device_losses);
}
