//! Detection of silent devices.

use std::time::Duration;

/// Largest factor by which repeated restarts extend the silence limit: each restart may itself take long.
const FACTOR_MAX: u32 = 8;

/// Measurement of a device's silence. All times are on the driver's clock.
pub(super) struct SilenceWatch {
    /// Whether silence of the device is normal.
    may_rest: bool,
    /// Time of the last record, or of opening the port.
    last_record: Duration,
    /// Start of the current silence: `last_record`, the last restart, or the last reported silence.
    from: Duration,
    /// Silence limit at the last check.
    last_limit: Duration,
    /// Whether the device already had its extra time for a first record after set-up.
    had_grace: bool,
    /// Number of restarts since the last record.
    attempt: u32,
}

impl SilenceWatch {
    /// Watch of a device; if `may_rest`, it may be silent at rest.
    pub(super) fn new(may_rest: bool) -> Self {
        let zero = Duration::ZERO;
        Self { may_rest, last_record: zero, from: zero, last_limit: zero, had_grace: false, attempt: 0 }
    }

    /// Number of restarts since the last record.
    pub(super) fn attempt(&self) -> u32 {
        self.attempt
    }

    /// Records that the port was opened.
    pub(super) fn opened(&mut self, now: Duration) {
        self.last_record = now;
    }

    /// Records that the device was restarted.
    pub(super) fn restarted(&mut self, now: Duration) {
        self.from = now;
        // The limit of the previous start does not apply to the new start.
        self.last_limit = Duration::ZERO;
        self.had_grace = false;
    }

    /// Records that a record or an error report of the device arrived.
    pub(super) fn answered(&mut self, now: Duration) {
        (self.last_record, self.from) = (now, now);
        self.had_grace = false;
        self.attempt = 0;
    }

    /// Time at which the device counts as silent if its driver accepts a silence of `limit`.
    pub(super) fn deadline(&mut self, limit: Duration, now: Duration) -> Duration {
        if self.may_rest {
            return Duration::MAX;
        }
        let limit = limit.saturating_mul(self.attempt.saturating_add(1).min(FACTOR_MAX));
        // When the long limit of a set-up ends, the device gets the whole shorter limit for its first record. That
        // happens only once per start: a device that is set up repeatedly and never answers counts as silent.
        if limit < self.last_limit && !self.had_grace {
            self.from = now;
            self.had_grace = true;
        }
        self.last_limit = limit;
        self.from.saturating_add(limit)
    }

    /// Counts a silence and restarts its measurement at `now`. Returns the time since the last record.
    pub(super) fn silent(&mut self, now: Duration) -> Duration {
        self.attempt = self.attempt.saturating_add(1);
        self.from = now;
        now - self.last_record
    }
}
