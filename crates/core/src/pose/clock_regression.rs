//! Measurement times on the host's clock, by regression on the device's clock.

/// Number of measurements in the regression. PLUS (Lasso et al., IEEE Trans Biomed Eng 61:2527, 2014) uses 20.
const WINDOW: usize = 20;

/// Largest accepted difference between the arrival time and the regressed time of one measurement, ns.
pub const OUTLIER_NS: u64 = 500_000_000;

/// Deviation from the expected time, ns, beyond which a measurement counts as delayed, or a clock as having jumped.
/// Such measurements are excluded from the regression.
const HELD_UP_NS: u64 = 50_000_000;

/// The regression restarts after this duration of measurements inconsistent with it, ns.
const DOUBT_LIMIT_NS: u64 = 1_000_000_000;

/// Number of samples from which on the regression line is trusted to detect delays and jumps.
const TRUSTED: usize = 8;

/// Largest decrease of the host time that counts as jitter while the device's clock rises, ns.
const BACKWARD_JITTER_NS: u64 = 20_000_000;

/// Number of consecutive measurements, consistent with each other but not with earlier ones, that prove a clock jump.
const CONFIRMED: usize = 3;

/// Time of a measurement according to the regression.
#[derive(Debug, Clone, Copy, PartialEq, Eq)]
pub enum Timing {
    /// Measurement time, ns of the host's clock; later than all times before it.
    At(u64),
    /// Measurement time after a clock jump, ns of the host's clock; unrelated to earlier times.
    Jumped(u64),
    /// The host's time did not rise; the measurement is unusable.
    NotRising,
    /// Arrival time and regressed time differ by more than [`OUTLIER_NS`]; the measurement is unusable.
    Outlier,
}

#[derive(Debug, Clone, Copy, Default, PartialEq, Eq)]
struct Sample {
    host_ns: u64,
    ticks: Option<u64>,
}

/// Linear regression of host arrival times on the device's counter or clock. It removes the jitter of the transport.
///
/// The mean delay of the transport remains: it cannot be measured.
#[derive(Debug, Clone, Default)]
pub(crate) struct ClockRegression {
    /// Samples (ticks, host time in ns); the oldest is overwritten first.
    window: [(u64, u64); WINDOW],
    filled: usize,
    oldest: usize,
    last: Option<Sample>,
    /// Latest time returned, ns.
    last_time_ns: u64,
    /// Consecutive samples that are inconsistent with earlier ones.
    doubtful: [Sample; CONFIRMED],
    doubtful_count: usize,
    /// Host time of the first doubtful sample with ticks, ns.
    doubtful_since_ns: Option<u64>,
}

impl ClockRegression {
    /// Time of a measurement that arrived at `host_ns`. `ticks` counts in the device's own unit and rises with each
    /// measurement; `None` if the device has neither a counter nor a clock.
    pub(crate) fn push(&mut self, host_ns: u64, ticks: Option<u64>) -> Timing {
        let sample = Sample { host_ns, ticks };
        let Some(last) = self.last else {
            return Timing::At(self.accept(sample));
        };
        let expected_ns = ticks.and_then(|ticks| self.fit(ticks)).map(|fit| fit.time_ns);
        let apart_ns = expected_ns.map_or(0, |at| at.abs_diff(host_ns));
        let not_rising = match ticks {
            Some(_) => host_ns.saturating_add(BACKWARD_JITTER_NS) < last.host_ns,
            None => host_ns <= last.host_ns.max(self.last_time_ns),
        };
        let is_doubtful = not_rising || apart_ns > OUTLIER_NS || (apart_ns > HELD_UP_NS && self.filled >= TRUSTED);
        if !is_doubtful {
            self.doubtful_count = 0;
            self.doubtful_since_ns = None;
            return Timing::At(self.accept(sample));
        }
        if ticks.is_some() {
            let since_ns = *self.doubtful_since_ns.get_or_insert(host_ns);
            if host_ns.saturating_sub(since_ns) > DOUBT_LIMIT_NS {
                // The regression line no longer holds: for example, the device changed its rate.
                self.restart();
                return Timing::Jumped(self.accept(sample));
            }
        }
        if !self.agrees_with_doubtful(&sample) {
            self.doubtful_count = 0;
        }
        self.doubtful[self.doubtful_count] = sample;
        self.doubtful_count += 1;
        if self.doubtful_count < CONFIRMED {
            return match expected_ns {
                _ if not_rising => Timing::NotRising,
                Some(expected_ns) if apart_ns <= OUTLIER_NS => Timing::At(self.held_up(sample, expected_ns)),
                _ => Timing::Outlier,
            };
        }
        let doubtful = self.doubtful;
        self.restart();
        let times = doubtful.map(|sample| self.accept(sample));
        Timing::Jumped(times[CONFIRMED - 1])
    }

