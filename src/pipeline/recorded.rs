//! The recording of a session: its events, poses and settings beside the tracker's bytes.

use std::sync::{Arc, Mutex};

use serde_json::Value;

use super::clock::lock;
use super::events::Observer;
use super::shutdown::Part;
use crate::pose::Estimate;
use crate::sink::live::LiveSettings;
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
        self.0.event(Event::new(unix_ns, SETTINGS_EVENT).with(settings_value(settings)));
    }
}

/// Settings as an event holds them.
pub(super) fn settings_value(settings: &LiveSettings) -> Value {
    let image = &settings.image;
    serde_json::json!({
        "gain_db": image.gain_db,
        "dynamic_range_db": image.dynamic_range_db,
        "tgc_db_per_cm": image.tgc_db_per_cm,
        "tgc_sliders_db": image.tgc_sliders_db,
        "depth_mm": settings.depth_mm,
        "focus_mm": settings.focus_mm,
        "rays": settings.rays,
        "layers": settings.layers,
        "frozen": settings.frozen,
        "enhance": settings.enhance,
    })
}

/// The settings that hold after `event`, if it is about settings: one of [`SETTINGS_EVENT`], or one named as a setting
/// with its value. Where it is silent they are as `before`.
///
/// # Errors
/// A value of another type. Its range is not checked.
pub(super) fn settings_after(event: &Event, before: &LiveSettings) -> Option<Result<LiveSettings, String>> {
    let mut settings = *before;
    let value = event.value.as_ref()?;
    if event.name == SETTINGS_EVENT {
        let Some(values) = value.as_object() else { return Some(Err(format!("it is {value}, no table"))) };
        for (key, value) in values {
            // A later version may know more.
            if let Some(Err(reason)) = set(&mut settings, key, value) {
                return Some(Err(reason));
            }
        }
        return Some(Ok(settings));
    }
    set(&mut settings, &event.name, value).map(|result| result.map(|()| settings))
}

/// Sets `key`; None where there is no such setting.
fn set(settings: &mut LiveSettings, key: &str, value: &Value) -> Option<Result<(), String>> {
    let LiveSettings { image, depth_mm, focus_mm, rays, layers, frozen, enhance } = settings;
    let done = match key {
        "gain_db" => read(value, &mut image.gain_db),
        "dynamic_range_db" => read(value, &mut image.dynamic_range_db),
        "tgc_db_per_cm" => read(value, &mut image.tgc_db_per_cm),
        "tgc_sliders_db" => read(value, &mut image.tgc_sliders_db),
        "depth_mm" => read(value, depth_mm),
        "focus_mm" => read(value, focus_mm),
        "rays" => read(value, rays),
        "layers" => read(value, layers),
        "frozen" => read(value, frozen),
        "enhance" => read(value, enhance),
        _ => return None,
    };
    Some(done.map_err(|error| format!("`{key}` is {value}: {error}")))
}

fn read<T: serde::de::DeserializeOwned>(value: &Value, into: &mut T) -> Result<(), serde_json::Error> {
    *into = serde_json::from_value(value.clone())?;
    Ok(())
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
