//! Summary of a session's changes of the operating point.

use serde::Serialize;

use super::{PointChange, PointController};
use crate::presented::PointText;

/// Largest number of changes listed in a summary.
const LISTED: usize = 100;

/// A change of the operating point.
#[derive(Debug, Clone, PartialEq, Serialize)]
pub struct Switch {
    /// Time in the session, s.
    pub time_s: f64,
    /// Name of the new point.
    pub to: String,
    /// Reason for the change.
    pub reason: String,
}

/// Summary of a session's operating points.
#[derive(Debug, Clone, PartialEq, Serialize)]
pub struct PointSummary {
    /// Largest time of a frame, ms; of a generator run if frame times aren't limited.
    pub limit_ms: f64,
    /// Name of the first point.
    pub begun: String,
    /// Why the first point has a generator or none; `None` without generators.
    pub generator_reason: Option<String>,
    /// Name of the last point.
    pub ended: String,
    /// Error of the last point at the probe's last speed, grey levels; `None` if the quality was fixed.
    pub error: Option<f64>,
    /// Number of changes to a cheaper point.
    pub lowered: u64,
    /// Number of changes to a better point.
    pub raised: u64,
    /// Number of points that were too large for the device.
    pub refused: u64,
    /// Whether a watcher set the quality by hand. From then on, the controller chose only generators, if any.
    pub by_hand: bool,
    /// The first hundred changes.
    pub changes: Vec<Switch>,
}

/// Numbers of changes so far.
#[derive(Debug, Clone, Copy, Default)]
pub(super) struct Counts {
    pub(super) lowered: u64,
    pub(super) raised: u64,
    pub(super) refused: u64,
    /// Whether the last change was to a better point, and whether it is listed.
    last: (bool, bool),
}

impl PointController {
    pub(super) fn note(&mut self, time_s: f64, change: &PointChange, raised: bool) {
        let listed = self.switches.len() < LISTED;
        if listed {
            let to = self.name(&change.to);
            self.switches.push(Switch { time_s, to, reason: change.reason.clone() });
        }
        self.counts.raised += u64::from(raised);
        self.counts.lowered += u64::from(!raised);
        self.counts.last = (raised, listed);
    }

    /// Removes the last change from the summary, because the device refused it.
    pub(super) fn undo_note(&mut self) {
        let (raised, listed) = self.counts.last;
        if listed {
            self.switches.pop();
        }
        self.counts.raised -= u64::from(raised);
        self.counts.lowered -= u64::from(!raised);
        self.counts.refused += 1;
    }

    /// The first point of the session, as text for viewers.
    pub fn text(&self) -> PointText {
        let (ms, limit_ms) = (self.expected_ms(&self.point()), self.limit_ms());
        PointText {
            name: self.name(&self.point()),
            reason: format!("it took {ms:.0} ms of {limit_ms:.0} when measured"),
        }
    }

    /// Summary of the session so far.
    pub fn summary(&self) -> PointSummary {
        PointSummary {
            limit_ms: self.limit_ms(),
            begun: self.begun.clone(),
            generator_reason: self.generator_reason.clone(),
            ended: self.name(&self.point()),
            error: self.budget.frame_ms.is_some().then(|| self.error(self.current)),
            lowered: self.counts.lowered,
            raised: self.counts.raised,
            refused: self.counts.refused,
            by_hand: self.by_hand,
            changes: self.switches.clone(),
        }
    }
}
