//! Errors in replaying a recording.

use std::path::PathBuf;

use thiserror::Error;

use crate::chooser::ChooserError;
use crate::generator::GeneratorError;
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
    Chooser(#[from] ChooserError),
    /// Images that can't be compared.
    #[error(transparent)]
    Quality(#[from] QualityError),
    /// A generator that fails.
    #[error(transparent)]
    Generator(#[from] GeneratorError),
    /// A file that can't be written.
    #[error(transparent)]
    Sink(#[from] SinkError),
    /// Another depth, where all frames need the same.
    #[error(
        "the recorded session changes the depth at frame {frame}, and a sequence has one size of its pixels; export parts with --frames ..{frame} and {frame}.., or use --ignore-controls"
    )]
    Depth {
        /// First frame of another depth.
        frame: usize,
    },
    /// Times that span more frames than any session has: usually a wrong clock.
    #[error(
        "the recording's host times span {span_s:.0} s: {frames} frames at {fps:.1} a second, at most {frames_max} are rendered; is a time stamp wrong?"
    )]
    Span {
        /// Span, s.
        span_s: f64,
        /// Frames in it.
        frames: u128,
        /// Most frames that are rendered.
        frames_max: u128,
        /// Frames per second.
        fps: f64,
    },
    /// A range of frames that holds none.
    #[error("the requested frames {start}..{end} hold none; the end is not included")]
    Range {
        /// First frame asked for.
        start: usize,
        /// Frame behind the last.
        end: usize,
    },
    /// Frames behind the recording's end.
    #[error("the requested frames start at {start}, but at {fps} frames a second the recording has {frames}")]
    Start {
        /// First frame asked for.
        start: usize,
        /// Frames of the recording.
        frames: usize,
        /// Frames per second.
        fps: f64,
    },
    /// A session without a pose.
    #[error("{path} holds no pose to score")]
    NoPose {
        /// The recording.
        path: PathBuf,
    },
    /// No frame to render.
    #[error("the recording has no frame")]
    Empty,
}
