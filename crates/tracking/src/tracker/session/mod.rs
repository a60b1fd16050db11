//! Session with one tracker on a separate thread: opens the port, runs the driver, time-stamps and decodes the bytes,
//! and recovers from hardware faults.

use std::io;
use std::thread::JoinHandle;
use std::time::Duration;

use bytes::BytesMut;
use tokio::time::{Instant, sleep, sleep_until, timeout};
use tokio_util::sync::CancellationToken;

use crate::tracker::arrival::StampedBuffer;
use crate::tracker::clock::{host_time_ns, nanoseconds};
use crate::tracker::driver::Driver;
use crate::tracker::passive::Passive;
use crate::tracker::playback::Playback;
use crate::tracker::settings::{Settings, Transport};
use crate::tracker::transport::{Port, Received};
use crate::tracker::{
    DecodeError, Listener, NeedleSensor, ProbeSensor, Protocol, SensorName, TrackerError, TrackerEvent,
};

mod advice;
mod damage_watch;
mod intake;
mod regularity;
mod silence;
#[cfg(test)]
mod tests;

use intake::Intake;
use silence::SilenceWatch;

/// First and longest pause before a port is reopened; it doubles in between.
const RETRY: [Duration; 2] = [Duration::from_millis(250), Duration::from_secs(2)];

/// Time after which a port that does not accept a command counts as stuck.
const SEND_TIMEOUT: Duration = Duration::from_secs(2);

/// Longest wait for the last bytes to be sent at the end of a session.
const STOP_TIMEOUT: Duration = Duration::from_millis(200);

/// Longest sleep of the loop, to stay within the clock's range.
const REST_LIMIT: Duration = Duration::from_secs(3600);

/// Totals of a session.
#[derive(Debug, Clone, PartialEq, Eq, Default)]
pub struct SessionSummary {
    /// Number of bytes received.
    pub bytes: u64,
    /// Number of records passed to the listener.
    pub records: u64,
    /// Number of decode errors, including errors reported by the device.
    pub decode_errors: u64,
    /// Number of records of the needle passed to the listener.
    pub needle_records: u64,
    /// Number of records of sensors other than the tools'. If there are several sensors and none was chosen, all records
    /// count here.
    pub other_sensor: u64,
    /// Number of datagrams of other senders.
    pub other_sender: u64,
    /// Number of times the port was opened.
    pub connections: u64,
    /// Number of silences beyond the limit.
    pub silences: u64,
    /// Sensors heard, in the order of their first records.
    pub heard: Vec<SensorName>,
    /// Whether several sensors were heard and none was chosen.
    pub undecided: bool,
    /// Likely cause and remedy if there was no record. If the port was never opened, the reason for that.
    pub cause: Option<String>,
}

/// Handle of a running session.
#[derive(Debug)]
pub struct SessionHandle {
    thread: JoinHandle<SessionSummary>,
}

impl SessionHandle {
    /// Whether the session has ended.
    pub fn is_finished(&self) -> bool {
        self.thread.is_finished()
    }

    /// Waits for the end of the session: cancellation of its token, or the end of its recording. A panic of the
    /// listener is propagated.
    pub fn join(self) -> SessionSummary {
        self.thread.join().unwrap_or_else(|panic| std::panic::resume_unwind(panic))
    }
}

/// Starts a session with a device. It ends soon after `cancel`, in any state.
///
/// A missing device is not an error: the session waits for it.
///
/// # Errors
/// The transport cannot carry the protocol, is not built in, or is a recording, which needs [`play`]; a tool
/// description cannot be read; or no thread is available.
pub fn spawn(
    settings: &Settings,
    listener: Box<dyn Listener>,
    cancel: CancellationToken,
) -> Result<SessionHandle, TrackerError> {
    start(Session::new(settings, None, listener, cancel)?)
}

/// Starts a session that plays recorded bytes at the speed of `settings`, whose transport is [`Transport::Recording`].
/// It ends soon after `cancel`, or after the last byte.
///
/// # Errors
/// The transport is not a recording, or no thread is available.
pub fn play(
    settings: &Settings,
    playback: Box<dyn Playback>,
    listener: Box<dyn Listener>,
    cancel: CancellationToken,
) -> Result<SessionHandle, TrackerError> {
    if !matches!(settings.transport, Transport::Recording { .. }) {
        return Err(TrackerError::NoRecording { transport: settings.transport.name() });
    }
    start(Session::new(settings, Some(playback), listener, cancel)?)
}

