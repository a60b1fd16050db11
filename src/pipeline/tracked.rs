//! Tracker of a session: feeds its measurements to the estimator and to the recording.

use std::sync::{Arc, Mutex};

use tokio_util::sync::CancellationToken;

use super::clock::lock;
use super::parts::PoseSource;
use super::replayed::at_rest;
use super::shutdown::{Part, Stop};
use super::tracker_watch::TrackerWatch;
use crate::pose::{Counters, Estimate, Estimator, Measurement};
use crate::recording::{self, RecorderHandle, RecordingReader, spawn, stream_of};
use crate::station::{Station, StationError};
use crate::tracker::{
    Listener, Protocol, Record, SensorName, SessionHandle, Settings, TrackerError, TrackerEvent, Transport,
};

/// Poses of a live tracker; clones share the estimator.
#[derive(Clone)]
pub struct TrackedPoses(Arc<Mutex<Estimator>>, TrackerWatch);

impl TrackedPoses {
    /// Poses from `estimator`, which [`Self::track`] or [`Self::push`] feeds.
    pub fn new(estimator: Estimator) -> Self {
        Self(Arc::new(Mutex::new(estimator)), TrackerWatch::default())
    }

    /// State of the tracker that [`Self::track`] starts.
    pub fn watch(&self) -> TrackerWatch {
        self.1.clone()
    }

    /// Poses by the filter and calibration of a station; `None` without a tracker.
    ///
    /// # Errors
    /// The calibration can't be read.
    pub fn of_station(station: &Station) -> Result<Option<Self>, StationError> {
        let has_tracker = station.tracker.transport != Transport::None;
        if !has_tracker {
            return Ok(None);
        }
        let mut settings = station.pose_settings()?;
        // A recording that can't be opened is reported by the session that plays it.
        if let Some(path) = station.recording()
            && let Ok(reader) = RecordingReader::open(path)
        {
            settings.calibration = reader.info().calibration(path, settings.calibration);
        }
        Ok(Some(Self::new(Estimator::new(settings))))
    }

    /// Takes a measurement of the caller's own tracker. Call it as soon as the measurement has arrived.
    pub fn push(&self, measurement: &Measurement) {
        lock(&self.0).push(measurement);
    }

    /// Counts of used and dropped measurements so far.
    pub fn counters(&self) -> Counters {
        *lock(&self.0).counters()
    }

    /// Starts the tracker's session. The end of a played recording also ends the station's session.
    ///
    /// # Errors
    /// Errors of [`spawn`].
    pub fn track(
        &self,
        settings: &Settings,
        recorder: Option<RecorderHandle>,
        stop: Stop,
    ) -> Result<TrackerPart, TrackerError> {
        let cancel = CancellationToken::new();
        let rates = stream_of(settings)?.protocol == Protocol::SpaceMouse;
        let listener = TrackerListener { estimator: self.0.clone(), watch: self.watch(), recorder, stop, rates };
        let session = spawn(settings, Box::new(listener), cancel.clone())?;
        Ok(TrackerPart { session, cancel })
    }
}

impl PoseSource for TrackedPoses {
    fn sample(&mut self, now_ns: u64, display_ns: u64) -> Estimate {
        lock(&self.0).sample(now_ns, display_ns)
    }
}

/// Tracker thread as a part of a session.
pub struct TrackerPart {
    session: SessionHandle,
    cancel: CancellationToken,
}

impl Part for TrackerPart {
    fn name(&self) -> &str {
        "tracker"
    }

    fn stop(&mut self) {
        self.cancel.cancel();
    }

    fn has_ended(&mut self) -> bool {
        self.session.is_finished()
    }
}

/// Listener on the tracker's thread.
struct TrackerListener {
    estimator: Arc<Mutex<Estimator>>,
    watch: TrackerWatch,
    recorder: Option<RecorderHandle>,
    stop: Stop,
    /// Whether the device sends rates of motion; such a device sends nothing while at rest.
    rates: bool,
}

impl Listener for TrackerListener {
    fn bytes(&mut self, host_time_ns: u64, bytes: &[u8]) {
        if let Some(recorder) = &self.recorder {
            recorder.raw(host_time_ns, bytes);
        }
    }

    fn heard(&mut self, _: u64, _: &SensorName, _: &Record) {
        self.watch.heard();
    }

    fn record(&mut self, host_time_ns: u64, record: &Record) {
        self.watch.record();
        let Record { sequence, device_time_us, reading, .. } = *record;
        lock(&self.estimator).push(&Measurement { host_time_ns, device_time_us, sequence, reading });
    }

    fn event(&mut self, host_time_ns: u64, event: &TrackerEvent) {
        if self.watch.event(event) {
            tracing::warn!("tracker: {event}");
        }
        match event {
            TrackerEvent::Connected { .. } => {
                tracing::info!("tracker: {event}");
                if self.rates {
                    lock(&self.estimator).push(&at_rest(host_time_ns));
                }
            }
            TrackerEvent::Disconnected { .. } => lock(&self.estimator).disconnected(),
            TrackerEvent::Ended => self.stop.request("the recording is over"),
            // The session counts the error, and the recording has the damaged bytes.
            TrackerEvent::DecodeError(error) => tracing::debug!("tracker: {error}"),
            TrackerEvent::OnlyTool { .. } => tracing::info!("tracker: {event}"),
            _ => {}
        }
        if let Some(recorder) = &self.recorder
            && let Some(event) = recording::event_of(host_time_ns, event)
        {
            recorder.event(event);
        }
    }
}
