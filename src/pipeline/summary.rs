//! Summary of an ended session.

use std::collections::BTreeMap;

use serde::Serialize;

use super::histogram::Percentiles;
use super::needle_stage::NeedleSummary;
use super::tracker_watch::TrackerSummary;
use crate::chooser::PointSummary;
use crate::transducer::placement::{Fault, Misplacement, Untouched};

/// Summary of one sink.
#[derive(Debug, Clone, PartialEq, Eq, Default, Serialize)]
pub struct SinkSummary {
    /// Name of the sink.
    pub name: String,
    /// Number of frames offered to the sink.
    pub offered: u64,
    /// Number of frames that it took.
    pub taken: u64,
    /// Number of frames replaced by newer ones, or offered after the sink was closed.
    pub dropped: u64,
    /// Number of frames that waited in the presenter until the sink had room; nonzero only for the log of frames.
    pub waited: u64,
    /// Number of frames on which the sink failed.
    pub failed: u64,
    /// Error that closed the sink early, or that prevented it from finishing; none if there was no such error.
    pub error: Option<String>,
    /// Whether the sink did not end within its time at the session's end.
    pub stuck: bool,
}

/// Summary of the generator.
#[derive(Debug, Clone, PartialEq, Eq, Default, Serialize)]
pub struct GeneratorSummary {
    /// Number of frames offered to the generator.
    pub offered: u64,
    /// Number of frames that it translated.
    pub done: u64,
    /// Number of translated frames that came after their deadline.
    pub late: u64,
    /// Number of frames replaced by newer ones, or offered while the generator could not run: the frame lacked maps, or
    /// no buffer was free.
    pub dropped: u64,
    /// Number of frames on which the generator failed.
    pub failed: u64,
    /// Number of runs over the time limit; they are terminated if the provider can stop a run.
    pub hung: u64,
    /// Number of runs over the time limit that did not end and were given up.
    pub given_up: u64,
    /// Whether the generator did not end within its time at the session's end.
    pub stuck: bool,
}

/// Numbers of presented frames with a misplaced probe: where no hand can hold it, for some seconds.
#[derive(Debug, Clone, Copy, PartialEq, Default, Serialize)]
pub struct MisplacedSummary {
    /// Number of frames whose probe face is deep in the body.
    pub deep: u64,
    /// Number of frames whose probe looks out of the body.
    pub looks_out: u64,
    /// Latest misplacement, with its likely cause; none if the probe was never misplaced.
    pub latest: Option<Misplacement>,
    /// Good poses of a probe that has never touched the skin. None after a touch, and during the first 20 s of good
    /// poses.
    pub untouched: Option<Untouched>,
}

impl MisplacedSummary {
    /// Counts a frame.
    pub(super) fn count(&mut self, misplaced: Option<Misplacement>) {
        match misplaced.map(|found| found.fault) {
            Some(Fault::Deep { .. }) => self.deep += 1,
            Some(Fault::LooksOut) => self.looks_out += 1,
            None => {}
        }
        self.latest = misplaced.or(self.latest);
    }
}

/// Summary of a session. Percentiles are `None` if there is nothing to measure.
#[derive(Debug, Clone, PartialEq, Serialize)]
pub struct Summary {
    /// Duration of the session, from the start of its stages to the request to end, s.
    pub elapsed_s: f64,
    /// Start of the stages, ms on the clock of the frames' times.
    pub start_ms: f64,
    /// Presentation of the first frame, s since the start of the stages; none without a frame.
    pub first_frame_s: Option<f64>,
    /// Presentation of the last frame, s since the start of the stages; none without a frame.
    pub last_frame_s: Option<f64>,
    /// Number of frames begun: `presented` + the sum of `drops`.
    pub produced: u64,
    /// Number of frames handed to the sinks.
    pub presented: u64,
    /// Numbers of frames begun but not presented, by cause.
    pub drops: BTreeMap<&'static str, u64>,
    /// Number of ticks of the frame rate: the sum of `produced` and `missed_ticks`.
    pub ticks: u64,
    /// Number of ticks without a frame: the device was slower than the frame rate.
    pub missed_ticks: u64,
    /// Presented frames per second, from `first_frame_s` to `last_frame_s`.
    pub frames_per_s: f64,
    /// Fraction of presented frames with a generated picture, their own or a held one.
    pub generated_ratio: f64,
    /// Numbers of presented frames by picture: generated, held, raw.
    pub by_source: [u64; 3],
    /// Numbers of presented frames by the state of their pose: good, held, stuck, stale, lost.
    pub by_tracking: [u64; 5],
    /// Numbers of presented frames with a misplaced probe.
    pub misplaced: MisplacedSummary,
    /// Time from the first byte of the newest measurement to the handover of the frame to the sinks. Without a tracker
    /// it starts at sampling. Frames with a held or repeated pose are left out.
    pub pose_to_present: Option<Percentiles>,
    /// Time from the first byte of every measurement to the handover of the first frame that shows it. It includes
    /// the wait for the tick and for the confirmation of a jump.
    pub motion_to_present: Option<Percentiles>,
    /// Time from the first byte of each measurement that showed a jump of the pose to the handover of the first frame
    /// after the jump. A second measurement had to confirm the jump.
    pub jump_to_present: Option<Percentiles>,
    /// Time from the sampling of the pose to the handover to the sinks, for all frames with a picture.
    pub sample_to_present: Option<Percentiles>,
    /// Time from submission until the frame is in memory, for all frames with a picture.
    pub render: Option<Percentiles>,
    /// Duration of generator runs whose picture was shown in its own frame.
    pub inference: Option<Percentiles>,
    /// Number of times that the rendering device was lost.
    pub device_losses: u64,
    /// Number of lost devices that were opened again.
    pub device_rebuilt: u64,
    /// Number of controls applied.
    pub controls: u64,
    /// Number of controls refused because a value was out of range.
    pub controls_refused: u64,
    /// Totals of the tracker; none without one.
    pub tracker: Option<TrackerSummary>,
    /// Operating points; none if the quality was fixed and had no generator.
    pub points: Option<PointSummary>,
    /// Summary of the generator; none without one.
    pub generator: Option<GeneratorSummary>,
    /// Summary of the needle's tip; none without a needle, and for a pointer.
    pub needle: Option<NeedleSummary>,
    /// Summary of each sink.
    pub sinks: Vec<SinkSummary>,
    /// Names of stages that panicked or did not end in time.
    pub stuck: Vec<String>,
    /// Resident memory at the end, bytes; none if the system does not report it.
    pub memory_bytes: Option<u64>,
}

impl Summary {
    /// Errors of sinks, else parts that did not end in time; `None` if there are neither.
    pub fn failure(&self) -> Option<String> {
        let failed: Vec<&str> = self.sinks.iter().filter_map(|sink| sink.error.as_deref()).collect();
        let stuck = || format!("did not end in time: {}", self.stuck.join(", "));
        match failed[..] {
            [] => (!self.stuck.is_empty()).then(stuck),
            _ => Some(failed.join("; ")),
        }
    }
}
