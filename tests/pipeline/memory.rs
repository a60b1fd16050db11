//! Memory over thousands of frames.

use super::*;

#[test]
fn nothing_is_allocated_per_frame() {
    let _guard = alone();
    let clock = clock();
    let at = Arc::new([AtomicU64::new(0), AtomicU64::new(0)]);
    let probe_at = at.clone();
    let probe = sink("probe", move |frame| {
        let index = match frame.number {
            400 => 0,
            1400 => 1,
            _ => return Ok(()),
        };
        probe_at[index].store(ALLOCATIONS.load(Ordering::Relaxed), Ordering::Relaxed);
        Ok(())
    });
    let session = Session {
        generators: Some(generator(&clock, 70 * MS)),
        sinks: vec![probe],
        limits: Limits { duration: None, frames: Some(1500) },
        ..Session::new(&clock, moving)
    };
    session.run();
    let [from, to] = [0, 1].map(|i| at[i].load(Ordering::Relaxed));
    assert!(from > 0);
    assert_eq!(to - from, 0, "allocations in a thousand frames");
}

#[test]
fn ten_minutes_with_everything_going_wrong_leave_memory_and_latency_flat() {
    let _guard = alone();
    let clock = clock();
    // A tracker that drops out for three of ten seconds, a generator that is slow and fails, a sink that stalls, a
    // device that is lost every minute.
    let poses = |now: Duration| match now.as_secs() % 10 {
        0..3 => Estimate { state: TrackingState::Lost, ..Estimate::default() },
        3 => Estimate { state: TrackingState::Stale, ..tracked(now, 0.0) },
        second if second < 7 => moving(now),
        _ => resting(now),
    };
    let (clock_of, mut run) = (clock.clone(), 0_u64);
    let work = move |frame: &Frame, out: &mut Vec<u8>| {
        run += 1;
        clock_of.sleep_until(clock_of.now() + (60 + 37 * (run % 5) as u32) * MS);
        if run.is_multiple_of(97) {
            return Err(GenerateError::Failed("NaN".to_owned()));
        }
        out.resize(frame.bmode.len(), 200);
        Ok(())
    };
    let clock_of = clock.clone();
    let stalls = sink("stalls", move |frame| {
        let wait = if frame.number.is_multiple_of(100) { 3000 } else { 70 };
        clock_of.sleep_until(clock_of.now() + wait * MS);
        Ok(())
    });
    let received = Arc::<AtomicU64>::default();
    let received_of = received.clone();
    let slowest = Arc::new(Mutex::new([Duration::ZERO; 10]));
    let slowest_of = slowest.clone();
    let probe = sink("probe", move |frame| {
        received_of.fetch_add(1, Ordering::Relaxed);
        let minute = (frame.info.timeline.presented.as_secs() / 60).min(9) as usize;
        let age = frame.info.timeline.presented - frame.info.timeline.sampled;
        let mut slowest = slowest_of.lock().unwrap();
        slowest[minute] = slowest[minute].max(age);
        Ok(())
    });
    let session = Session {
        generators: Some(translate(work)),
        sinks: vec![stalls, probe],
        faults: Arc::new(|n| n > 0 && n.is_multiple_of(800)),
        limits: Limits { duration: Some(600 * SECOND), frames: None },
        ..Session::new(&clock, poses)
    };
    let mut live = Vec::with_capacity(16);
    let summary = session.run_watched(|status| {
        if status.elapsed_s >= 60.0 * (live.len() + 1) as f64 {
            live.push(LIVE_BYTES.load(Ordering::Relaxed));
        }
    });
    assert_eq!(summary.presented, received.load(Ordering::Relaxed));
    assert!(summary.presented > 11_500, "{}", summary.presented);
    assert_eq!(live.len(), 10);
    assert!((live[9] - live[1]).abs() < 8192, "bytes in use, minute by minute: {live:?}");
    let slowest = slowest.lock().unwrap();
    assert!(slowest.iter().all(|age| *age <= 100 * MS), "{slowest:?}");
    assert!(summary.device_losses >= 8 && summary.device_rebuilt == summary.device_losses);
    assert!(summary.generated_ratio > 0.05, "{}", summary.generated_ratio);
    let stalls = &summary.sinks[0];
    assert!(stalls.dropped > 3000 && !stalls.stuck, "{stalls:?}");
}
