//! Ticks and latencies of a session. Every tick is accounted for, and a silent tracker counts as no latency.

use insonify::pipeline::ReplayedPoses;
use insonify::pose::{Estimator, Measurement, Reading, Settings as PoseSettings};

use super::*;

/// A tracker that passes through the estimator of a live session.
struct Tracker(ReplayedPoses);

impl Tracker {
    fn new(poses: impl IntoIterator<Item = (Duration, Pose)>) -> Self {
        let measurement = |(time, pose): (Duration, Pose)| Measurement {
            host_time_ns: START_NS + time.as_nanos() as u64,
            device_time_us: None,
            sequence: None,
            reading: Reading::Pose(pose),
        };
        let measurements = poses.into_iter().map(measurement).collect();
        Self(ReplayedPoses::new(Estimator::new(PoseSettings::default()), measurements, &[]))
    }
}

impl PoseSource for Tracker {
    fn sample(&mut self, now_ns: u64, _: u64) -> Estimate {
        self.0.at(now_ns)
    }
}

/// Times of 100 measurements a second for ten seconds, each 3 ms after a multiple of 10 ms.
fn hundredths() -> impl Iterator<Item = Duration> {
    (0..1000).map(|i| 10 * MS * i + 3 * MS)
}

fn lines(written: &Path) -> Vec<Value> {
    let text = std::fs::read_to_string(written).unwrap();
    text.lines().map(|line| serde_json::from_str(line).unwrap()).collect()
}

#[test]
fn every_tick_has_a_frame_or_is_missed() {
    let _guard = beside_others();
    for service in [1, 20, 45, 49, 51, 55, 80, 145, 230, 900] {
        let clock = clock();
        // A pause of the device, too, in which the ticks go on.
        let extra: Arc<Extra> =
            Arc::new(
                |now, _| if (5 * SECOND..5 * SECOND + 200 * MS).contains(&now) { 330 * MS } else { Duration::ZERO },
            );
        let summary = Session { service: MS * service, extra, ..Session::new(&clock, moving) }.run();
        assert_eq!(summary.produced + summary.missed_ticks, 200, "{service} ms: 20 Hz for 10 s");
        assert_eq!((summary.ticks, summary.elapsed_s), (200, 10.0));
        // 5 s at the device's rate or that of the ticks, and two frames in flight.
        let most = 10_000 / u64::from(service.max(50)) + 2;
        assert!(summary.produced <= most, "{service} ms: {} frames", summary.produced);
    }
    // The renderer fails and is built anew; meanwhile most ticks have a black frame, and building takes some.
    let clock = clock();
    let faults: Arc<dyn Fn(u64) -> bool + Send + Sync> = Arc::new(|frame| frame == 50);
    let summary = Session { faults, build_failures: 2, ..Session::new(&clock, moving) }.run();
    assert_eq!((summary.device_losses, summary.produced + summary.missed_ticks), (1, 200));
    assert!(summary.missed_ticks > 5, "{}", summary.missed_ticks);
}

#[test]
fn frames_per_second_are_those_of_the_stated_span() {
    let _guard = beside_others();
    let clock = clock();
    // The tracker takes half a second to end.
    struct Slow(Arc<dyn Clock>, Option<Duration>);
    impl Part for Slow {
        fn name(&self) -> &str {
            "slow"
        }

        fn stop(&mut self) {
            self.1 = Some(self.0.now());
        }

        fn has_ended(&mut self) -> bool {
            self.1.is_some_and(|stopped| self.0.now() >= stopped + 500 * MS)
        }
    }
    clock.sleep_until(2 * SECOND);
    let before: Vec<Box<dyn Part>> = vec![Box::new(Slow(clock.clone(), None))];
    let limits = Limits { duration: Some(8 * SECOND), frames: None };
    let summary = Session { before, limits, service: 200 * MS, ..Session::new(&clock, moving) }.run();
    let (first_s, last_s) = (summary.first_frame_s.unwrap(), summary.last_frame_s.unwrap());
    assert_eq!((summary.elapsed_s, summary.start_ms), (8.0, 2000.0), "neither set-up nor the end counts");
    assert!((first_s - 0.2).abs() < 1e-9 && last_s <= 8.2, "{first_s} {last_s}");
    let stated = summary.frames_per_s * (last_s - first_s);
    assert!((stated - (summary.presented - 1) as f64).abs() < 1e-6, "{stated}");
    let text = summary.to_string();
    assert!(text.starts_with("session            8.0 s, "), "{text}");
    assert!(text.contains(" a second from 0.2 s to "), "{text}");
    assert!(text.contains(&format!("ticks without a frame, of {}", summary.ticks)), "{text}");
}

