//! Damaged pieces of a stream, counted and reported at a limited rate.

use std::time::Duration;

use crate::tracker::{Damage, DecodeError};

/// Time from the first damaged piece to its report, so that enough bytes arrive for a diagnosis.
const FIRST_AFTER: Duration = Duration::from_secs(1);

/// Shortest time between two reports.
const REPORT_PERIOD: Duration = Duration::from_secs(5);

/// Collector of damaged pieces for reports.
#[derive(Debug, Default)]
pub(super) struct DamageWatch {
    damaged: u64,
    reported: u64,
    records: u64,
    example: Option<DecodeError>,
    /// Start of the counts.
    since: Duration,
    /// Time of the next report, if there is something to report.
    due: Option<Duration>,
    /// Earliest time of the next report.
    not_before: Duration,
}

impl DamageWatch {
    /// Counts a record.
    pub(super) fn record(&mut self) {
        self.records += 1;
    }

    /// Counts a damaged piece or a report of the device.
    pub(super) fn push(&mut self, error: &DecodeError, now: Duration) {
        if error.is_of_device() {
            self.reported += 1;
        } else {
            self.damaged += 1;
        }
        // A damaged piece is a better example than the device's error report about it.
        if self.damaged == 0 || !error.is_of_device() {
            self.example = Some(error.clone());
        }
        if self.due.is_none() {
            let least = if error.is_of_device() { now } else { now + FIRST_AFTER };
            self.due = Some(least.max(self.not_before));
        }
    }

    /// Time of the next report; `None` without damage.
    pub(super) fn due_at(&self) -> Option<Duration> {
        self.due
    }

    /// Damaged pieces and records since the last report.
    pub(super) fn counts(&self) -> (u64, u64) {
        (self.damaged, self.records)
    }

    /// Report with a remedy; `None` without damage.
    pub(super) fn report(&mut self, now: Duration, remedy: Option<String>) -> Option<Damage> {
        let example = self.example.take();
        let damage = example.map(|example| Damage {
            damaged: self.damaged,
            reported: self.reported,
            records: self.records,
            time: now.saturating_sub(self.since),
            example,
            remedy,
        });
        *self = Self { since: now, not_before: now + REPORT_PERIOD, ..Self::default() };
        damage
    }

    /// Restarts the counts if there is nothing to report, so that a report counts only the records of its last
    /// seconds.
    pub(super) fn refresh(&mut self, now: Duration) {
        if self.example.is_none() && now.saturating_sub(self.since) >= REPORT_PERIOD {
            (self.records, self.since) = (0, now);
        }
    }
}
