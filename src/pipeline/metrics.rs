//! Metrics of a session, in constant memory.

use std::collections::VecDeque;
use std::sync::Mutex;
use std::sync::atomic::{AtomicU64, Ordering};
use std::time::Duration;

use serde::Serialize;

use super::clock::{lock, ms, smoothed};
use super::histogram::Histogram;
use super::summary::MisplacedSummary;
use crate::chooser::PointSummary;
use crate::pose::TrackingState;
use crate::presented::{FrameInfo, FrameSource, PresentedFrame};
use crate::statistics::upper_median;
use crate::transducer::Misplacement;
use crate::transducer::placement::Untouched;

/// Limits of the recent frames behind the live figures: largest number of frames, and longest time between their
/// presentation and the last frame's presentation.
const RECENT: usize = 64;
const RECENT_TIME: Duration = Duration::from_secs(3);

/// Limits that a pause without frames must both exceed to be reported: a duration, and a number of recent intervals.
const SILENCE: (Duration, f64) = (Duration::from_secs(2), 3.0);

/// Weight of the latest frame in the expected time from sampling to presentation.
const WEIGHT: f64 = 0.1;

/// Current state of a session.
#[derive(Debug, Clone, PartialEq, Serialize)]
pub struct Status {
    /// Time since the start of the session, s.
    pub elapsed_s: f64,
    /// Number of frames presented.
    pub presented: u64,
    /// Recent frame rate, Hz; 0 during a reported pause.
    pub frames_per_s: f64,
    /// Time since the last frame, s, if it is unusually long.
    pub silent_s: Option<f64>,
    /// Median pose-to-present latency of the last 3 s, ms; none without a new pose in that time.
    pub latency_ms: Option<f64>,
    /// Tracking state of the shown pose.
    #[serde(skip)]
    pub tracking: TrackingState,
    /// Source of the shown picture.
    #[serde(skip)]
    pub source: FrameSource,
    /// Whether the picture is frozen.
    pub frozen: bool,
    /// Impossible placement of the probe, if it has lasted for some seconds.
    pub misplaced: Option<Misplacement>,
    /// Number of frames begun but not presented.
    pub dropped: u64,
    /// Number of damaged pieces of the tracker's stream.
    pub damaged: u64,
    /// Recent fault, as the frames show it; none if there was none.
    pub notice: Option<String>,
}

/// Counters and statistics that the stages update while they run.
#[derive(Debug, Default)]
pub(super) struct Metrics {
    /// Number of frames begun.
    pub(super) produced: AtomicU64,
    /// Number of frames lost with the rendering device.
    pub(super) device_lost: AtomicU64,
    /// Number of frames dropped because stages or sinks held all buffers.
    pub(super) frames_held: AtomicU64,
    /// Number of frames not presented because the session ended.
    pub(super) ended: AtomicU64,
    /// Number of ticks of the frame rate without a frame.
    pub(super) missed_ticks: AtomicU64,
    /// Number of times that the rendering device was lost.
    pub(super) losses: AtomicU64,
    /// Number of times that a lost device was opened again.
    pub(super) rebuilt: AtomicU64,
    /// Numbers of controls applied and refused.
    pub(super) controls: AtomicU64,
    pub(super) refused: AtomicU64,
    /// Expected time from sampling to presentation, ns.
    expected_ns: AtomicU64,
    /// Summary of the operating points so far; none without a controller of operating points.
    points: Mutex<Option<PointSummary>>,
    shown: Mutex<Shown>,
}

/// Statistics of presented frames.
#[derive(Debug, Default)]
pub(super) struct Shown {
    pub(super) presented: u64,
    pub(super) by_source: [u64; 3],
    pub(super) by_tracking: [u64; 5],
    pub(super) misplaced: MisplacedSummary,
    pub(super) pose_to_present: Histogram,
    pub(super) motion_to_present: Histogram,
    pub(super) jump_to_present: Histogram,
    pub(super) sample_to_present: Histogram,
    pub(super) render: Histogram,
    pub(super) inference: Histogram,
    pub(super) first: Option<Duration>,
    pub(super) last: Duration,
    recent: Recent,
    tracking: TrackingState,
    source: FrameSource,
    frozen: bool,
    /// Impossible placement of the probe in the last frame, if any.
    placed: Option<Misplacement>,
}

/// Recent frames: presentation time, and pose-to-present latency if known.
#[derive(Debug, Default)]
struct Recent {
    frames: VecDeque<(Duration, Option<Duration>)>,
}

impl Recent {
    fn push(&mut self, presented: Duration, latency: Option<Duration>) {
        if self.frames.len() == RECENT {
            self.frames.pop_front();
        }
        self.frames.push_back((presented, latency));
    }