#[test]
fn the_trackers_silence_is_in_no_latency() {
    let _guard = beside_others();
    let clock = clock();
    let directory = tempfile::tempdir().unwrap();
    let path = directory.path().join("frames.jsonl");
    // Silent from 3 s to 7 s: held, stale, lost, and good again.
    let heard = hundredths().filter(|time| !(3 * SECOND..7 * SECOND).contains(time));
    let poses = Box::new(Tracker::new(heard.map(|time| (time, pose(20.0 * time.as_secs_f64())))));
    let mut statuses = Vec::new();
    let log = Some(FrameLog::create(&path).unwrap());
    let summary = Session { poses, log, ..Session::new(&clock, resting) }
        .run_watched(|status| statuses.push((status.elapsed_s, status.latency_ms)));
    assert!(summary.by_tracking.iter().filter(|count| **count > 5).count() >= 3, "{:?}", summary.by_tracking);
    // A measurement is at most 10 ms old when sampled, and waits up to a tick of 50 ms; a frame takes 20 ms.
    let (newest, all) = (summary.pose_to_present.unwrap(), summary.motion_to_present.unwrap());
    assert!(newest.max_ms <= 31.0 && newest.p50_ms >= 20.0, "{newest:?}");
    assert!(all.max_ms <= 81.0 && all.max_ms > 60.0, "{all:?}");
    assert!((all.p50_ms - (newest.p50_ms + 20.0)).abs() < 8.0, "half a tick more: {all:?} {newest:?}");
    let a_frame = all.count as f64 / newest.count as f64;
    assert!((a_frame - 5.0).abs() < 0.2, "five measurements a frame: {a_frame}");
    assert!(statuses.iter().all(|(_, ms)| ms.is_none_or(|ms| ms < 35.0)), "{statuses:?}");
    let silent = statuses.iter().filter(|(elapsed_s, _)| (6.2..6.9).contains(elapsed_s));
    assert!(silent.clone().count() > 0 && silent.clone().all(|(_, ms)| ms.is_none()), "{statuses:?}");

    for line in &lines(&path) {
        let at = |key: &str| line[key].as_f64();
        let is_silent = (3_100.0..7_000.0).contains(&at("sampled_ms").unwrap());
        match at("pose_to_present_ms") {
            Some(ms) => assert!(!is_silent && ms <= 31.0 && line["new_measurements"].as_u64() > Some(0), "{line}"),
            None => assert!(line["tracking"] != "good" || line["new_measurements"] == 0, "{line}"),
        }
    }
}

#[test]
fn a_jump_counts_from_the_measurement_that_was_held_back() {
    let _guard = beside_others();
    let clock = clock();
    let directory = tempfile::tempdir().unwrap();
    let path = directory.path().join("frames.jsonl");
    // 200 mm away from one measurement to the next, at 3, 5 and 7 s.
    let far = |time: Duration| time.as_secs().saturating_sub(1) / 2 % 2 == 1;
    let poses = hundredths().map(|time| (time, pose(if far(time) { 200.0 } else { 0.0 } + time.as_secs_f64())));
    let log = Some(FrameLog::create(&path).unwrap());
    let summary = Session { poses: Box::new(Tracker::new(poses)), log, ..Session::new(&clock, resting) }.run();
    let jumps = summary.jump_to_present.unwrap();
    assert_eq!(jumps.count, 4, "at 3, 5, 7 and 9 s");
    // The jump comes 3 ms after a tick, its confirmation 10 ms later; the next tick is 47 ms later, and its frame takes 20 ms.
    assert!((67.0..=69.5).contains(&jumps.p50_ms) && (67.0..=69.5).contains(&jumps.max_ms), "{jumps:?}");
    let stated: Vec<f64> = lines(&path).iter().filter_map(|line| line["jump_to_present_ms"].as_f64()).collect();
    assert!(stated.len() == 4 && stated.iter().all(|ms| (ms - 67.0).abs() < 0.1), "{stated:?}");
    let longest = summary.motion_to_present.unwrap().max_ms;
    assert!(longest >= jumps.max_ms && summary.pose_to_present.unwrap().max_ms < 31.0, "{longest}");
}

#[test]
fn measurements_of_dropped_frames_count_in_the_next_one() {
    let _guard = beside_others();
    let clock = clock();
    // The device is lost with every tenth frame.
    let faults: Arc<dyn Fn(u64) -> bool + Send + Sync> = Arc::new(|frame| frame % 10 == 9);
    let poses = Box::new(Tracker::new(hundredths().map(|time| (time, pose(time.as_secs_f64())))));
    let summary = Session { poses, faults, ..Session::new(&clock, resting) }.run();
    assert!(summary.device_losses > 5);
    let counted = summary.motion_to_present.unwrap().count;
    // Those before the first good pose, and after the last frame, are shown in none.
    assert!((900..=1000).contains(&counted), "{counted}");
}
