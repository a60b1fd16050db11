//! Recording of a session: events, poses and settings, in addition to the tracker's bytes.

use std::sync::{Arc, Mutex};

use super::clock::lock;
use super::events::Observer;
use super::shutdown::Part;
use crate::pose::Estimate;
use crate::recording::{Event, Recorded, Recorder, RecorderHandle, SessionPose};
use crate::settings::LiveSettings;

/// Name of events that record settings.
pub(super) const SETTINGS_EVENT: &str = "settings";

/// Observer that records a session.
pub struct RecordingObserver(pub RecorderHandle);

impl Observer for RecordingObserver {
    fn event(&self, unix_ns: u64, text: &str) {
        self.0.event(Event::new(unix_ns, "session").with(text));
    }

    fn pose(&self, unix_ns: u64, estimate: &Estimate) {
        if let Some(pose) = estimate.scene_from_probe {
            self.0.pose(SessionPose { host_time_ns: unix_ns, pose, state: estimate.state });
        }
    }

    fn settings(&self, unix_ns: u64, settings: &LiveSettings) {
        self.0.event(Event::new(unix_ns, SETTINGS_EVENT).with(settings.to_json()));
    }
}

/// Live settings after `event`, if it is a [`SETTINGS_EVENT`] or is named after a setting. Settings that it does not
/// name stay as in `before`.
///
/// # Errors
/// A value has the wrong type. Ranges are not checked.
pub(super) fn settings_after(event: &Event, before: &LiveSettings) -> Option<Result<LiveSettings, String>> {
    let mut settings = *before;
    let value = event.value.as_ref()?;
    if event.name == SETTINGS_EVENT {
        let Some(values) = value.as_object() else { return Some(Err(format!("it is {value}, no table"))) };
        // A later version may have further settings.
        let read: Result<(), String> =
            values.iter().filter_map(|(key, value)| settings.read_json(key, value)).collect();
        return Some(read.map(|()| settings));
    }
    settings.read_json(&event.name, value).map(|result| result.map(|()| settings))
}

/// Result of a recorder; none until it has ended.
pub type RecordedSlot = Arc<Mutex<Option<Recorded>>>;

/// Recorder as a part of a session; finished after all parts that it records.
pub struct RecorderPart {
    recorder: Option<Recorder>,
    recorded: RecordedSlot,
}

impl RecorderPart {
    /// A part that finishes `recorder` at the session's end, and the slot for its result.
    pub fn new(recorder: Recorder) -> (Self, RecordedSlot) {
        let recorded = RecordedSlot::default();
        (Self { recorder: Some(recorder), recorded: recorded.clone() }, recorded)
    }
}

impl Part for RecorderPart {
    fn name(&self) -> &str {
        "recorder"
    }

    fn stop(&mut self) {
        // On its own thread, because finishing waits for the disk.
        if let Some(recorder) = self.recorder.take() {
            let recorded = self.recorded.clone();
            std::thread::spawn(move || {
                let done = recorder.finish();
                *lock(&recorded) = Some(done);
            });
        }
    }

    fn has_ended(&mut self) -> bool {
        lock(&self.recorded).is_some()
    }
}
