//! Errors in writing files and in live displays.

use std::path::PathBuf;

use thiserror::Error;

use crate::files::FileError;

/// Error of a file or a live display.
#[derive(Debug, Error)]
pub enum SinkError {
    /// Failed file access.
    #[error(transparent)]
    File(#[from] FileError),
    /// The image could not be encoded.
    #[error("cannot encode {path}: {source}")]
    Image {
        /// File.
        path: PathBuf,
        /// Cause.
        source: image::ImageError,
    },
    /// The values could not be written as JSON.
    #[error("cannot write {path} as JSON: {source}")]
    Json {
        /// File.
        path: PathBuf,
        /// Cause.
        source: serde_json::Error,
    },
    /// The number of values does not match the shape of the array.
    #[error("{path} would hold {found} values; its shape {shape:?} asks for {expected}")]
    Shape {
        /// File.
        path: PathBuf,
        /// Rows and columns.
        shape: [usize; 2],
        /// Number of values that the shape holds.
        expected: usize,
        /// Number of values given.
        found: usize,
    },
    /// Another process is writing the file.
    #[error("another process is writing {path}")]
    Busy {
        /// File.
        path: PathBuf,
    },
    /// The frame rate is outside 0.1..=1000.
    #[error("a video cannot run at {fps} frames a second; it must lie in 0.1..=1000")]
    FrameRate {
        /// Frame rate given, Hz.
        fps: f64,
    },
    /// The server can't listen at the address.
    #[error("the {sink} can't listen at {address}: {source}; take another port (0 for any free one) or address")]
    Listen {
        /// Name of the sink.
        sink: &'static str,
        /// Address and port.
        address: std::net::SocketAddr,
        /// Cause.
        source: std::io::Error,
    },
    /// A live sink has ended and takes no more frames.
    #[error("the {sink} shows nothing: {reason}")]
    Ended {
        /// Name of the sink.
        sink: &'static str,
        /// Cause.
        reason: String,
    },
    /// The encoder of a video failed.
    #[error("cannot encode {path}: {reason}")]
    Encoder {
        /// Video.
        path: PathBuf,
        /// Cause.
        reason: String,
    },
}

impl SinkError {
    /// Wraps an I/O error with the path it happened at.
    pub fn io(path: &std::path::Path) -> impl Fn(std::io::Error) -> Self {
        move |source| FileError::at("write", path)(source).into()
    }
}

/// Checks that `found` values fill `shape`.
pub(crate) fn check_shape(path: &std::path::Path, shape: [usize; 2], found: usize) -> Result<(), SinkError> {
    let expected = shape[0].saturating_mul(shape[1]);
    if expected == found {
        return Ok(());
    }
    Err(SinkError::Shape { path: path.to_owned(), shape, expected, found })
}
