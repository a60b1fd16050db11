//! Errors in replaying a recording.

use std::path::PathBuf;

use thiserror::Error;

use crate::generator::GeneratorError;
use crate::measuring::MeasuringError;
use crate::quality::QualityError;
use crate::recording::RecordingError;
use crate::render::RenderError;
use crate::sink::SinkError;
use crate::station::StationError;

/// Errors in replaying a recording.
#[derive(Debug, Error)]
pub enum ReplayError {
    /// The recording can't be read.
    #[error(transparent)]
    Recording(#[from] RecordingError),
    /// The station's calibration can't be read.
    #[error(transparent)]
    Station(#[from] StationError),
    /// A frame can't be rendered.
    #[error(transparent)]
    Render(#[from] RenderError),
    /// No quality can be chosen.
    #[error(transparent)]
    Chooser(#[from] MeasuringError),
    /// Images that can't be compared.
    #[error(transparent)]
    Quality(#[from] QualityError),
    /// A generator failed.
    #[error(transparent)]
    Generator(#[from] GeneratorError),
    /// A file can't be written.
    #[error(transparent)]
    Sink(#[from] SinkError),
    /// The depth changes within frames that must have the same depth.
    #[error(
        "the recorded session changes the depth at frame {frame}, and a sequence has one size of its pixels; export parts with --frames ..{frame} and {frame}.., or use --ignore-controls"
    )]
    Depth {
        /// Index of the first frame with another depth.
        frame: usize,
    },
    /// The recorded times span more frames than any session has, usually because a clock was wrong.
    #[error(
        "the recording's host times span {span_s:.0} s: {frames} frames at {fps:.1} a second, at most {frames_max} are rendered; is a time stamp wrong?"
    )]
    Span {
        /// Time from the first to the last pose, s.
        span_s: f64,
        /// Number of frames in that time.
        frames: u128,
        /// Largest number of frames that is rendered.
        frames_max: u128,
        /// Frames per second.
        fps: f64,
    },
    /// The requested range holds no frame.
    #[error("the requested frames {start}..{end} hold none; the end is not included")]
    Range {
        /// Index of the first requested frame.
        start: usize,
        /// End of the range of frame indices, exclusive.
        end: usize,
    },
    /// The requested frames lie after the recording's end.
    #[error("the requested frames start at {start}, but at {fps} frames a second the recording has {frames}")]
    Start {
        /// Index of the first requested frame.
        start: usize,
        /// Number of frames in the recording.
        frames: usize,
        /// Frames per second.
        fps: f64,
    },
    /// The session has no pose.
    #[error("{path} holds no pose to score")]
    NoPose {
        /// The recording.
        path: PathBuf,
    },
    /// There is no frame to render.
    #[error("the recording has no frame")]
    Empty,
}
