//! Recorders of sessions.

use std::path::Path;

use insonify::files::FileKind;
use insonify::recording::{QueueLimits, Recorder, RecordingInfo, RecordingWriter, SessionSettings};
use insonify::station::Station;
use insonify::tracker::Protocol;

use super::{Classify, Failure, input, output};

/// Starts recording a session of `station` to `path`. In a replay, scene time is 0 at `start_time_ns`. The pair is the
/// protocol of the tracker's bytes and the sensor used.
pub(crate) fn start(
    path: &Path,
    station: &Station,
    (protocol, sensor): (Protocol, Option<u16>),
    device: &str,
    adapter: &str,
    start_time_ns: u64,
) -> Result<Recorder, Failure> {
    let text = input::text(&station.path, FileKind::Station, "the station file again:")?;
    output::make_parent(path)?;
    let scene = station.path.display().to_string();
    let info = RecordingInfo { protocol, device: device.to_owned(), scene: scene.clone(), start_time_ns, sensor };
    let mut writer = RecordingWriter::create(path, &info)?;
    writer.settings(&SessionSettings {
        version: env!("CARGO_PKG_VERSION").to_owned(),
        seed: station.settings.quality.seed,
        adapter: adapter.to_owned(),
        station_path: scene,
        station: text,
    })?;
    Recorder::start(writer, QueueLimits::default()).other()
}
