//! Signs that a stream does not come from one device: counters and clocks that go back or jump, positions that
//! alternate.

use insonify_core::pose::jump_gate::{Gate, JumpGate};
use insonify_core::pose::stream_order::{StreamOrder, StreamPosition};
use insonify_core::pose::{FilterSettings, Measurement, Pose, Reading};

use crate::tracker::{Irregularity, Record};

/// Time span of the records that are judged together, ns.
const WINDOW_NS: u64 = 2_000_000_000;

/// Shortest time between two reports of one kind, ns.
const REPORT_PERIOD_NS: u64 = 5_000_000_000;

/// Smallest number of records that is judged.
const LEAST_RECORDS: u32 = 20;

/// Smallest number of counter restarts in one window that is reported as interleaved devices.
const SEVERAL: u32 = 3;

/// Share of records out of order, or of positions out of reach, from which the stream does not come from one device.
const SHARE: f64 = 0.2;

/// Smallest reported jump of the device's clock ahead of this computer's clock, µs.
const LEAP_US: u64 = 500_000;

/// Number of kinds of irregularity.
const KINDS: usize = 6;

/// Index of the kind of `irregularity`, below [`KINDS`].
fn kind(irregularity: &Irregularity) -> usize {
    match irregularity {
        Irregularity::Restarted { .. } => 0,
        Irregularity::Leapt { .. } => 1,
        Irregularity::Interleaved { .. } => 2,
        Irregularity::ClockStands => 3,
        Irregularity::Alternating { .. } => 4,
        Irregularity::CounterStands => 5,
    }
}

/// Detector of irregularities in the probe's records.
#[derive(Debug)]
pub(super) struct Regularity {
    order: StreamOrder,
    gate: JumpGate,
    last_pose: Option<Pose>,
    /// Arrival (ns) and device time (µs) of the last record; `None` before the first.
    last: Option<(u64, Option<u64>)>,
    /// Counter of the last record, if it has one.
    counter: Option<u32>,
    window: Window,
    /// Time of the last report of each kind, ns. A counter that stands still is reported once.
    reported_ns: [Option<u64>; KINDS],
}

/// Counts of one span of time.
#[derive(Debug, Default, Clone, Copy)]
struct Window {
    start_ns: Option<u64>,
    records: u32,
    restarts: u32,
    late: u32,
    stalls: u32,
    /// Number of records with the same counter as the previous record.
    same_counter: u32,
    poses: u32,
    far: u32,
    distance_mm: f64,
}

impl Default for Regularity {
    fn default() -> Self {
        let FilterSettings { max_speed_mm_s, max_speed_deg_s, .. } = FilterSettings::default();
        Self {
            order: StreamOrder::default(),
            gate: JumpGate::new(max_speed_mm_s, max_speed_deg_s),
            last_pose: None,
            last: None,
            counter: None,
            window: Window::default(),
            reported_ns: [None; KINDS],
        }
    }
}

impl Regularity {
    /// Forgets all records, after the port was reopened.
    pub(super) fn restart(&mut self) {
        *self = Self { reported_ns: self.reported_ns, ..Self::default() };
    }

    /// Takes the next record. Returns an irregularity, if one is due to be reported.
    pub(super) fn push(&mut self, host_time_ns: u64, record: &Record) -> Option<Irregularity> {
        let sudden = self.count(host_time_ns, record);
        let start_ns = *self.window.start_ns.get_or_insert(host_time_ns);
        let span_ns = host_time_ns.saturating_sub(start_ns);
        let lasting = (span_ns >= WINDOW_NS || host_time_ns < start_ns).then(|| {
            let window = std::mem::take(&mut self.window);
            window.verdict(span_ns as f64 * 1e-9)
        });
        let found = lasting.flatten().or(sudden)?;
        let reported = self.reported_ns.get_mut(kind(&found))?;
        let again = found != Irregularity::CounterStands;
        if reported.is_some_and(|at| !again || host_time_ns.saturating_sub(at) < REPORT_PERIOD_NS) {
            return None;
        }
        *reported = Some(host_time_ns);
        Some(found)
    }

    /// Counts a record. Returns a sudden change, if the record shows one.
    fn count(&mut self, host_time_ns: u64, record: &Record) -> Option<Irregularity> {
        let Record { sequence, device_time_us, reading, .. } = *record;
        let last = self.last.replace((host_time_ns, device_time_us));
        let counter = std::mem::replace(&mut self.counter, sequence);
        let window = &mut self.window;
        window.records += 1;
        window.same_counter += u32::from(sequence.is_some() && sequence == counter);
        if let Reading::Pose(pose) = reading {
            window.poses += 1;
            if self.gate.push(pose, host_time_ns as f64 * 1e-9) != Gate::Passed {
                window.far += 1;
                let distance_mm = self.last_pose.map_or(0.0, |last| last.position_mm.distance(pose.position_mm));
                window.distance_mm = window.distance_mm.max(distance_mm);
            }
            self.last_pose = Some(pose);
        }
        let device = last.and_then(|(host_ns, device_us)| Some((host_ns, device_us?, device_time_us?)));
        match self.order.push(&Measurement { host_time_ns, device_time_us, sequence, reading }) {
            StreamPosition::Restarted { .. } => {
                window.restarts += 1;
                let back_s = device.map(|(_, before, now)| before.saturating_sub(now) as f64 * 1e-6);
                // A single backward step may be a restart; several steps are judged together.
                return (window.restarts == 1)
                    .then_some(Irregularity::Restarted { back_s: back_s.filter(|s| *s > 0.0) });
            }
            StreamPosition::Late => window.late += 1,
            StreamPosition::Next { clock_stalled, .. } => window.stalls += u32::from(clock_stalled),
            StreamPosition::Duplicate => {}
        }
        let (host_ns, before_us, now_us) = device?;
        let passed_us = host_time_ns.saturating_sub(host_ns) / 1000;
        let ahead_us = now_us.checked_sub(before_us)?.saturating_sub(passed_us);
        (ahead_us > LEAP_US).then_some(Irregularity::Leapt { ahead_s: ahead_us as f64 * 1e-6 })
    }
}

