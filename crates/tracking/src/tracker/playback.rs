//! Interface of recorded bytes that a session plays instead of using a device.

use super::TrackerStream;

/// Failure to read recorded bytes.
pub type PlaybackError = Box<dyn std::error::Error + Send + Sync>;

/// Messages of a recorded tracker, in order. The session delivers each one at its time.
pub trait Playback: Send {
    /// Name, for messages.
    fn name(&self) -> String;

    /// Protocol of the bytes, and the sensors of probe and needle.
    fn stream(&self) -> TrackerStream;

    /// Next message: arrival of its first byte, ns since 1970 (UTC), and its bytes, never empty. `None` at the end.
    ///
    /// # Errors
    /// The recording can't be read.
    fn next_message(&mut self) -> Result<Option<(u64, Vec<u8>)>, PlaybackError>;

    /// Goes back to the first message.
    ///
    /// # Errors
    /// The recording can't be read again.
    fn rewind(&mut self) -> Result<(), PlaybackError>;
}
