//! Summary of the changes that a controller made in a session.

use serde::Serialize;

use super::{PointChange, PointController};
use crate::presented::PointText;

/// Most changes that a summary lists.
const LISTED: usize = 100;

/// A change of the operating point.
#[derive(Debug, Clone, PartialEq, Serialize)]
pub struct Switch {
    /// Time in the session, s.
    pub time_s: f64,
    /// Name of the point from then on.
    pub to: String,
    /// Why.
    pub reason: String,
}

/// Operating points of a session.
#[derive(Debug, Clone, PartialEq, Serialize)]
pub struct PointSummary {
    /// Time that a frame may take, or a run where frames aren't limited, ms.
    pub limit_ms: f64,
    /// Point at the start.
    pub begun: String,
    /// Why the point at the start has a generator or none; none without generators.
    pub generator_reason: Option<String>,
    /// Point at the end.
    pub ended: String,
    /// Error of the point at the end, at the probe's speed then, grey levels; none of a quality that was fixed.
    pub error: Option<f64>,
    /// Changes to a cheaper point.
    pub lowered: u64,
    /// Changes to a better point.
    pub raised: u64,
    /// Points for which the device had no room.
    pub refused: u64,
    /// Whether a watcher set the quality by hand; from then on at most the generator was chosen.
    pub by_hand: bool,
    /// The first hundred changes.
    pub changes: Vec<Switch>,
}

/// Counted changes.
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

    /// Takes the last change back: it was refused.
    pub(super) fn undo_note(&mut self) {
        let (raised, listed) = self.counts.last;
        if listed {
            self.switches.pop();
        }
        self.counts.raised -= u64::from(raised);
        self.counts.lowered -= u64::from(!raised);
        self.counts.refused += 1;
    }

    /// The point of the session's start, for viewers.
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