    /// Frames within `RECENT_TIME` of the last one, newest first. The last two frames are always included.
    fn latest(&self) -> impl Iterator<Item = &(Duration, Option<Duration>)> {
        let from = self.frames.back().map_or(Duration::ZERO, |(last, _)| last.saturating_sub(RECENT_TIME));
        self.frames
            .iter()
            .rev()
            .enumerate()
            .take_while(move |(nth, (time, _))| *nth < 2 || *time >= from)
            .map(|(_, f)| f)
    }

    fn frames_per_s(&self) -> f64 {
        match (self.latest().last(), self.frames.back()) {
            (Some((first, _)), Some((last, _))) if last > first => {
                self.latest().skip(1).count() as f64 / (*last - *first).as_secs_f64()
            }
            _ => 0.0,
        }
    }

    /// Median latency of the frames within `RECENT_TIME` before `now`, ms; none if no such frame has a latency.
    fn median_ms(&self, now: Duration) -> Option<f64> {
        let from = now.saturating_sub(RECENT_TIME);
        let mut latencies = [Duration::ZERO; RECENT];
        let known = self.latest().filter(|(time, _)| *time >= from).filter_map(|(_, latency)| *latency);
        let count = latencies.iter_mut().zip(known).map(|(slot, latency)| *slot = latency).count();
        let latencies = latencies.get_mut(..count)?;
        latencies.sort_unstable();
        upper_median(latencies).map(ms)
    }
}

/// Adds one to a counter.
pub(super) fn count(counter: &AtomicU64) {
    counter.fetch_add(1, Ordering::Relaxed);
}

/// Value of a counter.
pub(super) fn counted(counter: &AtomicU64) -> u64 {
    counter.load(Ordering::Relaxed)
}

impl Metrics {
    /// Records a frame that is handed to the sinks. Returns the number of frames presented so far, including it.
    pub(super) fn presented(&self, frame: &PresentedFrame) -> u64 {
        let mut shown = lock(&self.shown);
        let FrameInfo { estimate, timeline: times, settings, .. } = &frame.info;
        let total = times.presented.saturating_sub(times.sampled);
        let latency = frame.info.pose_to_present();
        latency.into_iter().for_each(|time| shown.pose_to_present.push(time));
        frame.info.motion_to_present().for_each(|time| shown.motion_to_present.push(time));
        frame.info.jump_to_present().into_iter().for_each(|time| shown.jump_to_present.push(time));
        if estimate.scene_from_probe.is_some() {
            shown.sample_to_present.push(total);
            shown.render.push(times.rendered.saturating_sub(times.submitted));
            let expected = smoothed(self.expected(), total, WEIGHT);
            self.expected_ns.store(u64::try_from(expected.as_nanos()).unwrap_or(u64::MAX), Ordering::Relaxed);
        }
        if let Some((start, end)) = times.inference {
            shown.inference.push(end.saturating_sub(start));
        }
        shown.by_source[frame.source as usize] += 1;
        shown.by_tracking[estimate.state as usize] += 1;
        shown.misplaced.count(frame.info.misplaced);
        shown.recent.push(times.presented, latency);
        shown.first.get_or_insert(times.presented);
        shown.last = times.presented;
        (shown.tracking, shown.source, shown.frozen) = (estimate.state, frame.source, settings.frozen);
        shown.placed = frame.info.misplaced;
        shown.presented += 1;
        shown.presented
    }

    /// Expected time from sampling to presentation, from recent frames.
    pub(super) fn expected(&self) -> Duration {
        Duration::from_nanos(self.expected_ns.load(Ordering::Relaxed))
    }

    /// Stores the summary of the operating points so far.
    pub(super) fn set_points(&self, summary: PointSummary) {
        *lock(&self.points) = Some(summary);
    }

    /// Summary of the operating points so far; none without a controller of operating points.
    pub(super) fn points(&self) -> Option<PointSummary> {
        lock(&self.points).clone()
    }

    /// Stores the finding that the probe has never touched the skin; `None` once it has touched it.
    pub(super) fn set_untouched(&self, untouched: Option<Untouched>) {
        lock(&self.shown).misplaced.untouched = untouched;
    }

    /// Calls `look` with the statistics of presented frames.
    pub(super) fn shown<R>(&self, look: impl FnOnce(&Shown) -> R) -> R {
        look(&lock(&self.shown))
    }

