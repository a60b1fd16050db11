//! `insonify record`: records a tracker's bytes.

use std::io::{ErrorKind, Read};
use std::path::{Path, PathBuf};
use std::sync::Arc;
use std::sync::atomic::{AtomicU64, Ordering};
use std::thread;
use std::time::{Duration, Instant};

use anyhow::anyhow;
use bytes::BytesMut;
use clap::Parser;
use insonify::pipeline::StopSignals;
use insonify::recording::{Event, Recorded, RecorderHandle, event_of, spawn, stream_of};
use insonify::station::Station;
use insonify::tracker::{
    Listener, Monitor, Protocol, Record, SessionHandle, SessionState, Settings, TrackerEvent, Transport, host_time_ns,
};
use serde::Serialize;
use tokio::runtime::Runtime;
use tokio::sync::oneshot;
use tokio_util::sync::CancellationToken;

use super::outputs::Outputs;
use super::status_line::StatusLine;
use super::tracker_args::TrackerArgs;
use super::{Classify, Failure, input, output, recorder, terminal};

/// Period of the recording's status checks.
const POLL: Duration = Duration::from_millis(250);

/// Longest time that stdin or a played recording waits for a slow disk.
const PATIENCE: Duration = Duration::from_secs(10);

/// Most bytes read from stdin at once.
const PIECE: usize = 4096;

/// Most tracker events printed per status check.
const TOLD: usize = 4;

/// Record a tracker's bytes as they come, until Ctrl-C, or the duration or the stream is over.
///
/// The tracker is the station's, or one chosen here as for `insonify trackers`; --stdin takes bytes from a pipe. One that
/// is not there yet is waited for, and one that goes away is found again. The recording keeps the station file, so that
/// it can be replayed without it. While it runs its file is called FILE.part; after a kill that holds all but the last
/// second.
#[derive(Debug, Parser)]
#[command(after_help = "Examples:\n  \
                  insonify record station.toml --out session.mcap              the station's own [tracker]\n  \
                  insonify record station.toml --port 0403:6001 --protocol liberty --out session.mcap\n  \
                  insonify record station.toml --address 192.168.1.20:4000 --protocol ascii-line --out session.mcap\n  \
                  cat log.bin | insonify record station.toml --stdin --protocol ascii-line --out session.mcap")]
pub(crate) struct Args {
    /// Station file (TOML); `insonify station-keys` lists its keys
    station: PathBuf,

    /// Recording to write (.mcap)
    #[arg(long, value_name = "FILE")]
    out: PathBuf,

    #[command(flatten)]
    tracker: TrackerArgs,

    /// Take the bytes from stdin; they are of --protocol, or else of the station's tracker's
    #[arg(long, conflicts_with_all = ["port", "address", "baud"])]
    stdin: bool,

    /// End after so many seconds, up to 31 days
    #[arg(long, value_name = "S", value_parser = input::seconds, allow_negative_numbers = true)]
    duration: Option<Duration>,

    /// Replace FILE if it is there
    #[arg(long)]
    force: bool,

    /// Print what was recorded as JSON
    #[arg(long)]
    json: bool,
}

#[derive(Serialize)]
struct Report<'a> {
    path: &'a Path,
    messages: u64,
    bytes: u64,
    records: u64,
    events: u64,
}

/// Runs the command.
pub(crate) fn run(args: &Args) -> Result<(), Failure> {
    let station = Station::load(&args.station)?;
    Outputs::beside_station(&station).file("--out", &args.out, args.force)?;
    let tracker = if args.stdin { None } else { Some(tracker(args, &station)?) };
    let (protocol, sensor) = match &tracker {
        Some(tracker) => stream_of(tracker)?,
        None => {
            let Settings { protocol: own, device, .. } = &station.tracker;
            let protocol = args.tracker.protocol.unwrap_or(*own);
            // The station's sensor number holds only for its own protocol.
            (protocol, args.tracker.sensor.or(device.sensor.filter(|_| protocol == *own)))
        }
    };
    let from = tracker.as_ref().map_or_else(|| "stdin".to_owned(), name);
    let runtime = tokio::runtime::Builder::new_current_thread().enable_all().build().other()?;
    let signals = {
        let _inside = runtime.enter();
        StopSignals::new().other()?
    };
    let recorder = recorder::start(&args.out, &station, (protocol, sensor), &from, "", host_time_ns())?;
    let tap = Tap::new(&recorder.handle(), tracker.as_ref());
    let source = match &tracker {
        Some(tracker) => {
            let cancel = CancellationToken::new();
            Source::Tracker(spawn(tracker, Box::new(tap.clone()), cancel.clone())?, cancel)
        }
        None => Source::Stdin(read_stdin(tap.clone(), protocol)?),
    };
    terminal::say(&format!("recording {from} to {}; Ctrl-C ends it", args.out.display()));
    let (reason, records) = wait(&runtime, signals, args.duration, source, &tap)?;
    terminal::say(&reason);
    tap.handle.event(Event::new(host_time_ns(), "end").with(reason));
    finish(args, recorder.finish(), records)
}

