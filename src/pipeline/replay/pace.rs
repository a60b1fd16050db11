//! Speed of a replay: frames at once, or when they are due.

use std::str::FromStr;
use std::thread;
use std::time::{Duration, Instant};

/// Speed of a replay.
#[derive(Debug, Clone, Copy, PartialEq)]
pub enum ReplaySpeed {
    /// As fast as possible.
    Max,
    /// Replayed seconds of the recording per second.
    Factor(f64),
}

impl FromStr for ReplaySpeed {
    type Err = String;

    fn from_str(text: &str) -> Result<Self, String> {
        if text == "max" {
            return Ok(Self::Max);
        }
        match text.parse() {
            Ok(factor) if (0.01..=1000.0).contains(&factor) => Ok(Self::Factor(factor)),
            _ => Err("expected max, or a factor in 0.01..=1000".to_owned()),
        }
    }
}

/// Delays frames until they are due. Late frames do not cause others to be dropped.
pub struct Pace {
    /// Frame interval; `None` at full speed.
    interval: Option<Duration>,
    started: Option<Instant>,
    behind: Duration,
}

impl Pace {
    /// Paces `fps` frames per recorded second.
    pub fn new(speed: ReplaySpeed, fps: f64) -> Self {
        let interval = match speed {
            ReplaySpeed::Max => None,
            ReplaySpeed::Factor(factor) => Some(Duration::from_secs_f64(1.0 / (fps * factor))),
        };
        Self { interval, started: None, behind: Duration::ZERO }
    }

    /// Waits until `frame` is due; the first frame is due at once and starts the clock.
    pub fn wait(&mut self, frame: usize) {
        let Some(due) = self.due(frame) else { return };
        let elapsed = self.started.get_or_insert_with(Instant::now).elapsed();
        match due.checked_sub(elapsed) {
            Some(left) => thread::sleep(left),
            None => self.behind = self.behind.max(elapsed - due),
        }
    }

    /// Due time of a frame, since the first one; `None` at full speed.
    fn due(&self, frame: usize) -> Option<Duration> {
        self.interval.map(|interval| interval.mul_f64(frame as f64))
    }

    /// Greatest delay of a frame, s; `None` at full speed.
    pub fn behind_s(&self) -> Option<f64> {
        self.interval.map(|_| self.behind.as_secs_f64())
    }
}

#[cfg(test)]
mod tests {
    use super::*;

    #[test]
    fn speeds_are_understood() {
        assert_eq!("max".parse(), Ok(ReplaySpeed::Max));
        assert_eq!("2.5".parse(), Ok(ReplaySpeed::Factor(2.5)));
        for wrong in ["", "0", "-1", "NaN", "inf", "fast", "1001"] {
            assert!(wrong.parse::<ReplaySpeed>().is_err(), "{wrong}");
        }
    }

    #[test]
    fn frames_are_due_by_rate_and_speed() {
        let due = |speed, frame| Pace::new(speed, 20.0).due(frame);
        assert_eq!(due(ReplaySpeed::Factor(1.0), 30), Some(Duration::from_millis(1500)));
        assert_eq!(due(ReplaySpeed::Factor(4.0), 80), Some(Duration::from_secs(1)));
        assert_eq!(due(ReplaySpeed::Max, 80), None);
    }
}
