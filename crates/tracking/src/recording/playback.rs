//! Sessions that play recordings.

use std::fs::File;
use std::io::BufReader;
use std::path::{Path, PathBuf};

use tokio_util::sync::CancellationToken;

use super::{Entry, RecordingError, RecordingReader};
use crate::tracker::{
    self, Listener, Playback, PlaybackError, SessionHandle, Settings, TrackerError, TrackerStream, Transport,
};

/// Starts the session of a station's tracker, or plays the recording that the settings name instead.
///
/// # Errors
/// The recording can't be read, or an error of [`tracker::spawn`].
pub fn spawn(
    settings: &Settings,
    listener: Box<dyn Listener>,
    cancel: CancellationToken,
) -> Result<SessionHandle, TrackerError> {
    match &settings.transport {
        Transport::Recording { path, .. } => {
            tracker::play(settings, Box::new(RecordingPlayback::open(path)?), listener, cancel)
        }
        _ => tracker::spawn(settings, listener, cancel),
    }
}

/// Protocol of a tracker's bytes and the sensors of its tools, from the station's settings or from the recording that
/// they name.
///
/// # Errors
/// The recording can't be read.
pub fn stream_of(settings: &Settings) -> Result<TrackerStream, RecordingError> {
    let Transport::Recording { path, .. } = &settings.transport else { return Ok(settings.stream(None)) };
    let recorded = RecordingReader::open(path)?.info().stream();
    Ok(settings.stream(Some(recorded)))
}

impl From<RecordingError> for TrackerError {
    fn from(error: RecordingError) -> Self {
        Self::Playback(Box::new(error))
    }
}

/// Source of the tracker's bytes in a recording.
pub struct RecordingPlayback {
    path: PathBuf,
    reader: RecordingReader<BufReader<File>>,
}

impl RecordingPlayback {
    /// Opens the recording at `path`.
    ///
    /// # Errors
    /// It can't be read.
    pub(crate) fn open(path: &Path) -> Result<Self, RecordingError> {
        Ok(Self { path: path.to_owned(), reader: RecordingReader::open(path)? })
    }

    /// Logs the unreadable parts of the file.
    fn warn_of_damage(&self) {
        let (path, damage) = (self.path.display(), self.reader.damage());
        if let Some(truncated) = &damage.truncated {
            tracing::warn!("{path} is not whole: {truncated}");
        }
        if damage.damaged > 0 {
            tracing::warn!("{path}: {} damaged parts left out", damage.damaged);
        }
    }
}

impl Playback for RecordingPlayback {
    fn name(&self) -> String {
        self.path.display().to_string()
    }

    fn stream(&self) -> TrackerStream {
        self.reader.info().stream()
    }

    fn next_message(&mut self) -> Result<Option<(u64, Vec<u8>)>, PlaybackError> {
        loop {
            match self.reader.next_entry()? {
                Some(Entry::Raw { host_time_ns, bytes }) if !bytes.is_empty() => {
                    return Ok(Some((host_time_ns, bytes)));
                }
                Some(_) => {}
                None => {
                    self.warn_of_damage();
                    return Ok(None);
                }
            }
        }
    }

    fn rewind(&mut self) -> Result<(), PlaybackError> {
        self.reader = RecordingReader::open(&self.path)?;
        Ok(())
    }
}