/// The tracker to record.
fn tracker(args: &Args, station: &Station) -> Result<Settings, Failure> {
    let chosen = args.tracker.over(station.tracker.clone())?;
    let mut settings = chosen.unwrap_or_else(|| station.tracker.clone());
    settings.device.sensor = args.tracker.sensor.or(settings.device.sensor);
    match &mut settings.transport {
        Transport::None => {
            let path = args.station.display();
            Err(Failure::Input(anyhow!(
                "{path} has no [tracker] with a `transport`: give --protocol with --port or --address, or --stdin"
            )))
        }
        // A repeating recording would never end.
        Transport::Recording { repeat, .. } => {
            *repeat = false;
            Ok(settings)
        }
        _ => Ok(settings),
    }
}

/// Readable name of the tracker.
fn name(tracker: &Settings) -> String {
    match &tracker.transport {
        Transport::None => "no tracker".to_owned(),
        Transport::Serial { port, baud } => format!("{} on {port} at {baud} baud", tracker.protocol.name()),
        Transport::Tcp { address } => format!("{} from tcp {address}", tracker.protocol.name()),
        Transport::Udp { address } => format!("{} at udp {address}", tracker.protocol.name()),
        Transport::Hid { device: Some(device) } => format!("{} on {device}", tracker.protocol.name()),
        Transport::Hid { device: None } => format!("the first {}", tracker.protocol.name()),
        Transport::Mock(_) => "a mock tracker".to_owned(),
        Transport::Recording { path, .. } => path.display().to_string(),
    }
}

fn finish(args: &Args, recorded: Recorded, records: u64) -> Result<(), Failure> {
    if let Some(failure) = recorded.failure {
        return Err(Failure::Other(anyhow!("{failure}; what was written before can be replayed")));
    }
    let Recorded { messages, bytes, events, .. } = recorded;
    if bytes == 0 {
        tracing::warn!("the tracker sent nothing");
    } else if records == 0 {
        tracing::warn!("no record was found in these bytes; is it another protocol?");
    }
    if args.json {
        return output::json(&Report { path: &args.out, messages, bytes, records, events });
    }
    output::line(format!("{records} records, {bytes} bytes in {messages} messages"))?;
    output::line(args.out.display())
}

/// Listens to the tracker: records its bytes and counts its records.
#[derive(Clone)]
struct Tap {
    handle: RecorderHandle,
    monitor: Monitor,
    bytes: Arc<AtomicU64>,
    /// Longest wait of bytes for the disk; zero for live trackers.
    patience: Duration,
}

impl Tap {
    fn new(handle: &RecorderHandle, tracker: Option<&Settings>) -> Self {
        let waits = tracker.is_none_or(|t| matches!(t.transport, Transport::Recording { .. }));
        let patience = if waits { PATIENCE } else { Duration::ZERO };
        Self { handle: handle.clone(), monitor: Monitor::default(), bytes: Arc::default(), patience }
    }
}

impl Listener for Tap {
    fn bytes(&mut self, host_time_ns: u64, bytes: &[u8]) {
        self.bytes.fetch_add(bytes.len() as u64, Ordering::Relaxed);
        self.handle.raw_within(host_time_ns, bytes, self.patience);
    }

    fn record(&mut self, host_time_ns: u64, record: &Record) {
        self.monitor.record(host_time_ns, record);
    }

    fn event(&mut self, host_time_ns: u64, event: &TrackerEvent) {
        self.monitor.event(host_time_ns, event);
        if let Some(event) = event_of(host_time_ns, event) {
            self.handle.event(event);
        }
    }
}

/// Source of the bytes.
enum Source {
    Tracker(SessionHandle, CancellationToken),
    /// Receives the reason for its end.
    Stdin(oneshot::Receiver<String>),
}

