//! Errors of measurements.

use std::path::PathBuf;

use thiserror::Error;

use crate::files::GreyError;
use crate::generator::{GeneratorError, RuntimeError};
use crate::quality::QualityError;
use crate::render::RenderError;
use crate::selftest::SelfTestError;
use crate::sink::SinkError;
use crate::station::StationError;

/// Error in measuring accuracy against time.
#[derive(Debug, Error)]
#[non_exhaustive]
pub enum TradeoffError {
    /// A stored result that cannot be read.
    #[error("cannot read {path}: {source}")]
    Read {
        /// File or folder.
        path: PathBuf,
        /// Cause.
        source: std::io::Error,
    },
    /// A stored result that is none.
    #[error("{path} is damaged: measure again without what is stored ({source})")]
    Damaged {
        /// File.
        path: PathBuf,
        /// Cause.
        source: serde_json::Error,
    },
    /// A stored image that cannot be used.
    #[error(transparent)]
    Grey(#[from] GreyError),
    /// A station without poses.
    #[error(transparent)]
    Station(#[from] StationError),
    /// A station has generators, and ONNX Runtime is missing.
    #[error(transparent)]
    Runtime(#[from] RuntimeError),
    /// A generator that cannot be run.
    #[error(transparent)]
    Generator(#[from] GeneratorError),
    /// Images that cannot be compared.
    #[error(transparent)]
    Quality(#[from] QualityError),
    /// A frame that cannot be rendered.
    #[error(transparent)]
    Render(#[from] RenderError),
    /// The comparison with theory failed.
    #[error(transparent)]
    SelfTest(#[from] SelfTestError),
    /// A figure that cannot be drawn.
    #[error("the figure can't be drawn: {0}")]
    Figure(String),
    /// A file that cannot be written.
    #[error(transparent)]
    Sink(#[from] SinkError),
}