fn start(session: Session) -> Result<SessionHandle, TrackerError> {
    let runtime = tokio::runtime::Builder::new_current_thread().enable_all().build().map_err(TrackerError::Thread)?;
    let thread = std::thread::Builder::new()
        .name("tracker".to_owned())
        .spawn(move || runtime.block_on(session.run()))
        .map_err(TrackerError::Thread)?;
    Ok(SessionHandle { thread })
}

/// Reason for the end of a connection.
enum ConnectionEnd {
    Cancelled,
    /// End of the recording.
    Ended,
    Lost(String),
}

struct Session {
    port: Port,
    driver: Box<dyn Driver>,
    intake: Intake,
    cancel: CancellationToken,
    silence: SilenceWatch,
    /// Time 0 of the driver; `started_ns` is the host's clock at that time.
    started: Instant,
    started_ns: u64,
    /// Bytes not decoded yet.
    buffer: StampedBuffer,
    retry: Duration,
}

impl Session {
    fn new(
        settings: &Settings,
        playback: Option<Box<dyn Playback>>,
        listener: Box<dyn Listener>,
        cancel: CancellationToken,
    ) -> Result<Self, TrackerError> {
        let transport = &settings.transport;
        if !transport.carries(settings.protocol) {
            let (protocol, transport) = (settings.protocol.name(), transport.name());
            return Err(TrackerError::Mismatch { protocol, transport });
        }
        let port = Port::new(transport, playback)?;
        let recorded = match &port {
            Port::Playback(port) => Some(port.source().stream()),
            _ => None,
        };
        let is_recorded = recorded.is_some();
        let stream = settings.stream(recorded);
        let protocol = stream.protocol;
        match &stream.sensor {
            Some(ProbeSensor::Tool(tool)) if !protocol.has_names() => {
                return Err(TrackerError::NoNames { tool: tool.clone(), protocol: protocol.name() });
            }
            // The sensors of a recording always arrive in the same order, so a number identifies a named tool.
            Some(ProbeSensor::Number(number)) if protocol.has_names() && !is_recorded => {
                return Err(TrackerError::NoNumbers { number: *number, protocol: protocol.name() });
            }
            _ => {}
        }
        if let (Some(NeedleSensor::Tool(tool)), false) = (&stream.needle, protocol.has_names()) {
            return Err(TrackerError::NoNames { tool: tool.clone(), protocol: protocol.name() });
        }
        // A recorded device receives no commands.
        let driver: Box<dyn Driver> = if is_recorded {
            Box::new(Passive::new(protocol, &settings.device))
        } else {
            let mut device = settings.device.clone();
            if protocol == Protocol::Ndi {
                device.ndi = device.ndi.load_roms()?;
            }
            protocol.driver(&device)
        };
        Ok(Self {
            port,
            driver,
            intake: Intake::new(settings, stream, listener),
            cancel,
            silence: SilenceWatch::new(protocol.may_rest()),
            started: Instant::now(),
            started_ns: host_time_ns(),
            buffer: StampedBuffer::default(),
            retry: RETRY[0],
        })
    }

