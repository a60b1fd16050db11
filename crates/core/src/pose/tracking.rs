//! Trustworthiness of a live pose.

/// State of the probe's pose, from best to worst, as shown to the user.
#[derive(Debug, Clone, Copy, PartialEq, Eq, Default, PartialOrd, Ord)]
pub enum TrackingState {
    /// The pose was measured recently.
    Good,
    /// The last pose is held over a short gap, or measurements have just resumed.
    Held,
    /// Measurements arrive, but have been exactly equal for too long: the sensor hangs.
    Stuck,
    /// No recent measurement: the picture no longer follows the probe.
    Stale,
    /// No measurement yet, or none for so long that the display shows no picture.
    #[default]
    Lost,
}

crate::names::named!(TrackingState {
    Good = "good",
    Held = "held",
    Stuck = "stuck",
    Stale = "stale",
    Lost = "lost",
});

impl TrackingState {
    /// Whether the picture follows the probe: the pose is measured, or held over a short gap.
    pub fn is_live(self) -> bool {
        self <= Self::Held
    }
}

/// Number of consecutive measurements without a gap after which a pose is good again. At the edge of the field of
/// view, single measurements may come and go.
const GOOD_RUN: u32 = 3;

/// Derives the tracking state from the age of the last measurement.
#[derive(Debug, Clone)]
pub(crate) struct TrackingClock {
    held_ns: u64,
    stale_ns: u64,
    lost_ns: u64,
    last_ns: Option<u64>,
    /// Number of consecutive measurements without a gap.
    run: u32,
    /// Whether the device is silent because it is at rest.
    resting: bool,
}

impl TrackingClock {
    /// Clock with the ages of the last measurement above which a pose is held, stale and lost, ms, ascending.
    pub(crate) fn new(held_ms: f64, stale_ms: f64, lost_ms: f64) -> Self {
        let ns = |ms: f64| (ms * 1e6) as u64;
        let [held_ns, stale_ns, lost_ns] = [ns(held_ms), ns(stale_ms), ns(lost_ms)];
        Self { held_ns, stale_ns, lost_ns, last_ns: None, run: 0, resting: false }
    }

    /// Records a used measurement at `time_ns`. If `resting`, the device stays silent until it moves.
    pub(crate) fn seen(&mut self, time_ns: u64, resting: bool) {
        let gap = self.last_ns.is_none_or(|last| time_ns.saturating_sub(last) > self.held_ns);
        self.run = match (resting || self.resting, gap) {
            (true, _) => GOOD_RUN,
            (false, true) => 1,
            (false, false) => self.run.saturating_add(1),
        };
        self.resting = resting;
        self.last_ns = Some(time_ns);
    }

    /// Records that the device is disconnected, or reports the sensor out of view.
    pub(crate) fn interrupted(&mut self) {
        self.run = 0;
        self.resting = false;
    }

    /// Forgets all measurements.
    pub(crate) fn forget(&mut self) {
        self.interrupted();
        self.last_ns = None;
    }

    /// Moves the stored time `by_ns` earlier, after the host clock was set back.
    pub(crate) fn set_back(&mut self, by_ns: u64) {
        self.last_ns = self.last_ns.map(|last| last.saturating_sub(by_ns));
    }

    /// Tracking state at `now_ns`.
    pub(crate) fn at(&self, now_ns: u64) -> TrackingState {
        let Some(last_ns) = self.last_ns else { return TrackingState::Lost };
        let age_ns = if self.resting { 0 } else { now_ns.saturating_sub(last_ns) };
        match age_ns {
            age if age > self.lost_ns => TrackingState::Lost,
            age if age > self.stale_ns => TrackingState::Stale,
            age if age > self.held_ns || self.run < GOOD_RUN => TrackingState::Held,
            _ => TrackingState::Good,
        }
    }
}

#[cfg(test)]
mod tests {
    use super::TrackingState::{Good, Held, Lost, Stale};
    use super::*;

    const MS: u64 = 1_000_000;

    fn clock() -> TrackingClock {
        TrackingClock::new(100.0, 500.0, 2000.0)
    }

    #[test]
    fn the_state_grows_worse_with_age() {
        let mut clock = clock();
        assert_eq!(clock.at(0), Lost);
        (0..5).for_each(|i| clock.seen(i * 16 * MS, false));
        let last = 4 * 16 * MS;
        let states = [0, 100, 101, 500, 501, 2000, 2001].map(|age| clock.at(last + age * MS));
        assert_eq!(states, [Good, Good, Held, Held, Stale, Stale, Lost]);
        assert_eq!(clock.at(0), Good, "a time before the last measurement is no age");
    }

    #[test]
    fn the_state_is_good_again_only_after_a_run() {
        let mut clock = clock();
        let mut states = Vec::new();
        // One measurement every 150 ms never makes a good pose.
        for i in 0..10 {
            clock.seen(i * 150 * MS, false);
            states.push(clock.at(i * 150 * MS));
        }
        assert_eq!(states, [Held; 10]);
        let states = [1400, 1450].map(|t| {
            clock.seen(t * MS, false);
            clock.at(t * MS)
        });
        assert_eq!(states, [Held, Good]);
        clock.interrupted();
        assert_eq!(clock.at(1450 * MS), Held);
    }

    #[test]
    fn a_device_that_is_silent_at_rest_stays_good_until_it_is_disconnected() {
        let mut clock = clock();
        clock.seen(0, true);
        assert_eq!(clock.at(3_600_000 * MS), Good);
        clock.seen(3_600_000 * MS, false);
        assert_eq!(clock.at(3_600_000 * MS), Good);
        assert_eq!(clock.at(3_600_150 * MS), Held);
        clock.seen(3_700_000 * MS, true);
        clock.interrupted();
        assert_eq!(clock.at(3_700_600 * MS), Stale);
    }

    #[test]
    fn a_clock_that_was_set_back_keeps_the_age() {
        let mut clock = clock();
        (0..5).for_each(|i| clock.seen((1000 + i * 16) * MS, false));
        clock.set_back(900 * MS);
        assert_eq!([164, 265].map(|t| clock.at(t * MS)), [Good, Held]);
    }
}
