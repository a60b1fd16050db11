//! Receiver of a tracker session's bytes, records and events.

use super::Record;
use super::event::TrackerEvent;
use super::sensor::SensorName;

/// Receiver of one tracker's bytes, records and events, called on the tracker's thread. It must not block.
pub trait Listener: Send {
    /// Receives each piece of the stream before decoding, with the arrival of its first byte, ns since 1970 (UTC).
    fn bytes(&mut self, host_time_ns: u64, bytes: &[u8]);

    /// Receives a record of any sensor, used or left out, with the arrival of its first byte, ns since 1970 (UTC).
    fn heard(&mut self, _host_time_ns: u64, _sensor: &SensorName, _record: &Record) {}

    /// Receives a record of the probe, with the arrival of its first byte, ns since 1970 (UTC).
    fn record(&mut self, host_time_ns: u64, record: &Record);

    /// Receives a record of the needle, with the arrival of its first byte, ns since 1970 (UTC).
    fn needle_record(&mut self, _host_time_ns: u64, _record: &Record) {}

    /// Receives an event, with its time, ns since 1970 (UTC).
    fn event(&mut self, host_time_ns: u64, event: &TrackerEvent);
}
