//! A session with one tracker, on a thread of its own: opens its port, runs its driver, stamps and decodes what it says,
//! and goes on whatever the hardware does.

use std::io;
use std::thread::JoinHandle;
use std::time::Duration;

use bytes::BytesMut;
use thiserror::Error;
use tokio::time::{Instant, sleep, sleep_until, timeout};
use tokio_util::sync::CancellationToken;

use crate::tracker::arrival::ArrivalTimes;
use crate::tracker::clock::{host_time_ns, nanoseconds};
use crate::tracker::driver::{Driver, Passive};
use crate::tracker::ndi::RomError;
use crate::tracker::recording::{RecordingError, RecordingReader};
use crate::tracker::settings::{Settings, Transport};
use crate::tracker::transport::{Port, Received};
use crate::tracker::{AxisMap, DecodeError, Protocol, Record};

#[cfg(test)]
mod tests;

/// First and longest pause before a port is opened again; it doubles in between.
const RETRY: [Duration; 2] = [Duration::from_millis(250), Duration::from_secs(2)];

/// A port that takes a command no faster than this is stuck.
const SEND_TIMEOUT: Duration = Duration::from_secs(2);

/// How long the end of a session waits for its last bytes to be taken.
const STOP_TIMEOUT: Duration = Duration::from_millis(200);

/// A silent device gets up to so many times its patience, since each restart may itself take long.
const PATIENCE_LIMIT: u32 = 8;

/// Longest rest of the loop, so that no time is beyond the clock's range.
const REST_LIMIT: Duration = Duration::from_secs(3600);

/// Hears what one tracker says, on the tracker's own thread. It must not block.
pub trait Listener: Send {
    /// Every received piece, before it is decoded, with the arrival of its first byte, ns since 1970 (UTC).
    fn bytes(&mut self, host_time_ns: u64, bytes: &[u8]);

    /// A record, with the arrival of its first byte, ns since 1970 (UTC).
    fn record(&mut self, host_time_ns: u64, record: &Record);

    /// Something that happened, ns since 1970 (UTC).
    fn event(&mut self, host_time_ns: u64, event: &TrackerEvent);
}

/// Something that happened to a session.
#[derive(Debug, Clone, PartialEq)]
#[non_exhaustive]
pub enum TrackerEvent {
    /// The port is open.
    Connected {
        /// What it is called.
        port: String,
    },
    /// The port could not be opened, or is gone.
    Disconnected {
        /// Why.
        reason: String,
        /// When it will be tried again.
        retry: Duration,
    },
    /// No record came for longer than the device may be silent. It is started anew: at first on the open port, then on
    /// one that is opened again, and reset where its driver can. A mock, a recording and datagrams are only waited for.
    Silent {
        /// For how long.
        for_: Duration,
        /// How often it was started anew since its last record, this one included.
        attempt: u32,
    },
    /// Bytes that are no record, or an error that the device reports.
    DecodeError(DecodeError),
    /// Another sensor speaks, too; its records are left out. Told once a sensor and connection.
    OtherSensor {
        /// The other one.
        sensor: u16,
        /// The one that is used.
        used: u16,
    },
    /// A recording is at its end; the session is over.
    Ended,
}

