//! Tracker of a session: feeds its measurements to the estimators and to the recording.

use std::sync::{Arc, Mutex};

use tokio_util::sync::CancellationToken;

use super::clock::lock;
use super::parts::PoseSource;
use super::replayed::at_rest;
use super::shutdown::{Part, Stop};
use super::tracker_watch::TrackerWatch;
use crate::needle::NeedleEstimate;
use crate::pose::{Counters, Estimate, Estimator, Measurement};
use crate::recording::{self, RecorderHandle, RecordingReader, spawn, stream_of};
use crate::station::{NeedleTracking, Station, StationError};
use crate::tracker::{
    Listener, Protocol, Record, SensorName, SessionHandle, Settings, TrackerError, TrackerEvent, Transport,
};

/// Poses of a live tracker's probe and needle; clones share the estimators.
#[derive(Clone)]
pub struct TrackedPoses {
    probe: Arc<Mutex<Estimator>>,
    /// The needle; none if none is tracked.
    needle: Option<TrackedNeedle>,
    watch: TrackerWatch,
}

/// Estimator of the needle's poses, and whether its sensor knows the side of the bevel.
#[derive(Clone)]
struct TrackedNeedle {
    estimator: Arc<Mutex<Estimator>>,
    bevel_known: bool,
}

impl TrackedPoses {
    /// Poses from `estimator`, which [`Self::track`] or [`Self::push`] feeds.
    pub fn new(estimator: Estimator) -> Self {
        Self { probe: Arc::new(Mutex::new(estimator)), needle: None, watch: TrackerWatch::default() }
    }

    /// The same probe with a needle, whose `estimator` [`Self::track`] or [`Self::push_needle`] feeds. The calibration
    /// of `estimator` has the needle's mounting in place of the probe's.
    #[must_use]
    pub fn with_needle(self, estimator: Estimator, bevel_known: bool) -> Self {
        let needle = TrackedNeedle { estimator: Arc::new(Mutex::new(estimator)), bevel_known };
        Self { needle: Some(needle), ..self }
    }

    /// State of the tracker that [`Self::track`] starts.
    pub fn watch(&self) -> TrackerWatch {
        self.watch.clone()
    }

    /// Poses by the filter and calibration of a station; `None` without a tracker. They have a needle if the station has
    /// one, and the station or its recording names the needle's sensor.
    ///
    /// # Errors
    /// The calibration can't be read, or lacks the mounting of the needle's sensor.
    pub fn of_station(station: &Station) -> Result<Option<Self>, StationError> {
        let has_tracker = station.tracker.transport != Transport::None;
        if !has_tracker {
            return Ok(None);
        }
        let mut settings = station.pose_settings()?;
        let has_needle = stream_of(&station.tracker).is_ok_and(|stream| stream.needle.is_some());
        let mut needle = if has_needle { station.needle_settings()? } else { None };
        // A recording that can't be opened is reported by the session that plays it.
        if let Some(path) = station.recording()
            && let Ok(reader) = RecordingReader::open(path)
        {
            settings.calibration = reader.info().calibration(path, settings.calibration);
            if let Some(NeedleTracking { settings, .. }) = &mut needle {
                settings.calibration = reader.info().calibration(path, settings.calibration);
            }
        }
        let poses = Self::new(Estimator::new(settings));
        Ok(Some(match needle {
            Some(NeedleTracking { settings, bevel_known }) => poses.with_needle(Estimator::new(settings), bevel_known),
            None => poses,
        }))
    }

    /// Takes a measurement of the caller's own tracker. Call it as soon as the measurement has arrived.
    pub fn push(&self, measurement: &Measurement) {
        lock(&self.probe).push(measurement);
    }

    /// Takes a measurement of the needle by the caller's own tracker; it is ignored if none is tracked.
    pub fn push_needle(&self, measurement: &Measurement) {
        if let Some(needle) = &self.needle {
            lock(&needle.estimator).push(measurement);
        }
    }

    /// Counts of used and dropped measurements of the probe so far.
    pub fn counters(&self) -> Counters {
        *lock(&self.probe).counters()
    }

    /// Counts of used and dropped measurements of the needle so far; `None` if none is tracked.
    pub fn needle_counters(&self) -> Option<Counters> {
        self.needle.as_ref().map(|needle| *lock(&needle.estimator).counters())
    }

    /// Records that the device of all tools is disconnected.
    fn disconnected(&self) {
        lock(&self.probe).disconnected();
        self.needle.iter().for_each(|needle| lock(&needle.estimator).disconnected());
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
        let listener = TrackerListener { poses: self.clone(), recorder, stop, rates };
        let session = spawn(settings, Box::new(listener), cancel.clone())?;
        Ok(TrackerPart { session, cancel })
    }
}

impl PoseSource for TrackedPoses {
    fn sample(&mut self, now_ns: u64, display_ns: u64) -> Estimate {
        lock(&self.probe).sample(now_ns, display_ns)
    }

    fn sample_needle(&mut self, now_ns: u64, display_ns: u64) -> Option<NeedleEstimate> {
        let TrackedNeedle { estimator, bevel_known } = self.needle.as_ref()?;
        Some(NeedleEstimate::of(&lock(estimator).sample(now_ns, display_ns), *bevel_known))
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
    poses: TrackedPoses,
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
        self.poses.watch.heard();
    }

    fn record(&mut self, host_time_ns: u64, record: &Record) {
        self.poses.watch.record();
        self.poses.push(&record.measurement(host_time_ns));
    }

    fn needle_record(&mut self, host_time_ns: u64, record: &Record) {
        self.poses.watch.needle_record();
        self.poses.push_needle(&record.measurement(host_time_ns));
    }

    fn event(&mut self, host_time_ns: u64, event: &TrackerEvent) {
        if self.poses.watch.event(event) {
            tracing::warn!("tracker: {event}");
        }
        match event {
            TrackerEvent::Connected { .. } => {
                tracing::info!("tracker: {event}");
                if self.rates {
                    self.poses.push(&at_rest(host_time_ns));
                }
            }
            TrackerEvent::Disconnected { .. } => self.poses.disconnected(),
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
