//! Recording transport: plays the raw bytes of a recording.

use std::fs::File;
use std::io::{self, BufReader};
use std::path::{Path, PathBuf};
use std::time::Duration;

use bytes::BytesMut;
use tokio::time::{Instant, sleep_until};

use super::Received;
use crate::tracker::recording::{Entry, RecordingError, RecordingInfo, RecordingReader};
use crate::tracker::settings::Speed;

/// Playback of a recording.
pub(in crate::tracker) struct RecordingPort {
    path: PathBuf,
    speed: Speed,
    repeat: bool,
    reader: RecordingReader<BufReader<File>>,
    /// Current time and recorded time, ns, at the start of this pass; `None` before its first message.
    began: Option<(Instant, u64)>,
    /// Time and bytes of the next message.
    next: Option<(u64, Vec<u8>)>,
    /// Whether this pass delivered a message.
    played: bool,
}

impl RecordingPort {
    pub(super) fn open(path: &Path, speed: Speed, repeat: bool) -> Result<Self, RecordingError> {
        let reader = RecordingReader::open(path)?;
        Ok(Self { path: path.to_owned(), speed, repeat, reader, began: None, next: None, played: false })
    }

    /// Description of the recording.
    pub(in crate::tracker) fn info(&self) -> &RecordingInfo {
        self.reader.info()
    }

    pub(super) fn name(&self) -> String {
        self.path.display().to_string()
    }

    pub(super) async fn receive(&mut self, piece: &mut BytesMut) -> io::Result<Received> {
        let Some(time_ns) = self.peek().map_err(io::Error::other)? else {
            return self.end().map_err(io::Error::other);
        };
        let time_ns = match self.speed {
            Speed::AtOnce => Some(time_ns),
            Speed::Factor(factor) => {
                let (start, first_ns) = *self.began.get_or_insert_with(|| (Instant::now(), time_ns));
                let seconds = time_ns.saturating_sub(first_ns) as f64 * 1e-9 / factor;
                // For an implausibly late time, wait forever instead of panicking.
                let wait = Duration::try_from_secs_f64(seconds).unwrap_or(Duration::MAX);
                match start.checked_add(wait) {
                    Some(at) => sleep_until(at).await,
                    None => std::future::pending().await,
                }
                None
            }
        };
        if let Some((_, bytes)) = self.next.take() {
            piece.extend_from_slice(&bytes);
            self.played = true;
        }
        Ok(Received::Bytes { time_ns })
    }

    /// Time of the next tracker message.
    fn peek(&mut self) -> Result<Option<u64>, RecordingError> {
        while self.next.is_none() {
            match self.reader.next_entry()? {
                Some(Entry::Raw { host_time_ns, bytes }) if !bytes.is_empty() => {
                    self.next = Some((host_time_ns, bytes));
                }
                Some(_) => {}
                None => return Ok(None),
            }
        }
        Ok(self.next.as_ref().map(|(time_ns, _)| *time_ns))
    }

    fn end(&mut self) -> Result<Received, RecordingError> {
        if let Some(truncated) = &self.reader.damage().truncated {
            tracing::warn!("{} is not whole: {truncated}", self.path.display());
        }
        if self.reader.damage().damaged > 0 {
            tracing::warn!("{}: {} damaged parts left out", self.path.display(), self.reader.damage().damaged);
        }
        // A recording without messages would repeat in a busy loop.
        if !self.repeat || !std::mem::take(&mut self.played) {
            return Ok(Received::Ended);
        }
        self.reader = RecordingReader::open(&self.path)?;
        self.began = None;
        Ok(Received::Restarted)
    }
}