impl Source {
    /// Reason for its end, if it has ended.
    fn over(&mut self) -> Option<String> {
        match self {
            Self::Tracker(session, _) => session.is_finished().then(|| "the tracker's session is over".to_owned()),
            Self::Stdin(ended) => match ended.try_recv() {
                Ok(reason) => Some(reason),
                Err(oneshot::error::TryRecvError::Empty) => None,
                Err(oneshot::error::TryRecvError::Closed) => Some("the reader stopped".to_owned()),
            },
        }
    }

    /// Ends a tracker's session; a thread that waits for stdin is abandoned.
    fn end(self) {
        if let Self::Tracker(session, cancel) = self {
            cancel.cancel();
            session.join();
        }
    }
}

/// Reads stdin on its own thread, which is abandoned if stdin never ends. The receiver gets the reason for the end.
fn read_stdin(mut tap: Tap, protocol: Protocol) -> Result<oneshot::Receiver<String>, Failure> {
    let (end, ended) = oneshot::channel();
    let read = move || {
        let (mut piece, mut decoder, mut buffer) = ([0; PIECE], protocol.decoder(), BytesMut::new());
        let reason = loop {
            match std::io::stdin().read(&mut piece) {
                Ok(0) => break "the stream ended".to_owned(),
                Ok(read) => {
                    let now_ns = host_time_ns();
                    tap.bytes(now_ns, &piece[..read]);
                    buffer.extend_from_slice(&piece[..read]);
                    loop {
                        match decoder.decode(&mut buffer) {
                            Ok(Some(record)) => tap.record(now_ns, &record),
                            Ok(None) => break,
                            Err(error) => tap.event(now_ns, &TrackerEvent::DecodeError(error)),
                        }
                    }
                }
                Err(error) if error.kind() == ErrorKind::Interrupted => {}
                Err(error) => break format!("the stream broke: {error}"),
            }
        };
        // The receiver is gone if the recording ended for another reason.
        let _ = end.send(reason);
    };
    thread::Builder::new().name("tracker".to_owned()).spawn(read).other()?;
    Ok(ended)
}

/// Prints the status until the recording ends. Returns the reason for the end and the number of records.
fn wait(
    runtime: &Runtime,
    mut signals: StopSignals,
    duration: Option<Duration>,
    mut source: Source,
    tap: &Tap,
) -> Result<(String, u64), Failure> {
    let started = Instant::now();
    let mut line = StatusLine::new();
    let mut progress = Progress::default();
    let reason: Result<String, Failure> = runtime.block_on(async {
        loop {
            let left = duration.map_or(POLL, |duration| duration.saturating_sub(started.elapsed()).min(POLL));
            let asked = tokio::select! {
                _ = signals.next() => Some("it was stopped".to_owned()),
                () = tokio::time::sleep(left) => None,
            };
            let over = source.over();
            progress.show(tap, started.elapsed(), &mut line);
            let failed = tap.handle.failure().map(|_| "the disk does not take it".to_owned());
            let done = duration.is_some_and(|duration| started.elapsed() >= duration);
            let done = done.then(|| "the duration was over".to_owned());
            if let Some(reason) = failed.or(over).or(asked).or(done) {
                return Ok(reason);
            }
        }
    });
    source.end();
    progress.show(tap, started.elapsed(), &mut line);
    drop(line);
    Ok((reason?, progress.records))
}

/// State of the recording.
#[derive(Default)]
struct Progress {
    records: u64,
    state: SessionState,
}

impl Progress {
    fn show(&mut self, tap: &Tap, elapsed: Duration, line: &mut StatusLine) {
        let report = tap.monitor.report();
        self.records += report.records;
        self.state = report.state;
        report.news(TOLD).for_each(|news| terminal::say(&format!("tracker: {news}")));
        line.set(elapsed.as_secs_f64(), || {
            let rate = report.rate_hz.map_or_else(|| "-".to_owned(), |rate| format!("{rate:.1}"));
            let bytes = tap.bytes.load(Ordering::Relaxed);
            format!(
                "{:7.1} s  {:<12} {} records  {bytes} bytes  {rate} Hz  lost {}  damaged {}",
                elapsed.as_secs_f64(),
                self.state.name(),
                self.records,
                report.missing,
                report.decode_errors,
            )
        });
    }
}
