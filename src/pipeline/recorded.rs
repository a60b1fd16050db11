//! The recording of a session: its events, poses and settings beside the tracker's bytes.

use std::sync::{Arc, Mutex};

use super::clock::lock;
use super::events::Observer;
use super::parts::PoseSample;
use super::shutdown::Part;
use crate::sink::live::LiveSettings;
use crate::tracker::recording::{Event, Recorded, Recorder, RecorderHandle, SessionPose};

/// Hands what a session does to its recorder.
pub struct RecordingObserver(pub RecorderHandle);

impl Observer for RecordingObserver {
    fn event(&self, unix_ns: u64, text: &str) {
        self.0.event(Event::new(unix_ns, "session").with(text));
    }

    fn pose(&self, unix_ns: u64, sample: &PoseSample) {
        if let Some(pose) = sample.scene_from_probe {
            self.0.pose(SessionPose { host_time_ns: unix_ns, pose, state: sample.state });
        }
    }

    fn settings(&self, unix_ns: u64, settings: &LiveSettings) {
        let image = &settings.image;
        let value = serde_json::json!({
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
        });
        self.0.event(Event::new(unix_ns, "settings").with(value));
    }
}

/// What a recorder recorded, once it has ended.
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
