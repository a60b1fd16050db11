//! A presented frame as a line of JSON, without its maps.

use std::time::Duration;

use serde::Serialize;

use crate::presented::PresentedFrame;
use crate::transducer::Contact;

/// Fields of a frame's line. All times are ms since the session began.
#[derive(Debug, Clone, PartialEq, Serialize)]
pub(crate) struct FrameLine<'a> {
    /// Number of the frame.
    pub number: u64,
    /// File of the image, if any.
    #[serde(skip_serializing_if = "Option::is_none")]
    pub file: Option<&'a str>,
    /// `generated`, `held_generated` or `raw`.
    pub source: &'static str,
    /// `good`, `held`, `stuck`, `stale` or `lost`.
    pub tracking: &'static str,
    /// `scene_from_probe` [x, y, z (mm), qw, qx, qy, qz]; none without a picture.
    pub pose: Option<[f64; 7]>,
    /// Tracking of the needle, as the probe's; left out without a needle.
    #[serde(skip_serializing_if = "Option::is_none")]
    pub needle_tracking: Option<&'static str>,
    /// `scene_from_needle` [x, y, z (mm), qw, qx, qy, qz]; left out if it is unknown.
    #[serde(skip_serializing_if = "Option::is_none")]
    pub needle: Option<[f64; 7]>,
    /// Contact of the probe's face with the skin; none without the effect `contact`.
    pub contact: Option<Contact>,
    /// Number of tracker measurements that no earlier frame showed.
    pub new_measurements: u64,
    /// Time from the first byte of the newest measurement to `presented_ms`; none for a held or repeated pose.
    pub pose_to_present_ms: Option<f64>,
    /// Time from the first byte of the measurement that first showed a jump to `presented_ms`; none without a new
    /// jump.
    pub jump_to_present_ms: Option<f64>,
    /// Arrival of the first byte of the tracker record that gave the pose; none without a tracker.
    pub first_byte_ms: Option<f64>,
    /// Time at which the pose was sampled.
    pub sampled_ms: f64,
    /// Submission of the render.
    pub submitted_ms: f64,
    /// Arrival of the rendered frame in memory.
    pub rendered_ms: f64,
    /// Start and end of the generator's run on this frame; none if none ran.
    pub inference_ms: Option<[f64; 2]>,
    /// Handover to the sinks.
    pub presented_ms: f64,
    /// Name of the generator that made the picture; none on raw frames.
    pub generator: Option<&'a str>,
    /// Operating point; none without a controller of operating points.
    #[serde(skip_serializing_if = "Option::is_none")]
    pub point: Option<&'a str>,
    /// Whether the picture is frozen.
    pub frozen: bool,
    /// Latest fault; none if there was none recently.
    pub notice: Option<&'a str>,
}

impl<'a> FrameLine<'a> {
    /// The line of `frame`.
    pub(crate) fn new(frame: &'a PresentedFrame) -> Self {
        let times = &frame.info.timeline;
        let ms = |time: Duration| time.as_secs_f64() * 1e3;
        Self {
            number: frame.number,
            file: None,
            source: frame.source.name(),
            tracking: frame.info.estimate.state.name(),
            pose: frame.info.pose().map(|pose| pose.components()),
            needle_tracking: frame.info.needle.map(|needle| needle.state.name()),
            needle: frame
                .info
                .needle
                .and_then(|estimate| estimate.needle)
                .map(|needle| needle.scene_from_needle.components()),
            contact: frame.info.contact,
            new_measurements: frame.info.new.count,
            pose_to_present_ms: frame.info.pose_to_present().map(ms),
            jump_to_present_ms: frame.info.jump_to_present().map(ms),
            first_byte_ms: times.first_byte.map(ms),
            sampled_ms: ms(times.sampled),
            submitted_ms: ms(times.submitted),
            rendered_ms: ms(times.rendered),
            inference_ms: times.inference.map(|(start, end)| [ms(start), ms(end)]),
            presented_ms: ms(times.presented),
            generator: frame.generator.as_deref(),
            point: frame.point.as_deref().map(|point| &*point.name),
            frozen: frame.info.settings.frozen,
            notice: frame.notice.as_deref(),
        }
    }
}
