//! What a session measured, in memory of a fixed size.

use std::collections::BTreeMap;
use std::sync::Mutex;
use std::sync::atomic::{AtomicU64, Ordering};
use std::time::Duration;

use serde::Serialize;

use super::clock::lock;
use crate::pose::TrackingState;
use crate::sink::live::{FrameSource, PresentedFrame};

/// Steps of a histogram in each doubling: a percentile is exact within 1/32.
const STEPS: usize = 32;

/// Doublings of a histogram, from 1 µs to 36 minutes.
const DOUBLINGS: usize = 32;

/// Frames behind the live figures.
const RECENT: usize = 64;

/// Weight of the latest frame in the expected time from sampling to presentation.
const WEIGHT: f64 = 0.1;

/// Times of any number of frames.
#[derive(Debug, Clone)]
pub struct Histogram {
    counts: Box<[u64]>,
    count: u64,
    max: Duration,
}

impl Default for Histogram {
    fn default() -> Self {
        Self { counts: vec![0; STEPS * DOUBLINGS].into(), count: 0, max: Duration::ZERO }
    }
}

impl Histogram {
    /// Adds a time.
    pub fn push(&mut self, time: Duration) {
        let us = u64::try_from(time.as_micros()).unwrap_or(u64::MAX);
        if let Some(count) = self.counts.get_mut(bucket(us).min(STEPS * DOUBLINGS - 1)) {
            *count += 1;
        }
        self.count += 1;
        self.max = self.max.max(time);
    }

    /// Times added.
    pub fn count(&self) -> u64 {
        self.count
    }

    /// The percentile `percent` (0..=100), by nearest rank, at most 1/32 above the true one. None of no times.
    pub fn percentile(&self, percent: f64) -> Option<Duration> {
        let rank = ((percent / 100.0 * self.count as f64).ceil() as u64).clamp(1, self.count.max(1));
        let mut below = 0;
        let index = self.counts.iter().position(|count| {
            below += count;
            below >= rank
        })?;
        Some(Duration::from_micros(upper_bound(index)).min(self.max))
    }

    /// p50, p95, p99 and the greatest. None of no times.
    pub fn percentiles(&self) -> Option<Percentiles> {
        let ms = |percent| self.percentile(percent).map(|time| time.as_secs_f64() * 1e3);
        Some(Percentiles {
            count: self.count,
            p50_ms: ms(50.0)?,
            p95_ms: ms(95.0)?,
            p99_ms: ms(99.0)?,
            max_ms: self.max.as_secs_f64() * 1e3,
        })
    }
}

/// Index of the bucket of a time in µs: linear up to 32 µs, then 32 steps a doubling.
fn bucket(us: u64) -> usize {
    let steps = STEPS as u64;
    if us < steps {
        return us as usize;
    }
    let doubling = us.ilog2() - STEPS.ilog2();
    ((u64::from(doubling) + 1) * steps + (us >> doubling) - steps) as usize
}

/// Greatest time of a bucket, µs.
fn upper_bound(index: usize) -> u64 {
    let (doubling, step) = (index / STEPS, (index % STEPS) as u64);
    match doubling.checked_sub(1) {
        None => step,
        Some(doubling) => ((STEPS as u64 + step + 1) << doubling) - 1,
    }
}

/// Percentiles of many times.
#[derive(Debug, Clone, Copy, PartialEq, Serialize)]
pub struct Percentiles {
    /// Times behind them.
    pub count: u64,
    /// Median, ms.
    pub p50_ms: f64,
    /// 95th percentile, ms.
    pub p95_ms: f64,
    /// 99th percentile, ms.
    pub p99_ms: f64,
    /// Greatest, ms.
    pub max_ms: f64,
}

/// How a session goes right now.
#[derive(Debug, Clone, PartialEq, Serialize)]
pub struct Status {
    /// Since the session began, s.
    pub elapsed_s: f64,
    /// Frames presented.
    pub presented: u64,
    /// Frames a second lately.
    pub frames_per_s: f64,
    /// Median of the last frames' pose-to-present, ms.
    pub latency_ms: Option<f64>,
    /// How far the pose can be trusted.
    #[serde(skip)]
    pub tracking: TrackingState,
    /// Which picture is shown.
    #[serde(skip)]
    pub source: FrameSource,
    /// Whether the picture stands still.
    pub frozen: bool,
    /// Frames that were begun and not presented.
    pub dropped: u64,
    /// What went wrong lately.
    pub notice: Option<String>,
}

/// Counted by the stages while they run.
#[derive(Debug, Default)]
pub(super) struct Metrics {
    /// Frames begun.
    pub(super) produced: AtomicU64,
    /// Frames lost with the device.
    pub(super) device_lost: AtomicU64,
    /// Frames for which no memory was left, since all of it was held by stages or sinks.
    pub(super) frames_held: AtomicU64,
    /// Frames that the end came before.
    pub(super) ended: AtomicU64,
    /// Ticks without a frame.
    pub(super) missed_ticks: AtomicU64,
    /// Devices lost.
    pub(super) losses: AtomicU64,
    /// Devices rebuilt.
    pub(super) rebuilt: AtomicU64,
    /// Controls applied, and refused.
    pub(super) controls: AtomicU64,
    pub(super) refused: AtomicU64,
    /// Expected time from sampling to presentation, ns.
    expected_ns: AtomicU64,
    shown: Mutex<Shown>,
}

