//! Detection of stuck sensors: a working sensor has noise, so readings that stay exactly equal mean that it hangs.

use super::Reading;

/// Smallest number of equal readings that counts as stuck, however long they last.
const LEAST_READINGS: u32 = 20;

/// Detects readings that stay exactly equal.
#[derive(Debug, Clone)]
pub(crate) struct StuckWatch {
    limit_ns: u64,
    last: Option<Reading>,
    /// Time of the first of the equal readings.
    since_ns: u64,
    readings: u32,
    stuck: bool,
}

impl StuckWatch {
    /// Detector for equal readings that last `limit_ms`; 0 switches it off.
    pub(crate) fn new(limit_ms: f64) -> Self {
        Self { limit_ns: (limit_ms * 1e6) as u64, last: None, since_ns: 0, readings: 0, stuck: false }
    }

    /// Takes a reading with its time, ns. Returns true if the sensor becomes stuck with this reading.
    pub(crate) fn push(&mut self, reading: &Reading, time_ns: u64) -> bool {
        if self.limit_ns == 0 {
            return false;
        }
        if self.last.as_ref() != Some(reading) || time_ns < self.since_ns {
            *self = Self { last: Some(*reading), since_ns: time_ns, readings: 1, stuck: false, ..*self };
            return false;
        }
        self.readings = self.readings.saturating_add(1);
        let was_stuck = self.stuck;
        self.stuck = self.readings >= LEAST_READINGS && time_ns - self.since_ns >= self.limit_ns;
        self.stuck && !was_stuck
    }

    /// Whether the sensor is stuck.
    pub(crate) fn is_stuck(&self) -> bool {
        self.stuck
    }
}

#[cfg(test)]
mod tests {
    use glam::DQuat;

    use super::*;

    #[test]
    fn equal_readings_are_stuck_once_until_one_differs() {
        let mut watch = StuckWatch::new(1000.0);
        let still = Reading::Orientation(DQuat::IDENTITY);
        let began: Vec<u64> = (0..200).filter(|i| watch.push(&still, i * 10_000_000)).collect();
        assert_eq!((began, watch.is_stuck()), (vec![100], true));
        assert!(!watch.push(&Reading::Orientation(DQuat::from_rotation_x(1e-9)), 2_000_000_000));
        assert!(!watch.is_stuck());
    }

    #[test]
    fn a_few_rare_readings_are_not_stuck_and_zero_switches_the_check_off() {
        let still = Reading::Orientation(DQuat::IDENTITY);
        let mut watch = StuckWatch::new(1000.0);
        assert!((0..19).all(|i| !watch.push(&still, i * 1_000_000_000)));
        let mut off = StuckWatch::new(0.0);
        assert!((0..1000).all(|i| !off.push(&still, i * 1_000_000_000)));
    }
}
