//! Summary of a session, for its end.

use std::collections::BTreeMap;

use serde::Serialize;

use super::histogram::Percentiles;
use super::quality_budget::QualitySummary;

/// Summary of one sink.
#[derive(Debug, Clone, PartialEq, Eq, Default, Serialize)]
pub struct SinkSummary {
    /// Its name.
    pub name: String,
    /// Frames that it was given.
    pub offered: u64,
    /// Frames that it took.
    pub taken: u64,
    /// Frames that newer ones replaced, or that came after it was closed.
    pub dropped: u64,
    /// Frames that the presenter held up for it; only the log of frames has any.
    pub waited: u64,
    /// Frames that it failed on.
    pub failed: u64,
    /// Reason for closing it before the end, or for not finishing.
    pub error: Option<String>,
    /// Whether it had not come back when the session ended.
    pub stuck: bool,
}

/// Summary of the generator.
#[derive(Debug, Clone, PartialEq, Eq, Default, Serialize)]
pub struct GeneratorSummary {
    /// Frames that it was given.
    pub offered: u64,
    /// Frames that it translated.
    pub done: u64,
    /// Of these, after their deadline.
    pub late: u64,
    /// Frames that newer ones replaced, or that came while it rested or no tier kept the budget.
    pub dropped: u64,
    /// Frames that it failed on.
    pub failed: u64,
    /// Runs that were told to end since they took too long, or that no provider could tell.
    pub hung: u64,
    /// Of these, runs that did not end all the same, and were given up.
    pub given_up: u64,
    /// Whether it had not come back when the session ended.
    pub stuck: bool,
}

/// Summary of a session.
#[derive(Debug, Clone, PartialEq, Serialize)]
pub struct Summary {
    /// Length of the session, s.
    pub elapsed_s: f64,
    /// Frames begun: presented + all of `drops`.
    pub produced: u64,
    /// Frames handed to the sinks.
    pub presented: u64,
    /// Frames begun and not presented, by cause.
    pub drops: BTreeMap<&'static str, u64>,
    /// Ticks at which no frame was begun: the device was slower than the frame rate.
    pub missed_ticks: u64,
    /// Presented frames a second, from the first to the last.
    pub frames_per_s: f64,
    /// Part of the presented frames that showed a generated picture, its own or a held one.
    pub enhanced_ratio: f64,
    /// Presented frames by picture: enhanced, held, low quality.
    pub by_source: [u64; 3],
    /// Presented frames by the state of their pose: good, held, stuck, stale, lost.
    pub by_tracking: [u64; 5],
    /// First byte of a new pose until the frame was handed to the sinks; from sampling where there is no tracker.
    pub pose_to_present: Option<Percentiles>,
    /// Pose sampled until handed to the sinks.
    pub sample_to_present: Option<Percentiles>,
    /// Submitted until in memory.
    pub render: Option<Percentiles>,
    /// Generator runs of presented frames.
    pub inference: Option<Percentiles>,
    /// Devices lost and rebuilt.
    pub device_losses: u64,
    /// Of these, rebuilt.
    pub device_rebuilt: u64,
    /// Controls applied.
    pub controls: u64,
    /// Controls that were out of range.
    pub controls_refused: u64,
    /// Changes of the quality by its budget; none without one.
    pub quality: Option<QualitySummary>,
    /// The generator, where there is one.
    pub generator: Option<GeneratorSummary>,
    /// Each sink.
    pub sinks: Vec<SinkSummary>,
    /// Stages that had not ended when they should have.
    pub stuck: Vec<String>,
    /// Resident memory at the end, bytes, where the system tells it.
    pub memory_bytes: Option<u64>,
}
