//! Regularity of the arrival of poses.

use serde::Serialize;

use insonify_core::pose::TimedPose;
use insonify_core::statistics::{mean_and_deviation, nearest_rank};

/// Longest interval between two poses that is not a gap, ns. The probe's motion in a gap is unknown.
pub const GAP_NS: u64 = 250_000_000;

/// Largest number of gaps that are listed; all are counted.
const LISTED: usize = 20;

/// An interval without poses.
#[derive(Debug, Clone, Copy, PartialEq, Serialize)]
pub struct Gap {
    /// Start of the gap, s since the first pose.
    pub at_s: f64,
    /// Length, s.
    pub length_s: f64,
}

/// Regularity of the arrival of poses at the host. Gaps affect only `gaps`, `gap_count` and `max_ms`.
#[derive(Debug, Clone, PartialEq, Serialize)]
pub struct Timing {
    /// Pose rate, Hz.
    pub rate_hz: f64,
    /// Median interval, ms.
    pub p50_ms: f64,
    /// 95th percentile of the intervals, ms.
    pub p95_ms: f64,
    /// Longest interval, including gaps, ms.
    pub max_ms: f64,
    /// Standard deviation of the intervals, ms.
    pub jitter_ms: f64,
    /// Number of gaps.
    pub gap_count: usize,
    /// The first 20 gaps.
    pub gaps: Vec<Gap>,
}

impl Timing {
    /// Timing of poses in ascending host time; `None` for fewer than two.
    pub fn of(poses: &[TimedPose]) -> Option<Self> {
        let times_ns: Vec<u64> = poses.iter().map(|pose| pose.host_time_ns).collect();
        Self::of_times(&times_ns)
    }

    /// Timing of records with these ascending host times, ns; `None` for fewer than two.
    pub fn of_times(times_ns: &[u64]) -> Option<Self> {
        let first = *times_ns.first()?;
        let (mut intervals, mut gaps, mut gap_count, mut max_ns) = (Vec::new(), Vec::new(), 0, 0);
        for pair in times_ns.windows(2) {
            let interval = pair[1].saturating_sub(pair[0]);
            max_ns = interval.max(max_ns);
            if interval <= GAP_NS {
                intervals.push(interval as f64 * 1e-6);
                continue;
            }
            gap_count += 1;
            if gaps.len() < LISTED {
                let at_s = pair[0].saturating_sub(first) as f64 * 1e-9;
                gaps.push(Gap { at_s, length_s: interval as f64 * 1e-9 });
            }
        }
        if times_ns.len() < 2 {
            return None;
        }
        let (mean, jitter_ms) = mean_and_deviation(&intervals).unwrap_or_default();
        intervals.sort_by(f64::total_cmp);
        let percentile = |part| nearest_rank(&intervals, part).unwrap_or(0.0);
        Some(Self {
            rate_hz: if mean > 0.0 { 1e3 / mean } else { 0.0 },
            p50_ms: percentile(0.5),
            p95_ms: percentile(0.95),
            max_ms: max_ns as f64 * 1e-6,
            jitter_ms,
            gap_count,
            gaps,
        })
    }
}

#[cfg(test)]
mod tests {
    use insonify_core::pose::Pose;

    use super::*;

    fn at(ms: &[u64]) -> Vec<TimedPose> {
        let pose = Pose::from_components([0.0, 0.0, 0.0, 1.0, 0.0, 0.0, 0.0]).unwrap();
        ms.iter().map(|ms| TimedPose { host_time_ns: 7 + ms * 1_000_000, device_time_us: 0, pose }).collect()
    }

    #[test]
    fn rate_jitter_and_gaps_worked_out_by_hand() {
        let timing = Timing::of(&at(&[0, 10, 20, 30, 60, 1060, 1070])).unwrap();
        // Intervals 10, 10, 10, 30, 10 ms and one gap: mean 14, deviations 4·16 + 256 over 5 = 64.
        assert!((timing.rate_hz - 1e3 / 14.0).abs() < 1e-9);
        assert_eq!((timing.p50_ms, timing.p95_ms, timing.max_ms), (10.0, 30.0, 1000.0));
        assert!((timing.jitter_ms - 8.0).abs() < 1e-9);
        assert_eq!((timing.gap_count, timing.gaps.len()), (1, 1));
        assert!((timing.gaps[0].at_s - 0.06).abs() < 1e-9 && (timing.gaps[0].length_s - 1.0).abs() < 1e-9);
    }

    #[test]
    fn fewer_than_two_poses_have_no_rate() {
        assert_eq!((Timing::of(&[]), Timing::of(&at(&[5]))), (None, None));
        assert_eq!(Timing::of(&at(&[5, 5])).unwrap().rate_hz, 0.0);
        let gap = Timing::of(&at(&[0, 300])).unwrap();
        assert_eq!((gap.rate_hz, gap.p50_ms, gap.gap_count), (0.0, 0.0, 1));
    }
}