/// Why a session cannot be started.
#[derive(Debug, Error)]
pub enum TrackerError {
    /// The transport doesn't fit the protocol.
    #[error("trackers that speak `{protocol}` aren't reached by transport `{transport}`")]
    Mismatch {
        /// Name of the protocol.
        protocol: &'static str,
        /// Name of the transport.
        transport: &'static str,
    },
    /// The transport was left out of this build.
    #[error("this insonify was built without the feature `{feature}`, which the transport needs")]
    NotBuilt {
        /// Cargo feature.
        feature: &'static str,
    },
    /// A recording that can't be played.
    #[error(transparent)]
    Recording(#[from] RecordingError),
    /// The description of a wireless tool that can't be used.
    #[error(transparent)]
    Rom(#[from] RomError),
    /// The system has no thread or event queue left.
    #[error("cannot start the tracker's thread: {0}")]
    Thread(#[source] io::Error),
}

/// What a session did.
#[derive(Debug, Clone, Copy, PartialEq, Eq, Default)]
pub struct SessionSummary {
    /// Bytes received.
    pub bytes: u64,
    /// Records handed to the listener.
    pub records: u64,
    /// Pieces of the stream that were no record, and errors that the device reported.
    pub decode_errors: u64,
    /// Records of other sensors, left out.
    pub other_sensor: u64,
    /// Times that the port was opened.
    pub connections: u64,
    /// Times that the device was too silent.
    pub silences: u64,
}

/// A session that runs.
#[derive(Debug)]
pub struct SessionHandle {
    thread: JoinHandle<SessionSummary>,
}

impl SessionHandle {
    /// Whether the session is over.
    pub fn is_finished(&self) -> bool {
        self.thread.is_finished()
    }

    /// Waits until the session is over: until its token is cancelled, or its recording ends. A panic of the listener
    /// goes on here.
    pub fn join(self) -> SessionSummary {
        self.thread.join().unwrap_or_else(|panic| std::panic::resume_unwind(panic))
    }
}

/// What the bytes of a tracker mean: the station's protocol, but a recording knows its own.
///
/// # Errors
/// A recording that can't be read.
pub fn stream_protocol(settings: &Settings) -> Result<Protocol, TrackerError> {
    match &settings.transport {
        Transport::Recording { path, .. } => Ok(RecordingReader::open(path)?.info().protocol),
        _ => Ok(settings.protocol),
    }
}

/// The sensor that counts: the station's, else the one that a recording names or that the device's driver asks for; none
/// for the first that is heard.
///
/// # Errors
/// A recording that can't be read.
pub fn stream_sensor(settings: &Settings) -> Result<Option<u16>, TrackerError> {
    match (&settings.transport, settings.device.sensor) {
        (_, Some(sensor)) => Ok(Some(sensor)),
        (Transport::Recording { path, .. }, None) => Ok(RecordingReader::open(path)?.info().sensor),
        (_, None) => Ok(settings.protocol.first_sensor()),
    }
}

/// Starts a session. It ends soon after `cancel`, in any state, or after the last byte of a recording.
///
/// A device that isn't there yet is no error: it is waited for.
///
/// # Errors
/// A transport that doesn't fit the protocol or isn't built in; a recording that can't be read; no thread.
pub fn spawn(
    settings: &Settings,
    listener: Box<dyn Listener>,
    cancel: CancellationToken,
) -> Result<SessionHandle, TrackerError> {
    let session = Session::new(settings, listener, cancel)?;
    let runtime = tokio::runtime::Builder::new_current_thread().enable_all().build().map_err(TrackerError::Thread)?;
    let thread = std::thread::Builder::new()
        .name("tracker".to_owned())
        .spawn(move || runtime.block_on(session.run()))
        .map_err(TrackerError::Thread)?;
    Ok(SessionHandle { thread })
}

/// Why a connection is over.
enum Over {
    Cancelled,
    /// The recording's end.
    Ended,
    Lost(String),
}

struct Session {
    port: Port,
    driver: Box<dyn Driver>,
    listener: Box<dyn Listener>,
    cancel: CancellationToken,
    axis_map: AxisMap,
    /// Whether the device's silence means nothing.
    may_rest: bool,
    /// The sensor of the station, or the first one heard.
    sensor: Option<u16>,
    /// Others that were told of on this connection, a bit each.
    told: u64,
    /// Time 0 of the driver, and what the host's clock said then.
    started: Instant,
    started_ns: u64,
    /// Bytes not decoded yet.
    buffer: BytesMut,
    arrivals: ArrivalTimes,
    /// When the last record came, or the port was opened.
    heard: Duration,
    /// From when on the device's silence counts: as `heard`, or when it was started anew.
    patient_from: Duration,
    /// How long it was allowed to be silent when that was looked at last.
    patient_for: Duration,
    /// Whether the device had its time for a first record after it was set up.
    had_grace: bool,
    /// Restarts since the last record.
    attempt: u32,
    retry: Duration,
    summary: SessionSummary,
}

impl Session {
    fn new(settings: &Settings, listener: Box<dyn Listener>, cancel: CancellationToken) -> Result<Self, TrackerError> {
        let (transport, mut protocol) = (&settings.transport, settings.protocol);
        if !transport.carries(protocol) {
            return Err(TrackerError::Mismatch { protocol: protocol.name(), transport: transport.name() });
        }
        let port = Port::new(transport)?;
        let mut sensor = settings.device.sensor;
        // A recorded device can't be spoken to.
        let driver: Box<dyn Driver> = if let Port::Recording(recording) = &port {
            protocol = recording.protocol();
            sensor = sensor.or(recording.sensor());
            Box::new(Passive::new(protocol, &settings.device))
        } else {
            sensor = sensor.or(protocol.first_sensor());
            let mut device = settings.device.clone();
            if protocol == Protocol::Ndi {
                device.ndi = device.ndi.load_roms()?;
            }
            protocol.driver(&device)
        };
        Ok(Self {
            port,
            driver,
            listener,
            cancel,
            axis_map: settings.axis_map,
            may_rest: Transport::may_rest(protocol),
            sensor,
            told: 0,
            started: Instant::now(),
            started_ns: host_time_ns(),
            buffer: BytesMut::with_capacity(8192),
            arrivals: ArrivalTimes::default(),
            heard: Duration::ZERO,
            patient_from: Duration::ZERO,
            patient_for: Duration::ZERO,
            had_grace: false,
            attempt: 0,
            retry: RETRY[0],
            summary: SessionSummary::default(),
        })
    }

    async fn run(mut self) -> SessionSummary {
        let cancel = self.cancel.clone();
        // Times run from here, where there is a runtime with its clock.
        (self.started, self.started_ns) = (Instant::now(), host_time_ns());
        loop {
            let over = tokio::select! {
                biased;
                () = cancel.cancelled() => Over::Cancelled,
                over = self.connection() => over,
            };
            if matches!(over, Over::Cancelled)
                && let Some(bytes) = self.driver.stop()
            {
                // A device that can't be told any more goes on; that is no reason to stay.
                let _ = timeout(STOP_TIMEOUT, self.port.send(&bytes)).await;
            }
            self.port.close();
            let reason = match over {
                Over::Cancelled => break,
                Over::Ended => {
                    self.event(TrackerEvent::Ended);
                    break;
                }
                Over::Lost(reason) => reason,
            };
            let retry = self.retry;
            self.event(TrackerEvent::Disconnected { reason, retry });
            if !self.port.returns() {
                self.event(TrackerEvent::Ended);
                break;
            }
            self.retry = (retry * 2).min(RETRY[1]);
            tokio::select! {
                biased;
                () = cancel.cancelled() => break,
                () = sleep(retry) => {}
            }
        }
        self.summary
    }

    /// Opens the port and listens until it is lost.
    async fn connection(&mut self) -> Over {
        let port = match self.port.open().await {
            Ok(port) => port,
            Err(error) => return Over::Lost(error.to_string()),
        };
        self.summary.connections += 1;
        self.told = 0;
        self.event(TrackerEvent::Connected { port });
        self.heard = self.now();
        self.restart();
        let over = self.listen().await.unwrap_or_else(|error| Over::Lost(error.to_string()));
        self.finish();
        over
    }

    /// When the device has been silent for too long.
    fn silent_at(&mut self) -> Duration {
        let patience = self.patience();
        // A device that took its time to be set up has the whole of the shorter time for its first record. Once a start:
        // one that is set up again and again and never answers is silent.
        if patience < self.patient_for && !self.had_grace {
            self.patient_from = self.now();
            self.had_grace = true;
        }
        self.patient_for = patience;
        self.patient_from.saturating_add(patience)
    }

    /// Starts the device; a part of a record that came before is of no use.
    fn restart(&mut self) {
        self.finish();
        self.patient_from = self.now();
        // The patience of the start before says nothing about this one.
        self.patient_for = Duration::ZERO;
        self.had_grace = false;
        self.driver.start(self.patient_from, self.attempt);
    }

    /// Ends a message, or the stream.
    fn finish(&mut self) {
        let first_byte_ns = self.arrivals.of_first_of(self.buffer.len());
        if let Err(error) = self.driver.finish(&mut self.buffer) {
            self.wrong(first_byte_ns, error);
        }
    }

    async fn listen(&mut self) -> io::Result<Over> {
        let mut piece = BytesMut::new();
        loop {
            // A recording that is taken at once never rests where the token would be looked at.
            if self.cancel.is_cancelled() {
                return Ok(Over::Cancelled);
            }
            self.speak().await?;
            // A driver whose question was not answered says so although no byte has come.
            self.decode();
            let silent_at = self.silent_at();
            let wake_at = self.driver.wake_at().map_or(silent_at, |at| at.min(silent_at));
            let wake_at = wake_at.min(self.now() + REST_LIMIT);
            piece.clear();
            tokio::select! {
                // What has come counts before the clock: after a pause of the whole machine nobody was silent.
                biased;
                received = self.port.receive(&mut piece) => match received? {
                    Received::Bytes { time_ns } => self.take(&piece, time_ns),
                    Received::Again => self.restart(),
                    Received::Ended => return Ok(Over::Ended),
                },
                () = sleep_until(self.started + wake_at) => {}
            }
            let now = self.now();
            // A record that has just come has moved it.
            if now >= self.silent_at() {
                let for_ = now - self.heard;
                self.attempt = self.attempt.saturating_add(1);
                self.summary.silences += 1;
                self.event(TrackerEvent::Silent { for_, attempt: self.attempt });
                if self.attempt > 1 && self.port.wakes() {
                    return Ok(Over::Lost(format!("nothing heard for {:.1} s", for_.as_secs_f64())));
                }
                if self.port.wakes() {
                    self.restart();
                } else {
                    self.patient_from = now;
                }
            }
        }
    }

    /// How long the device may be silent now.
    fn patience(&self) -> Duration {
        if self.may_rest {
            return Duration::MAX;
        }
        self.driver.patience().saturating_mul(self.attempt.saturating_add(1).min(PATIENCE_LIMIT))
    }

    /// Sends what the driver has to say.
    async fn speak(&mut self) -> io::Result<()> {
        loop {
            let now = self.now();
            while let Some(line) = self.driver.line(now) {
                self.port.line(line).await?;
            }
            let Some(bytes) = self.driver.transmit(self.now()) else { return Ok(()) };
            let stuck = |_| io::Error::new(io::ErrorKind::TimedOut, "the port takes no bytes");
            timeout(SEND_TIMEOUT, self.port.send(&bytes)).await.map_err(stuck)??;
        }
    }

    fn take(&mut self, piece: &[u8], time_ns: Option<u64>) {
        let time_ns = time_ns.unwrap_or_else(|| self.host_now());
        self.summary.bytes += piece.len() as u64;
        self.listener.bytes(time_ns, piece);
        self.arrivals.push(piece.len(), time_ns);
        self.buffer.extend_from_slice(piece);
        self.decode();
        if self.port.has_messages() {
            self.finish();
        }
    }

    /// Takes what the driver makes of the bytes so far, and of the time.
    fn decode(&mut self) {
        loop {
            let first_byte_ns = self.arrivals.of_first_of(self.buffer.len());
            let now = self.now();
            match self.driver.decode(now, &mut self.buffer) {
                Ok(Some(record)) => {
                    self.alive(now);
                    self.record(first_byte_ns, record);
                }
                Ok(None) => break,
                Err(error) => {
                    if error.is_report() {
                        self.alive(now);
                    }
                    self.wrong(first_byte_ns, error);
                }
            }
        }
    }

    fn wrong(&mut self, host_time_ns: u64, error: DecodeError) {
        self.summary.decode_errors += 1;
        self.listener.event(host_time_ns, &TrackerEvent::DecodeError(error));
    }

    fn alive(&mut self, now: Duration) {
        (self.heard, self.patient_from) = (now, now);
        self.had_grace = false;
        self.attempt = 0;
        self.retry = RETRY[0];
    }

    fn record(&mut self, host_time_ns: u64, record: Record) {
        let used = *self.sensor.get_or_insert(record.sensor);
        if record.sensor == used {
            self.summary.records += 1;
            self.listener.record(host_time_ns, &self.axis_map.apply(record));
            return;
        }
        self.summary.other_sensor += 1;
        let bit = 1 << (record.sensor & 63);
        if self.told & bit == 0 {
            self.told |= bit;
            self.listener.event(host_time_ns, &TrackerEvent::OtherSensor { sensor: record.sensor, used });
        }
    }

    fn event(&mut self, event: TrackerEvent) {
        let now = self.host_now();
        self.listener.event(now, &event);
    }

    /// Time of the driver.
    fn now(&self) -> Duration {
        self.started.elapsed()
    }

    fn host_now(&self) -> u64 {
        self.started_ns + nanoseconds(self.now())
    }
}
