//! Submission times of frames.

use std::time::Duration;

use super::clock::smoothed;

/// Time by which a submission precedes the expected end of the previous frame. Meanwhile the pose is sampled, the
/// passes are recorded and the finished frame is read back, while the device still works.
const OVERLAP: Duration = Duration::from_millis(4);

/// Weight of the latest frame in the estimated device time.
const WEIGHT: f64 = 0.2;

/// Paces frames by ticks of a fixed rate and by the device. A device slower than the ticks gets each frame just in
/// time to stay busy, so poses don't age in its queue.
///
/// Tick k is due k periods after the start. A frame uses the latest tick that is due; earlier ones without a frame are
/// missed and not caught up. So each tick has one frame or is missed.
#[derive(Debug)]
pub(super) struct Pace {
    period: Duration,
    /// Time of the next tick.
    due: Duration,
    /// Estimated time of a frame on the device.
    service: Duration,
    /// Predicted completion time of the device's queued work.
    free_at: Duration,
    last_rendered: Duration,
    missed: u64,
}

impl Pace {
    /// A pace with a tick every `period`; the first is at `now`.
    pub(super) fn new(period: Duration, now: Duration) -> Self {
        Self { period, due: now, service: Duration::ZERO, free_at: now, last_rendered: now, missed: 0 }
    }

    /// Time at which to submit the next frame.
    pub(super) fn submit_at(&self) -> Duration {
        self.due.max(self.free_at.saturating_sub(OVERLAP))
    }

    /// Records that a frame is submitted at `now`: it uses the latest tick that is due.
    pub(super) fn ticked(&mut self, now: Duration) {
        self.due += self.period;
        // The latest tick up to `now` is not missed, because the frame submitted now uses it.
        self.miss(now.saturating_sub(self.due));
    }

    /// Records the end of the session at `now`: earlier ticks without a frame are missed.
    pub(super) fn ended(&mut self, now: Duration) {
        if self.due < now {
            self.miss(now - self.due + self.period - Duration::from_nanos(1));
        }
    }

    /// Skips the ticks of all whole periods in `time`, and counts them as missed.
    fn miss(&mut self, time: Duration) {
        let ticks = time.as_nanos() / self.period.as_nanos().max(1);
        self.missed += u64::try_from(ticks).unwrap_or(u64::MAX);
        self.due += Duration::from_nanos_u128(ticks.saturating_mul(self.period.as_nanos()));
    }

    /// Records a submission at `now`. Returns the expected completion time of the frame.
    pub(super) fn submitted(&mut self, now: Duration) -> Duration {
        self.ticked(now);
        self.free_at = self.free_at.max(now) + self.service;
        self.free_at
    }

    /// Records that the frame submitted at `submitted` was done at `now`, with `left` frames still in flight. Returns
    /// its time on the device: since its submission, or since the end of the previous frame if that was later.
    pub(super) fn rendered(&mut self, submitted: Duration, now: Duration, left: u32) -> Duration {
        let took = now.saturating_sub(submitted.max(self.last_rendered));
        self.service = smoothed(self.service, took, WEIGHT);
        self.last_rendered = now;
        self.free_at = now + self.service * left;
        took
    }

    /// Resets the estimates at `now`, with no frame in flight: the device was lost, or the cost of frames changed.
    pub(super) fn begin_anew(&mut self, now: Duration) {
        (self.free_at, self.last_rendered, self.service) = (now, now, Duration::ZERO);
    }

    /// Estimated time of a frame on the device, from recent frames.
    pub(super) fn service(&self) -> Duration {
        self.service
    }

    /// Number of ticks that passed without a frame.
    pub(super) fn missed(&self) -> u64 {
        self.missed
    }
}

#[cfg(test)]
mod tests {
    use super::*;

    const MS: Duration = Duration::from_millis(1);

    /// Submission times, latencies and number of missed ticks on a device that takes `device` per frame. Each tick up
    /// to the last submission, whose frame ends the session, is used or missed.
    fn run(period: Duration, device: Duration, frames: u32) -> (Vec<Duration>, Vec<Duration>, u64) {
        let mut pace = Pace::new(period, Duration::ZERO);
        let (mut now, mut device_free) = (Duration::ZERO, Duration::ZERO);
        let mut in_flight = std::collections::VecDeque::new();
        let (mut submissions, mut latencies) = (Vec::new(), Vec::new());
        while latencies.len() < frames as usize {
            let submit_at = pace.submit_at();
            let first = in_flight.front().copied();
            match first {
                Some((submitted, done, expected)) if in_flight.len() == 2 || expected <= submit_at => {
                    now = now.max(done);
                    in_flight.pop_front();
                    latencies.push(now - submitted);
                    pace.rendered(submitted, now, in_flight.len() as u32);
                }
                _ => {
                    now = now.max(submit_at);
                    device_free = device_free.max(now) + device;
                    submissions.push(now);
                    let expected = pace.submitted(now);
                    in_flight.push_back((now, device_free, expected));
                }
            }
        }
        pace.ended(now);
        // Ticks at 0, `period`, ... before the end.
        let ticks = (now.as_nanos() - 1) / period.as_nanos() + 1;
        assert_eq!(submissions.len() as u128 + u128::from(pace.missed()), ticks, "{device:?} of {period:?}");
        (submissions, latencies, pace.missed())
    }

    #[test]
    fn a_fast_device_is_paced_by_the_ticks() {
        let (submissions, latencies, missed) = run(MS * 50, MS * 10, 20);
        assert!(submissions.windows(2).all(|w| w[1] - w[0] == MS * 50));
        assert!(latencies.iter().all(|l| *l == MS * 10));
        assert_eq!(missed, 0);
    }

    #[test]
    fn a_slow_device_is_kept_busy_and_its_queue_short() {
        let (submissions, latencies, missed) = run(MS * 20, MS * 60, 50);
        let last = submissions.len() - 1;
        let rate = (submissions[last] - submissions[10]) / (last - 10) as u32;
        assert!(rate >= MS * 59 && rate <= MS * 61, "{rate:?}");
        assert!(latencies[10..].iter().all(|l| *l <= MS * 66), "{latencies:?}");
        assert!((97..=100).contains(&missed), "two of three ticks: {missed}");
    }

    #[test]
    fn a_device_a_little_too_slow_misses_few_ticks() {
        // Frames take 55 ms and ticks come every 50 ms: one tick in eleven is missed.
        let (_, _, missed) = run(MS * 50, MS * 55, 220);
        assert!((20..=23).contains(&missed), "of 242 ticks: {missed}");
    }

    #[test]
    fn a_pause_costs_its_own_ticks_and_the_grid_stays() {
        let mut pace = Pace::new(MS * 50, Duration::ZERO);
        pace.ticked(Duration::ZERO);
        // The frame of the tick at 50 ms is done at 230 ms. Of the ticks at 100, 150 and 200 ms, only the last can
        // still be used.
        pace.ticked(MS * 230);
        assert_eq!((pace.submit_at(), pace.missed()), (MS * 200, 2));
        pace.ticked(MS * 231);
        assert_eq!((pace.submit_at(), pace.missed()), (MS * 250, 2));
        pace.ended(MS * 250);
        assert_eq!(pace.missed(), 2, "a tick at the very end is none of the session");
        pace.ended(MS * 301);
        assert_eq!(pace.missed(), 4);
    }
}