/// What is known of presented frames.
#[derive(Debug, Default)]
pub(super) struct Shown {
    pub(super) presented: u64,
    pub(super) by_source: [u64; 3],
    pub(super) by_tracking: [u64; 4],
    pub(super) pose_to_present: Histogram,
    pub(super) sample_to_present: Histogram,
    pub(super) render: Histogram,
    pub(super) inference: Histogram,
    pub(super) first: Option<Duration>,
    pub(super) last: Duration,
    last_first_byte: Option<Duration>,
    recent: Recent,
    tracking: TrackingState,
    source: FrameSource,
    frozen: bool,
}

/// The last frames: when each was presented, and its pose-to-present.
#[derive(Debug, Default)]
struct Recent {
    frames: Vec<(Duration, Option<Duration>)>,
    next: usize,
}

impl Recent {
    fn push(&mut self, presented: Duration, latency: Option<Duration>) {
        if self.frames.len() < RECENT {
            self.frames.reserve_exact(RECENT);
            self.frames.push((presented, latency));
        } else if let Some(frame) = self.frames.get_mut(self.next) {
            *frame = (presented, latency);
            self.next = (self.next + 1) % RECENT;
        }
    }

    fn frames_per_s(&self) -> f64 {
        let times = || self.frames.iter().map(|(presented, _)| *presented);
        match (times().min(), times().max()) {
            (Some(first), Some(last)) if last > first => (self.frames.len() - 1) as f64 / (last - first).as_secs_f64(),
            _ => 0.0,
        }
    }