    /// Forgets all samples; for example when the device restarts.
    pub(crate) fn restart(&mut self) {
        *self = Self::default();
    }

    /// Moves all stored times `by_ns` earlier, after the host clock was set back.
    pub(crate) fn set_back(&mut self, by_ns: u64) {
        self.window.iter_mut().for_each(|(_, host_ns)| *host_ns = host_ns.saturating_sub(by_ns));
        if let Some(last) = &mut self.last {
            last.host_ns = last.host_ns.saturating_sub(by_ns);
        }
        self.last_time_ns = self.last_time_ns.saturating_sub(by_ns);
        self.doubtful_count = 0;
        self.doubtful_since_ns = None;
    }

    /// Whether `sample` continues the doubtful samples at the device's pace. A burst after a stall of the transport
    /// does not: its samples arrive too fast.
    fn agrees_with_doubtful(&self, sample: &Sample) -> bool {
        let doubtful = &self.doubtful[..self.doubtful_count];
        let (Some(first), Some(before)) = (doubtful.first(), doubtful.last()) else { return true };
        let (Some(ticks), Some(first_ticks)) = (sample.ticks, first.ticks) else {
            return sample.host_ns > before.host_ns && sample.host_ns - before.host_ns <= OUTLIER_NS;
        };
        let pace = self.fit(ticks).map_or(0.0, |fit| fit.ns_per_tick);
        let least_ns = 0.75 * pace * ticks.saturating_sub(first_ticks) as f64;
        sample.host_ns >= before.host_ns
            && sample.host_ns - before.host_ns <= OUTLIER_NS
            && (sample.host_ns - first.host_ns) as f64 >= least_ns
    }

    /// Time of a delayed sample on the regression line, ns; `expected_ns` is the line's value.
    fn held_up(&mut self, sample: Sample, expected_ns: u64) -> u64 {
        self.last = Some(sample);
        self.last_time_ns = expected_ns.max(self.last_time_ns.saturating_add(1));
        self.last_time_ns
    }

    fn accept(&mut self, sample: Sample) -> u64 {
        let first = self.last.is_none();
        let mut time_ns = sample.host_ns;
        if let Some(ticks) = sample.ticks {
            let end = (self.oldest + self.filled) % WINDOW;
            self.window[end] = (ticks, sample.host_ns);
            if self.filled < WINDOW {
                self.filled += 1;
            } else {
                self.oldest = (self.oldest + 1) % WINDOW;
            }
            if let Some(fit) = self.fit(ticks) {
                // Jitter tilts the line. Successive times must still rise, by at least a quarter of the device's step.
                let before = self.last.and_then(|last| last.ticks).unwrap_or(ticks);
                let least_ns = (0.25 * fit.ns_per_tick * ticks.saturating_sub(before) as f64) as u64;
                time_ns = fit.time_ns.max(self.last_time_ns.saturating_add(least_ns.max(1)));
            }
        }
        if !first {
            time_ns = time_ns.max(self.last_time_ns.saturating_add(1));
        }
        self.last = Some(sample);
        self.last_time_ns = time_ns;
        time_ns
    }