    /// Status at `now` of a session whose stages started at `started_at`.
    pub(super) fn status(
        &self,
        [started_at, now]: [Duration; 2],
        dropped: u64,
        damaged: u64,
        notice: Option<String>,
    ) -> Status {
        self.shown(|shown| {
            let (rate, since) = (shown.recent.frames_per_s(), now.saturating_sub(shown.last.max(started_at)));
            let is_silent = since > SILENCE.0 && since.as_secs_f64() * rate > SILENCE.1;
            let silent_s = (is_silent || (shown.presented < 2 && since > SILENCE.0)).then_some(since.as_secs_f64());
            Status {
                elapsed_s: now.saturating_sub(started_at).as_secs_f64(),
                presented: shown.presented,
                frames_per_s: if silent_s.is_some() { 0.0 } else { rate },
                silent_s,
                latency_ms: shown.recent.median_ms(now),
                tracking: shown.tracking,
                source: shown.source,
                frozen: shown.frozen,
                misplaced: shown.placed,
                dropped,
                damaged,
                notice,
            }
        })
    }
}

/// Resident memory of this process, bytes; none if the system does not report it.
pub(crate) fn memory_bytes() -> Option<u64> {
    let status = std::fs::read_to_string("/proc/self/status").ok()?;
    let line = status.lines().find(|line| line.starts_with("VmRSS:"))?;
    let kib: u64 = line.split_whitespace().nth(1)?.parse().ok()?;
    Some(kib * 1024)
}

#[cfg(test)]
mod tests {
    use super::*;
    use crate::pose::Pose;

    fn presented_at(metrics: &Metrics, ms: u64) {
        let mut frame = PresentedFrame::default();
        frame.info.timeline.presented = Duration::from_millis(ms);
        metrics.presented(&frame);
    }

    /// Status at a time of a session that started with its clock.
    fn status(metrics: &Metrics, ms: u64) -> Status {
        metrics.status([Duration::ZERO, Duration::from_millis(ms)], 0, 0, None)
    }

    #[test]
    fn the_status_says_that_no_frame_comes() {
        let metrics = Metrics::default();
        let at = |ms: u64| {
            let status = status(&metrics, ms);
            (status.frames_per_s.round(), status.silent_s)
        };
        assert_eq!((at(1000), at(2500)), ((0.0, None), (0.0, Some(2.5))));
        (0..20).for_each(|i| presented_at(&metrics, 3000 + 50 * i));
        assert_eq!((at(3960), at(5000)), ((20.0, None), (20.0, None)));
        assert_eq!(at(33_950), (0.0, Some(30.0)));
        // Pauses that are long for a fast rate are usual at a slow one.
        let slow = Metrics::default();
        (0..20).for_each(|i| presented_at(&slow, 5000 * i));
        let silent_s = |ms| status(&slow, ms).silent_s;
        assert_eq!((silent_s(99_000), silent_s(115_000)), (None, Some(20.0)));
    }

    #[test]
    fn the_latency_is_that_of_the_last_seconds() {
        let metrics = Metrics::default();
        let shown_at = |ms: u64| {
            let mut frame = PresentedFrame::default();
            frame.info.estimate.scene_from_probe = Some(Pose::IDENTITY);
            frame.info.timeline.sampled = Duration::from_millis(ms - 70);
            frame.info.timeline.presented = Duration::from_millis(ms);
            metrics.presented(&frame);
        };
        (1..4).for_each(|i| shown_at(7000 * i));
        let latency_ms = |ms| status(&metrics, ms).latency_ms;
        assert_eq!((latency_ms(21_000), latency_ms(24_000)), (Some(70.0), Some(70.0)));
        assert_eq!((latency_ms(24_001), latency_ms(27_000)), (None, None), "no frame came");
    }

    #[test]
    fn the_time_before_the_stages_start_is_no_silence() {
        let metrics = Metrics::default();
        // Opening sinks took eight seconds.
        let at = |ms: u64| {
            let status = metrics.status([8000, 8000 + ms].map(Duration::from_millis), 0, 3, None);
            (status.elapsed_s, status.silent_s, status.damaged)
        };
        assert_eq!((at(300), at(2500)), ((0.3, None, 3), (2.5, Some(2.5), 3)));
    }

    #[test]
    fn the_rate_is_that_of_the_last_seconds() {
        let metrics = Metrics::default();
        (0..20).for_each(|i| presented_at(&metrics, 50 * i));
        // A pause of 30 s, and then the same rate as before.
        (0..80).for_each(|i| presented_at(&metrics, 31_000 + 50 * i));
        let rate = status(&metrics, 34_960).frames_per_s;
        assert!((rate - 20.0).abs() < 1e-6, "{rate}");
        let soon = Metrics::default();
        (0..20).for_each(|i| presented_at(&soon, 50 * i));
        (0..11).for_each(|i| presented_at(&soon, 31_000 + 50 * i));
        let rate = status(&soon, 31_510).frames_per_s;
        assert!((rate - 20.0).abs() < 1e-6, "the pause is over: {rate}");
    }

    #[cfg(target_os = "linux")]
    #[test]
    fn this_process_takes_memory() {
        assert!(memory_bytes().unwrap() > 1 << 20);
    }
}