    fn median_ms(&self) -> Option<f64> {
        let mut latencies = [Duration::ZERO; RECENT];
        let known = self.frames.iter().filter_map(|(_, latency)| *latency);
        let count = latencies.iter_mut().zip(known).map(|(slot, latency)| *slot = latency).count();
        let latencies = latencies.get_mut(..count)?;
        latencies.sort_unstable();
        latencies.get(count / 2).map(|l| l.as_secs_f64() * 1e3)
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
    /// Records a frame that is handed to the sinks. Returns how many were.
    pub(super) fn presented(&self, frame: &PresentedFrame) -> u64 {
        let mut shown = lock(&self.shown);
        let times = &frame.timeline;
        let total = times.presented.saturating_sub(times.sampled);
        // A pose that is held, or a picture that stands still, says nothing about how fast the station is.
        let fresh = times.first_byte != shown.last_first_byte && frame.tracking == TrackingState::Good;
        let latency = match times.first_byte {
            _ if frame.settings.frozen || frame.pose.is_none() => None,
            Some(first_byte) => fresh.then(|| times.presented.saturating_sub(first_byte)),
            None => Some(total),
        };
        shown.last_first_byte = times.first_byte;
        if let Some(latency) = latency {
            shown.pose_to_present.push(latency);
        }
        if frame.pose.is_some() {
            shown.sample_to_present.push(total);
            shown.render.push(times.rendered.saturating_sub(times.submitted));
            let expected = Duration::from_nanos(self.expected_ns.load(Ordering::Relaxed));
            let expected =
                if expected.is_zero() { total } else { expected.mul_f64(1.0 - WEIGHT) + total.mul_f64(WEIGHT) };
            self.expected_ns.store(u64::try_from(expected.as_nanos()).unwrap_or(u64::MAX), Ordering::Relaxed);
        }
        if let Some((start, end)) = times.inference {
            shown.inference.push(end.saturating_sub(start));
        }
        shown.by_source[frame.source as usize] += 1;
        shown.by_tracking[frame.tracking as usize] += 1;
        shown.recent.push(times.presented, latency);
        shown.first.get_or_insert(times.presented);
        shown.last = times.presented;
        (shown.tracking, shown.source, shown.frozen) = (frame.tracking, frame.source, frame.settings.frozen);
        shown.presented += 1;
        shown.presented
    }

    /// Time that lies between sampling and presentation, by the last frames.
    pub(super) fn expected(&self) -> Duration {
        Duration::from_nanos(self.expected_ns.load(Ordering::Relaxed))
    }

    /// Looks at what is known of presented frames.
    pub(super) fn shown<R>(&self, look: impl FnOnce(&Shown) -> R) -> R {
        look(&lock(&self.shown))
    }

    pub(super) fn status(&self, now: Duration, dropped: u64, notice: Option<String>) -> Status {
        self.shown(|shown| Status {
            elapsed_s: now.as_secs_f64(),
            presented: shown.presented,
            frames_per_s: shown.recent.frames_per_s(),
            latency_ms: shown.recent.median_ms(),
            tracking: shown.tracking,
            source: shown.source,
            frozen: shown.frozen,
            dropped,
            notice,
        })
    }
}

/// What one sink did.
#[derive(Debug, Clone, PartialEq, Eq, Default, Serialize)]
pub struct SinkSummary {
    /// Its name.
    pub name: String,
    /// Frames that it was given.
    pub offered: u64,
    /// Frames that it took.
    pub taken: u64,
    /// Frames that newer ones replaced, or that came after it was closed.
    pub dropped: u64,
    /// Frames that it failed on.
    pub failed: u64,
    /// Why it was closed before the end, or what it could not finish.
    pub error: Option<String>,
    /// Whether it had not come back when the session ended.
    pub stuck: bool,
}

/// What the generator did.
#[derive(Debug, Clone, PartialEq, Eq, Default, Serialize)]
pub struct GeneratorSummary {
    /// Frames that it was given.
    pub offered: u64,
    /// Frames that it translated.
    pub done: u64,
    /// Of these, after their deadline.
    pub late: u64,
    /// Frames that newer ones replaced, or that came while it was paused.
    pub dropped: u64,
    /// Frames that it failed on.
    pub failed: u64,
    /// Runs that were ended since they took too long.
    pub hung: u64,
    /// Whether it had not come back when the session ended.
    pub stuck: bool,
}

/// What a session did, for its end.
#[derive(Debug, Clone, PartialEq, Serialize)]
pub struct Summary {
    /// Length of the session, s.
    pub elapsed_s: f64,
    /// Frames begun: presented + all of `drops`.
    pub produced: u64,
    /// Frames handed to the sinks.
    pub presented: u64,
    /// Frames begun and not presented, by cause.
    pub drops: BTreeMap<&'static str, u64>,
    /// Ticks at which no frame was begun: the device was slower than the frame rate.
    pub missed_ticks: u64,
    /// Presented frames a second, from the first to the last.
    pub frames_per_s: f64,
    /// Part of the presented frames that showed a generated picture, its own or a held one.
    pub enhanced_ratio: f64,
    /// Presented frames by picture: enhanced, held, low quality.
    pub by_source: [u64; 3],
    /// Presented frames by the state of their pose: good, held, stale, lost.
    pub by_tracking: [u64; 4],
    /// First byte of a new pose until the frame was handed to the sinks; from sampling where there is no tracker.
    pub pose_to_present: Option<Percentiles>,
    /// Pose sampled until handed to the sinks.
    pub sample_to_present: Option<Percentiles>,
    /// Submitted until in memory.
    pub render: Option<Percentiles>,
    /// Generator runs of presented frames.
    pub inference: Option<Percentiles>,
    /// Devices lost and rebuilt.
    pub device_losses: u64,
    /// Of these, rebuilt.
    pub device_rebuilt: u64,
    /// Controls applied.
    pub controls: u64,
    /// Controls that were out of range.
    pub controls_refused: u64,
    /// The generator, where there is one.
    pub generator: Option<GeneratorSummary>,
    /// Each sink.
    pub sinks: Vec<SinkSummary>,
    /// Stages that had not ended when they should have.
    pub stuck: Vec<String>,
    /// Resident memory at the end, bytes, where the system tells it.
    pub memory_bytes: Option<u64>,
}

/// Resident memory of this process, bytes; none where the system doesn't tell it.
pub fn memory_bytes() -> Option<u64> {
    let status = std::fs::read_to_string("/proc/self/status").ok()?;
    let line = status.lines().find(|line| line.starts_with("VmRSS:"))?;
    let kib: u64 = line.split_whitespace().nth(1)?.parse().ok()?;
    Some(kib * 1024)
}

#[cfg(test)]
mod tests {
    use super::*;

    #[test]
    fn buckets_join_without_gaps() {
        for index in 0..STEPS * DOUBLINGS - 1 {
            let upper = upper_bound(index);
            assert_eq!((bucket(upper), bucket(upper + 1)), (index, index + 1), "{upper}");
        }
    }

    #[test]
    fn percentiles_are_within_a_step() {
        let mut histogram = Histogram::default();
        for us in (1..=100_000).rev() {
            histogram.push(Duration::from_micros(us));
        }
        for percent in [1.0, 50.0, 95.0, 99.0] {
            let found = histogram.percentile(percent).unwrap().as_secs_f64() * 1e6;
            let expected = percent * 1000.0;
            assert!(found >= expected && found <= expected * (1.0 + 1.0 / 32.0), "{percent}: {found}");
        }
        assert_eq!(histogram.percentile(100.0), Some(Duration::from_millis(100)));
        assert_eq!(histogram.percentiles().unwrap().count, 100_000);
    }

    #[test]
    fn nothing_and_the_extremes_have_percentiles() {
        let mut histogram = Histogram::default();
        assert_eq!(histogram.percentiles(), None);
        histogram.push(Duration::MAX);
        histogram.push(Duration::ZERO);
        assert_eq!(histogram.percentile(50.0), Some(Duration::ZERO));
        assert!(histogram.percentile(100.0).unwrap() > Duration::from_secs(2000));
    }

    #[cfg(target_os = "linux")]
    #[test]
    fn this_process_takes_memory() {
        assert!(memory_bytes().unwrap() > 1 << 20);
    }
}
