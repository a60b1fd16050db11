//! Playback transport: recorded bytes, at their times or at once.

use std::io;
use std::time::Duration;

use bytes::BytesMut;
use tokio::time::{Instant, sleep_until};

use super::Received;
use crate::tracker::playback::{Playback, PlaybackError};
use crate::tracker::settings::Speed;

/// Playback of recorded bytes.
pub(in crate::tracker) struct PlaybackPort {
    source: Box<dyn Playback>,
    speed: Speed,
    repeat: bool,
    /// Clock time and recorded time (ns) at the start of this pass; `None` before its first message.
    began: Option<(Instant, u64)>,
    /// Recorded time, ns, and bytes of the next message, if it was read already.
    next: Option<(u64, Vec<u8>)>,
    /// Whether this pass delivered a message.
    played: bool,
}

impl PlaybackPort {
    pub(super) fn new(source: Box<dyn Playback>, speed: Speed, repeat: bool) -> Self {
        Self { source, speed, repeat, began: None, next: None, played: false }
    }

    /// Source of the bytes.
    pub(in crate::tracker) fn source(&self) -> &dyn Playback {
        &*self.source
    }

    pub(super) async fn receive(&mut self, piece: &mut BytesMut) -> io::Result<Received> {
        if self.next.is_none() {
            self.next = self.source.next_message().map_err(io::Error::other)?;
        }
        let Some((time_ns, _)) = self.next else { return self.end().map_err(io::Error::other) };
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

    fn end(&mut self) -> Result<Received, PlaybackError> {
        // A source without messages would repeat in a busy loop.
        if !self.repeat || !std::mem::take(&mut self.played) {
            return Ok(Received::Ended);
        }
        self.source.rewind()?;
        self.began = None;
        Ok(Received::Restarted)
    }
}