    /// Least-squares line through the window, at `ticks`; `None` for fewer than three samples or a line that does not
    /// rise.
    fn fit(&self, ticks: u64) -> Option<Fit> {
        if self.filled < 3 {
            return None;
        }
        let samples = &self.window[..self.filled];
        // Differences from the first sample keep full f64 precision.
        let (ticks_0, host_0) = samples[0];
        let difference = |a: u64, b: u64| if a >= b { (a - b) as f64 } else { -((b - a) as f64) };
        let points = samples.iter().map(|(t, h)| (difference(*t, ticks_0), difference(*h, host_0)));
        let n = self.filled as f64;
        let (sum_x, sum_y) = points.clone().fold((0.0, 0.0), |(x, y), p| (x + p.0, y + p.1));
        let (mean_x, mean_y) = (sum_x / n, sum_y / n);
        let (xx, xy) = points
            .fold((0.0, 0.0), |(xx, xy), (x, y)| (xx + (x - mean_x) * (x - mean_x), xy + (x - mean_x) * (y - mean_y)));
        if !(xx > 0.0 && xy > 0.0) {
            return None;
        }
        let ns_per_tick = xy / xx;
        let offset_ns = mean_y + ns_per_tick * (difference(ticks, ticks_0) - mean_x);
        let time_ns = host_0.saturating_add_signed(offset_ns as i64);
        Some(Fit { time_ns, ns_per_tick })
    }
}

struct Fit {
    time_ns: u64,
    ns_per_tick: f64,
}

#[cfg(test)]
mod tests {
    use proptest::prelude::*;

    use super::*;
    use crate::random;
    use crate::statistics::mean_and_deviation;

    const START_NS: u64 = 1_790_000_000_000_000_000;
    const PERIOD_NS: u64 = 16_666_667;

    fn time(timing: Timing) -> u64 {
        match timing {
            Timing::At(t) | Timing::Jumped(t) => t,
            other => panic!("no time: {other:?}"),
        }
    }

    #[test]
    fn jitter_of_the_transport_is_removed() {
        let mut clock = ClockRegression::default();
        let (mut raw, mut fitted) = (Vec::new(), Vec::new());
        for i in 0..500 {
            let made = START_NS + i * PERIOD_NS;
            // The latency timer of an FTDI adapter delays bytes by up to 16 ms.
            let arrived = made + (random::at(1, i) * 16e6) as u64;
            let at = time(clock.push(arrived, Some(i)));
            if i >= 20 {
                raw.push(arrived as f64 - made as f64);
                fitted.push(at as f64 - made as f64);
            }
        }
        // The end of a line fitted to n points has √((4n − 2)/(n(n + 1))) of the points' deviation: 0.43.
        let deviation = |errors: &[f64]| mean_and_deviation(errors).unwrap().1;
        let ratio = deviation(&fitted) / deviation(&raw);
        assert!((0.3..0.5).contains(&ratio), "{ratio}");
    }

    #[test]
    fn one_late_arrival_hardly_counts_and_an_extreme_one_is_dropped() {
        let mut clock = ClockRegression::default();
        for i in 0..40 {
            clock.push(START_NS + i * PERIOD_NS, Some(i));
        }
        let made = |i: u64| START_NS + i * PERIOD_NS;
        // One measurement is delayed by 100 ms; the following ones arrive with it.
        let mut last = 0;
        for i in 40..60 {
            let at = time(clock.push(made(i).max(made(40) + 100_000_000), Some(i)));
            assert!(at.abs_diff(made(i)) < 30_000_000 && at > last, "{i}: {} ms", at.abs_diff(made(i)) / 1_000_000);
            last = at;
        }
        // One measurement is delayed by 0.6 s: too old to be used, but no clock jump.
        let arrived = made(60) + 600_000_000;
        let found: Vec<_> = (60..100).map(|i| clock.push(made(i).max(arrived), Some(i))).collect();
        let used = found.iter().position(|t| matches!(t, Timing::At(_))).unwrap();
        assert!((6..=8).contains(&used), "{found:?}");
        for (i, timing) in (60..100).zip(&found).skip(used) {
            let at = time(*timing);
            assert!(at.abs_diff(made(i)) < 60_000_000 && at > last, "{i}: {found:?}");
            last = at;
        }
    }

