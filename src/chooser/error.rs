use std::path::PathBuf;

use thiserror::Error;

use super::error_table::ErrorTableError;
use crate::render::RenderError;
use crate::station::StationError;
use crate::tradeoff::TradeoffError;

/// Failure to choose an operating point, or to measure errors.
#[derive(Debug, Error)]
#[non_exhaustive]
pub enum ChooserError {
    /// The shipped table of errors.
    #[error(transparent)]
    Table(#[from] ErrorTableError),
    /// A frame of the measurement.
    #[error(transparent)]
    Render(#[from] RenderError),
    /// A recording in which the probe does not move at each speed.
    #[error("{path}: at no moment is the probe {speed} ({limits})")]
    NoMotion {
        /// Recording, or the station that names it.
        path: PathBuf,
        /// Missing speed.
        speed: &'static str,
        /// Limits of the speeds.
        limits: String,
    },
    /// A station without a pose, or a recording that cannot be read.
    #[error(transparent)]
    Station(#[from] StationError),
    /// A table that can't be written as text.
    #[error("the table of errors can't be written: {0}")]
    Text(toml::ser::Error),
    /// A measurement that failed.
    #[error(transparent)]
    Measurement(#[from] TradeoffError),
}