impl Window {
    fn verdict(&self, seconds: f64) -> Option<Irregularity> {
        let is_share = |part: u32, of: u32| of >= LEAST_RECORDS && f64::from(part) >= SHARE * f64::from(of);
        let back = self.restarts + self.late;
        if self.restarts >= SEVERAL || is_share(back, self.records) {
            return Some(Irregularity::Interleaved { times: back, seconds });
        }
        if is_share(self.far, self.poses) {
            let Self { far, poses: of, distance_mm, .. } = *self;
            return Some(Irregularity::Alternating { far, of, distance_mm });
        }
        if self.records < LEAST_RECORDS {
            return None;
        }
        // The very first record has no predecessor whose counter it could repeat.
        if self.same_counter + 1 >= self.records {
            return Some(Irregularity::CounterStands);
        }
        (2 * self.stalls > self.records).then_some(Irregularity::ClockStands)
    }
}

#[cfg(test)]
mod tests {
    use glam::DVec3;

    use super::*;

    const PERIOD_NS: u64 = 20_000_000;

    fn at(x: f64, counter: Option<u32>, clock_us: Option<u64>) -> Record {
        let pose = Pose { position_mm: DVec3::X * x, ..Pose::IDENTITY };
        Record { sequence: counter, device_time_us: clock_us, ..Record::new(0, Reading::Pose(pose)) }
    }

    fn told(records: impl IntoIterator<Item = Record>) -> Vec<Irregularity> {
        let mut watch = Regularity::default();
        (0..).zip(records).filter_map(|(i, record)| watch.push(1_000_000_000 + i * PERIOD_NS, &record)).collect()
    }

    #[test]
    fn a_steady_device_is_not_remarked_on() {
        let steady = (0..1000).map(|i: u32| at(f64::from(i % 50), Some(i), Some(u64::from(i) * 20_000)));
        assert_eq!(told(steady), []);
        // A clock that wraps, a device without clock and counter, and a single jump are regular.
        let wraps = (0..400).map(|i: u32| at(0.0, Some(i), Some((4_290_000_000 + u64::from(i) * 20_000) % (1 << 32))));
        assert_eq!(told(wraps), []);
        assert_eq!(told((0..400).map(|i| at(if i < 200 { 0.0 } else { 400.0 }, None, None))), []);
    }

    #[test]
    fn two_boards_in_one_stream_are_told_by_their_counters() {
        let two = (0..300).map(|i: u32| at(0.0, Some(if i.is_multiple_of(2) { 5000 + i } else { i }), None));
        let found = told(two);
        assert!(matches!(found[1], Irregularity::Interleaved { times: 30.., .. }), "{found:?}");
        assert!(found.len() <= 4, "{found:?}");
        // Counters that are close to each other.
        let close =
            (0..300).map(|i: u32| at(0.0, Some(if i.is_multiple_of(2) { 40 + i / 2 } else { 20 + i / 2 }), None));
        assert!(told(close).iter().any(|found| matches!(found, Irregularity::Interleaved { .. })));
    }

    #[test]
    fn two_sensors_without_counters_are_told_by_their_positions() {
        let found = told((0..300).map(|i| at(if i % 2 == 0 { 10.0 } else { -500.0 }, None, None)));
        assert!(matches!(found[0], Irregularity::Alternating { of: 100.., distance_mm: 510.0, .. }), "{found:?}");
    }

    #[test]
    fn a_clock_that_is_set_is_told_at_once() {
        let clock = |i: u64| i * 20_000 + 100_000_000;
        let ahead = told((0..100).map(|i| at(0.0, None, Some(clock(i) + if i < 50 { 0 } else { 30_000_000 }))));
        assert!(matches!(ahead[..], [Irregularity::Leapt { ahead_s }] if (ahead_s - 30.0).abs() < 0.1), "{ahead:?}");
        let back = told((0..100).map(|i| at(0.0, None, Some(clock(i) - if i < 50 { 0 } else { 30_000_000 }))));
        assert!(
            matches!(back[..], [Irregularity::Restarted { back_s: Some(s) }] if (s - 30.0).abs() < 0.1),
            "{back:?}"
        );
        let stands = told((0..300).map(|i| at(0.0, Some(i), Some(7))));
        assert_eq!(stands, [Irregularity::ClockStands]);
    }

    #[test]
    fn a_counter_that_stands_still_is_told_once() {
        let stands = told((0..1500).map(|i: u32| at(0.0, Some(0), Some(u64::from(i) * 20_000))));
        assert_eq!(stands, [Irregularity::CounterStands]);
        assert!(stands[0].to_string().contains("lost records can't be counted"));
        // Occasional repeated records are regular.
        assert_eq!(told((0..1500).map(|i: u32| at(0.0, Some(i / 2), Some(u64::from(i / 2) * 40_000)))), []);
    }
}
