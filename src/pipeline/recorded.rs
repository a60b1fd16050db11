//! Recording of a session: events, poses and settings, in addition to the tracker's bytes.

use std::path::Path;
use std::sync::{Arc, Mutex};

use thiserror::Error;

use super::clock::lock;
use super::events::Observer;
use super::shutdown::Part;
use crate::exam::needle::NeedleEvent;
use crate::files::{self, FileError, FileKind};
use crate::needle::NeedleEstimate;
use crate::pose::Estimate;
use crate::recording::{
    Event, QueueLimits, Recorded, Recorder, RecorderError, RecorderHandle, RecordingError, RecordingInfo,
    RecordingWriter, SessionPose, SessionSettings, mark_event, removal_event,
};
use crate::settings::{Control, LiveSettings};
use crate::sink::{SinkError, create_dir};
use crate::station::{SceneIdentity, Station};
use crate::tracker::TrackerStream;

/// Name of the events that record settings.
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

    fn needle(&self, unix_ns: u64, estimate: &NeedleEstimate) {
        if let Some(needle) = estimate.needle {
            let (pose, state) = (needle.scene_from_needle, estimate.state);
            self.0.needle_pose(SessionPose { host_time_ns: unix_ns, pose, state });
        }
    }

    fn tip(&self, unix_ns: u64, event: &NeedleEvent) {
        self.0.event(event.recorded(unix_ns));
    }

    fn settings(&self, unix_ns: u64, settings: &LiveSettings) {
        self.0.event(Event::new(unix_ns, SETTINGS_EVENT).with(settings.to_json()));
    }

    fn marks(&self, unix_ns: u64, start_unix_ns: u64, control: &Control) {
        match control {
            Control::Mark(mark) => self.0.event(mark_event(unix_ns, start_unix_ns, mark)),
            Control::Unmark(ids) => ids.iter().for_each(|id| self.0.event(removal_event(unix_ns, id))),
            Control::Set(_) | Control::Quit => {}
        }
    }
}

/// Live settings after `event`, if it is a [`SETTINGS_EVENT`] or has the name of a setting; `None` for other events.
/// Settings that the event does not name keep their values of `before`.
///
/// # Errors
/// A value has the wrong type. Ranges are not checked.
pub(super) fn settings_after(event: &Event, before: &LiveSettings) -> Option<Result<LiveSettings, String>> {
    let mut settings = *before;
    let value = event.value.as_ref()?;
    if event.name == SETTINGS_EVENT {
        let Some(values) = value.as_object() else { return Some(Err(format!("it is {value}, no table"))) };
        // A newer version of insonify may have recorded further settings; they are ignored.
        let read: Result<(), String> =
            values.iter().filter_map(|(key, value)| settings.read_json(key, value)).collect();
        return Some(read.map(|()| settings));
    }
    settings.read_json(&event.name, value).map(|result| result.map(|()| settings))
}

/// Reason why a session can't be recorded.
#[derive(Debug, Error)]
pub enum RecordError {
    /// The station file can't be read again.
    #[error(transparent)]
    File(#[from] FileError),
    /// The directory can't be made.
    #[error(transparent)]
    Directory(#[from] SinkError),
    /// The file can't be written.
    #[error(transparent)]
    Recording(#[from] RecordingError),
    /// The recorder's thread failed.
    #[error(transparent)]
    Recorder(#[from] RecorderError),
}

/// Starts a recording of `station`'s session at `path`, with the text of the station file. In a replay, scene time is
/// 0 at `start_time_ns`. `stream` holds the protocol of the tracker's bytes and the sensors of its tools. `device` names
/// the tracker, `adapter` the rendering device.
///
/// # Errors
/// The station file can't be read, or the recording can't be written.
pub fn start_recorder(
    path: &Path,
    station: &Station,
    stream: TrackerStream,
    device: &str,
    adapter: &str,
    start_time_ns: u64,
) -> Result<Recorder, RecordError> {
    let text = files::read_text(&station.path, FileKind::Station)
        .map_err(FileError::at("read the station file again:", &station.path))?;
    if let Some(directory) = path.parent().filter(|directory| !directory.as_os_str().is_empty()) {
        create_dir(directory)?;
    }
    let scene = SceneIdentity::of(station).to_string();
    let TrackerStream { protocol, sensor, needle } = stream;
    let info = RecordingInfo { protocol, device: device.to_owned(), scene, start_time_ns, sensor, needle };
    let mut writer = RecordingWriter::create(path, &info)?;
    writer.settings(&SessionSettings {
        version: env!("CARGO_PKG_VERSION").to_owned(),
        seed: station.settings.quality.seed,
        adapter: adapter.to_owned(),
        station_path: station.path.display().to_string(),
        station: text,
    })?;
    Ok(Recorder::start(writer, QueueLimits::default())?)
}

/// Slot for the result of a recorder; empty until the recorder has ended.
pub type RecordedSlot = Arc<Mutex<Option<Recorded>>>;

/// Recorder as a part of a session. It is finished after all parts that it records.
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
