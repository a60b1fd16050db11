//! Writer of recordings in a build without the feature `recordings`. It can't be created.

use std::convert::Infallible;
use std::path::Path;

use super::{Event, RecordingError, RecordingInfo};

/// Writer of a recording. No value of it exists.
#[derive(Debug)]
pub struct RecordingWriter(Infallible);

impl RecordingWriter {
    /// Creates a recording.
    ///
    /// # Errors
    /// Always: the build lacks the feature `recordings`.
    pub fn create(path: &Path, _info: &RecordingInfo) -> Result<Self, RecordingError> {
        Err(RecordingError::NotBuilt { path: path.to_owned() })
    }

    /// Writes bytes of the tracker.
    ///
    /// # Errors
    /// None: there is no writer.
    pub fn raw(&mut self, _host_time_ns: u64, _bytes: &[u8]) -> Result<(), RecordingError> {
        match self.0 {}
    }

    /// Writes an event.
    ///
    /// # Errors
    /// None: there is no writer.
    pub fn event(&mut self, _event: &Event) -> Result<(), RecordingError> {
        match self.0 {}
    }

    /// Finishes the recording.
    ///
    /// # Errors
    /// None: there is no writer.
    pub fn finish(self) -> Result<(), RecordingError> {
        match self.0 {}
    }
}