    #[test]
    fn a_device_that_changes_its_rate_is_followed() {
        let mut clock = ClockRegression::default();
        (0..30).for_each(|i| assert!(matches!(clock.push(START_NS + i * 10 * PERIOD_NS, Some(i)), Timing::At(_))));
        let changed = START_NS + 30 * 10 * PERIOD_NS;
        let found: Vec<_> = (0..200).map(|i| clock.push(changed + i * PERIOD_NS, Some(30 + i))).collect();
        let at = time(found[199]);
        assert!(at.abs_diff(changed + 199 * PERIOD_NS) < 1000, "{found:?}");
    }

    #[test]
    fn clocks_that_jump_either_way_are_followed() {
        for jump_ns in [3_600_000_000_000_i64, -3_600_000_000_000, 700_000_000, 300_000_000, -300_000_000] {
            for has_ticks in [true, false] {
                let mut clock = ClockRegression::default();
                let mut push = |i: u64, shift: i64| {
                    clock.push((START_NS + i * PERIOD_NS).saturating_add_signed(shift), has_ticks.then_some(i))
                };
                (0..30).for_each(|i| assert!(matches!(push(i, 0), Timing::At(_))));
                let found = [push(30, jump_ns), push(31, jump_ns), push(32, jump_ns)];
                if !has_ticks && jump_ns > 0 {
                    // Without a device clock the jump looks like a gap.
                    assert!(found.iter().all(|t| matches!(t, Timing::At(_))), "{found:?}");
                    continue;
                }
                match jump_ns {
                    // At this point the jump is indistinguishable from a delay.
                    300_000_000 => assert!(matches!(found[..2], [Timing::At(_), Timing::At(_)]), "{found:?}"),
                    1.. => assert_eq!(found[..2], [Timing::Outlier; 2], "{jump_ns}"),
                    _ => assert_eq!(found[..2], [Timing::NotRising; 2], "{jump_ns}"),
                }
                let expected = (START_NS + 32 * PERIOD_NS).saturating_add_signed(jump_ns);
                assert!(matches!(found[2], Timing::Jumped(at) if at.abs_diff(expected) < 1000), "{found:?}");
                assert!(matches!(push(33, jump_ns), Timing::At(_)));
            }
        }
    }

    #[test]
    fn measurements_of_unchanged_time_are_not_used() {
        let mut clock = ClockRegression::default();
        assert_eq!(clock.push(START_NS, None), Timing::At(START_NS));
        for _ in 0..10 {
            assert_eq!(clock.push(START_NS, None), Timing::NotRising);
        }
        // With a device clock, several records of one message have separate times.
        let mut clock = ClockRegression::default();
        (0..20).for_each(|i| assert!(matches!(clock.push(START_NS + i * PERIOD_NS, Some(i)), Timing::At(_))));
        let burst: Vec<_> = (20..23).map(|i| time(clock.push(START_NS + 22 * PERIOD_NS, Some(i)))).collect();
        assert!(burst.is_sorted_by(|a, b| b - a > PERIOD_NS / 5), "{burst:?}");
    }

    proptest! {
        #![proptest_config(ProptestConfig { failure_persistence: None, ..ProptestConfig::default() })]

        #[test]
        fn times_rise_for_any_input(
            steps in prop::collection::vec((-40_000_000_i64..800_000_000, 1_u64..50_000, any::<bool>()), 1..200),
            start in prop_oneof![Just(0_u64), Just(u64::MAX), any::<u64>()],
        ) {
            let mut clock = ClockRegression::default();
            let (mut host, mut ticks, mut last) = (start, 0_u64, None);
            for (step, tick, has_ticks) in steps {
                host = host.saturating_add_signed(step);
                ticks += tick;
                match clock.push(host, has_ticks.then_some(ticks)) {
                    Timing::At(at) => {
                        prop_assert!(last.is_none_or(|last| at > last || at == u64::MAX));
                        last = Some(at);
                    }
                    Timing::Jumped(at) => last = Some(at),
                    Timing::NotRising | Timing::Outlier => {}
                }
            }
        }
    }
}