    async fn run(mut self) -> SessionSummary {
        let cancel = self.cancel.clone();
        // Times start here, inside the runtime that provides the clock.
        (self.started, self.started_ns) = (Instant::now(), host_time_ns());
        loop {
            let end = tokio::select! {
                biased;
                () = cancel.cancelled() => ConnectionEnd::Cancelled,
                end = self.connection() => end,
            };
            if matches!(end, ConnectionEnd::Cancelled)
                && let Some(bytes) = self.driver.stop()
            {
                // The session ends even if the device cannot be stopped.
                let _ = timeout(STOP_TIMEOUT, self.port.send(&bytes)).await;
            }
            self.port.close();
            self.intake.tell(self.now(), self.host_now(), true);
            let reason = match end {
                ConnectionEnd::Cancelled => break,
                ConnectionEnd::Ended => {
                    self.event(TrackerEvent::Ended);
                    break;
                }
                ConnectionEnd::Lost(reason) => reason,
            };
            self.intake.lost(&reason);
            let retry = self.retry;
            self.event(TrackerEvent::Disconnected { reason, retry });
            if !self.port.may_recover() {
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
        self.intake.finish(self.driver.skipped())
    }

    /// Opens the port and receives until it is lost.
    async fn connection(&mut self) -> ConnectionEnd {
        let port = match self.port.open().await {
            Ok(port) => port,
            Err(error) => return ConnectionEnd::Lost(error.to_string()),
        };
        let now = self.now();
        self.intake.opened(now, self.host_now(), port);
        self.silence.opened(now);
        self.restart();
        let end = self.listen().await.unwrap_or_else(|error| ConnectionEnd::Lost(error.to_string()));
        self.finish();
        end
    }

    /// Time at which the device counts as silent.
    fn silent_at(&mut self) -> Duration {
        self.silence.deadline(self.driver.silence_limit(), self.now())
    }

    /// Restarts the device; an incomplete record is discarded.
    fn restart(&mut self) {
        self.finish();
        let now = self.now();
        self.silence.restarted(now);
        self.intake.restarted();
        self.driver.start(now, self.silence.attempt());
    }

    /// Ends a message or the stream.
    fn finish(&mut self) {
        let first_byte_ns = self.buffer.first_byte_ns();
        if let Err(error) = self.driver.finish(&mut self.buffer.bytes) {
            self.decode_error(first_byte_ns, error);
        }
    }

    async fn listen(&mut self) -> io::Result<ConnectionEnd> {
        let mut piece = BytesMut::new();
        loop {
            // Playback without pauses never waits, so it would not notice the cancellation.
            if self.cancel.is_cancelled() {
                return Ok(ConnectionEnd::Cancelled);
            }
            self.send_pending().await?;
            // The driver reports a timed-out request even if no byte arrived.
            self.decode();
            let silent_at = self.silent_at();
            let wakes = [self.driver.wake_at(), self.intake.due_at()];
            let wake_at = wakes.into_iter().flatten().fold(silent_at, Duration::min).min(self.now() + REST_LIMIT);
            piece.clear();
            tokio::select! {
                // Received bytes take precedence over the clock: after a suspend, no device counts as silent.
                biased;
                received = self.port.receive(&mut piece) => match received? {
                    Received::Bytes { time_ns } => self.take(&piece, time_ns),
                    Received::FromNewSender { before, now } => {
                        self.event(TrackerEvent::SenderChanged { from: before, to: now });
                        self.take(&piece, None);
                    }
                    Received::FromOtherSender { other, used } => {
                        self.intake.other_sender(self.now(), self.host_now(), other, used);
                    }
                    Received::Restarted => self.restart(),
                    Received::Ended => return Ok(ConnectionEnd::Ended),
                },
                () = sleep_until(self.started + wake_at) => {}
            }
            let now = self.now();
            self.intake.tell(now, self.host_now(), false);
            // The deadline is queried again, because a record that has just arrived moves it.
            if now >= self.silent_at() {
                let for_ = self.silence.silent(now);
                self.intake.summary.silences += 1;
                let cause = self.intake.cause_of_silence(self.driver.skipped());
                self.event(TrackerEvent::Silent { for_, attempt: self.silence.attempt(), cause });
                if self.port.reopening_may_wake() {
                    if self.silence.attempt() > 1 {
                        return Ok(ConnectionEnd::Lost(format!("nothing received for {:.1} s", for_.as_secs_f64())));
                    }
                    self.restart();
                }
            }
        }
    }

    /// Sends the bytes that the driver has pending.
    async fn send_pending(&mut self) -> io::Result<()> {
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
        self.intake.bytes(time_ns, piece);
        self.buffer.push(piece, time_ns);
        self.decode();
        if self.port.has_messages() {
            self.finish();
        }
    }

    /// Passes on the records that the driver decodes from the buffered bytes.
    fn decode(&mut self) {
        loop {
            let first_byte_ns = self.buffer.first_byte_ns();
            let now = self.now();
            match self.driver.decode(now, &mut self.buffer.bytes) {
                Ok(Some(record)) => {
                    self.answered(now);
                    let name = self.driver.name_of(record.sensor);
                    self.intake.record(now, first_byte_ns, record, name);
                }
                Ok(None) => break,
                Err(error) => {
                    if error.is_report() {
                        self.answered(now);
                    }
                    self.decode_error(first_byte_ns, error);
                }
            }
        }
    }

    fn decode_error(&mut self, host_time_ns: u64, error: DecodeError) {
        let now = self.now();
        self.intake.fault(now, host_time_ns, error);
    }

    fn answered(&mut self, now: Duration) {
        self.silence.answered(now);
        self.retry = RETRY[0];
    }

    fn event(&mut self, event: TrackerEvent) {
        let now = self.host_now();
        self.intake.event(now, &event);
    }

    /// Current time on the driver's clock.
    fn now(&self) -> Duration {
        self.started.elapsed()
    }

    fn host_now(&self) -> u64 {
        self.started_ns + nanoseconds(self.now())
    }
}
