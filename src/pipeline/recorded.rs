//! The recording of a session: its events, poses and settings beside the tracker's bytes.

use std::sync::{Arc, Mutex};

use super::clock::lock;
use super::events::Observer;
use super::shutdown::Part;
use crate::pose::Estimate;
use crate::settings::LiveSettings;
use crate::tracker::recording::{Event, Recorded, Recorder, RecorderHandle, SessionPose};

/// Name of the events at which settings change.
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

/// Live settings after `event`, if it is about settings: one of [`SETTINGS_EVENT`], or one named after a setting, with
/// its value. Settings that it does not name stay as `before`.
///
/// # Errors
/// A value of another type. Its range is not checked.
pub(super) fn settings_after(event: &Event, before: &LiveSettings) -> Option<Result<LiveSettings, String>> {
    let mut settings = *before;
    let value = event.value.as_ref()?;
    if event.name == SETTINGS_EVENT {
        let Some(values) = value.as_object() else { return Some(Err(format!("it is {value}, no table"))) };
        // A later version may know more.
        let read: Result<(), String> =
            values.iter().filter_map(|(key, value)| settings.read_json(key, value)).collect();
        return Some(read.map(|()| settings));
    }
    settings.read_json(&event.name, value).map(|result| result.map(|()| settings))
}

/// Result of a recorder, once it has ended.
pub type RecordedSlot = Arc<Mutex<Option<Recorded>>>;

/// The recorder, as a part of a session: it is finished after everything that it records.
pub struct RecorderPart {
    recorder: Option<Recorder>,
    recorded: RecordedSlot,
}

impl RecorderPart {
    /// Finishes `recorder` at the session's end; the slot then says what it did.
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
        // Finishing waits for the disk: not on the thread that ends the session.
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
