use thiserror::Error;

use super::error_table::ErrorTableError;
use crate::render::RenderError;

/// Failure to choose an operating point.
#[derive(Debug, Error)]
pub enum ChooserError {
    /// The shipped table of errors.
    #[error(transparent)]
    Table(#[from] ErrorTableError),
    /// A frame of the measurement.
    #[error(transparent)]
    Render(#[from] RenderError),
}
