//! `insonify record`: records a tracker's bytes.

use std::path::{Path, PathBuf};
use std::time::{Duration, Instant};

use anyhow::anyhow;
use clap::Parser;
use insonify::files::Outputs;
use insonify::pipeline::{StopSignals, start_recorder};
use insonify::recording::{Capture, Event, Recorded, stream_of};
use insonify::station::{Station, missing_calibration};
use insonify::tracker::{ProbeSensor, SensorReport, Settings, TrackerReport, Transport, host_time_ns};
use serde::Serialize;
use tokio::runtime::Runtime;

use super::status_line::StatusLine;
use super::tracker_args::{ASCII_LINE_HELP, TrackerArgs};
use super::{Classify, Failure, input, live, output, terminal};

/// Period at which the recording's status is checked.
const POLL: Duration = Duration::from_millis(250);

/// Largest number of tracker events printed per status check.
const TOLD: usize = 4;

/// Record a tracker's raw bytes until Ctrl-C, or until the duration or the stream ends.
///
/// The tracker is the station's, or one chosen by options as for `insonify trackers`; --stdin takes bytes from a pipe.
/// The command waits for a missing tracker, and reconnects to a lost one. The recording contains the station file, so
/// it can be replayed without that file. While the command runs, the recording is called FILE.part; after a kill,
/// FILE.part lacks at most the last second.
///
/// The exit code is 1 without a record of the probe: the tracker sent no bytes or no records, or several sensors sent
/// records and none is chosen. The recording is kept.
#[derive(Debug, Parser)]
#[command(after_help = format!("{EXAMPLES}\n\n{ASCII_LINE_HELP}"))]
pub(crate) struct Args {
    /// Station file (TOML); `insonify station-keys` lists its keys
    station: PathBuf,

    /// Recording to write (.mcap)
    #[arg(long, value_name = "FILE")]
    out: PathBuf,

    #[command(flatten)]
    tracker: TrackerArgs,

    /// Read the bytes from stdin, in the protocol of --protocol, or else of the station's tracker
    #[arg(long, conflicts_with_all = ["port", "address", "baud"])]
    stdin: bool,

    /// End after this many seconds, up to 31 days
    #[arg(long, value_name = "S", value_parser = input::seconds, allow_negative_numbers = true)]
    duration: Option<Duration>,

    /// Replace FILE if it is there
    #[arg(long)]
    force: bool,

    /// Print what was recorded as JSON
    #[arg(long)]
    json: bool,
}

const EXAMPLES: &str = "\
Examples:
  insonify record station.toml --out session.mcap              the station's own [tracker]
  insonify record station.toml --port 0403:6001 --protocol liberty --out session.mcap
  insonify record station.toml --address 192.168.1.20:4000 --protocol ascii-line --out session.mcap
  insonify record station.toml --tool ProbeToTracker --out session.mcap    one of several OpenIGTLink tools
  cat log.bin | insonify record station.toml --stdin --protocol ascii-line --out session.mcap";

#[derive(Serialize)]
struct RecordedStream<'a> {
    path: &'a Path,
    messages: u64,
    bytes: u64,
    records: u64,
    events: u64,
    damaged: u64,
    other_senders: u64,
    sensors: &'a [SensorReport],
}

/// Totals of the recorded stream.
#[derive(Default)]
struct Totals {
    records: u64,
    damaged: u64,
    other_senders: u64,
    sensors: Vec<SensorReport>,
    undecided: bool,
    cause: Option<String>,
}

/// Runs the command.
pub(crate) fn run(args: &Args) -> Result<(), Failure> {
    let station = Station::load(&args.station)?;
    Outputs::apart_from(station.files()).file("--out", &args.out, args.force)?;
    output::recording("--out", &args.out)?;
    let tracker = if args.stdin { None } else { Some(tracker(args, &station)?) };
    let stream = match &tracker {
        Some(tracker) => stream_of(tracker)?,
        None => {
            let Settings { protocol: own, device, transport, .. } = &station.tracker;
            let protocol = args.tracker.protocol.unwrap_or(*own);
            let mut settings = Settings { protocol, ..Settings::default() };
            // The station's choice of the probe's sensor applies only to its own protocol. A station that plays a
            // recording leaves the choice to that recording.
            if protocol == *own && !matches!(transport, Transport::Recording { .. }) {
                settings.device = device.clone();
            }
            args.tracker.choose_probe(&mut settings)?;
            settings.stream(None)
        }
    };
    let from = tracker.as_ref().map_or_else(|| "stdin".to_owned(), Settings::to_string);
    let runtime = tokio::runtime::Builder::new_current_thread().enable_all().build().other()?;
    let signals = {
        let _inside = runtime.enter();
        StopSignals::new().other()?
    };
    let is_only = matches!(stream.sensor, Some(ProbeSensor::Only));
    let recorder = start_recorder(&args.out, &station, stream.clone(), &from, "", host_time_ns())?;
    let capture = match &tracker {
        Some(tracker) => Capture::of_tracker(tracker, recorder.handle())?,
        None => Capture::of_stream(std::io::stdin(), stream, recorder.handle()).other()?,
    };
    if let Some(tracker) = &tracker {
        missing_calibration(tracker, &station.calibration).iter().for_each(live::warn_of_setup);
    }
    terminal::say(&format!("recording {from} to {}; Ctrl-C ends it", args.out.display()));
    let (reason, totals) = wait(&runtime, signals, args.duration, capture, is_only);
    terminal::say(&reason);
    recorder.handle().event(Event::new(host_time_ns(), "end").with(reason));
    finish(args, recorder.finish(), &totals)
}

/// Settings of the tracker to record.
fn tracker(args: &Args, station: &Station) -> Result<Settings, Failure> {
    let chosen = args.tracker.over(station.tracker.clone())?;
    let mut settings = chosen.unwrap_or_else(|| station.tracker.clone());
    if settings.transport == Transport::None {
        let path = args.station.display();
        return Err(Failure::Input(anyhow!(
            "{path} has no [tracker] with a `transport`: give --protocol with --port or --address, or --stdin"
        )));
    }
    args.tracker.choose_probe(&mut settings)?;
    // A repeated recording would never end.
    if let Transport::Recording { repeat, .. } = &mut settings.transport {
        *repeat = false;
    }
    Ok(settings)
}

fn finish(args: &Args, recorded: Recorded, totals: &Totals) -> Result<(), Failure> {
    if let Some(failure) = recorded.failure {
        return Err(Failure::Other(anyhow!("{failure}; what was written before can be replayed")));
    }
    let Recorded { messages, bytes, events, .. } = recorded;
    let Totals { records, damaged, other_senders, ref sensors, .. } = *totals;
    let useless = useless(bytes, totals, &args.out);
    if args.json {
        let path = &args.out;
        output::json(&RecordedStream { path, messages, bytes, records, events, damaged, other_senders, sensors })?;
        return useless.map_or(Ok(()), |why| Err(Failure::Other(anyhow!("{why}"))));
    }
    output::line(format!("{records} records, {bytes} bytes in {messages} messages; {damaged} damaged pieces"))?;
    if other_senders > 0 {
        output::line(format!("{other_senders} datagrams of other senders left out"))?;
    }
    output::line(args.out.display())?;
    useless.map_or(Ok(()), |why| Err(Failure::Other(anyhow!("{why}"))))
}

/// Reason why a recording of `bytes` bytes holds no pose of the probe; `None` if it holds one.
fn useless(bytes: u64, totals: &Totals, path: &Path) -> Option<String> {
    let cause = totals.cause.as_ref().map_or_else(String::new, |cause| format!(": {cause}"));
    let path = path.display();
    if bytes == 0 {
        Some(format!("the tracker sent nothing{cause}"))
    } else if totals.undecided {
        Some(format!(
            "several sensors were heard and none was chosen as the probe; `insonify inspect {path}` lists them"
        ))
    } else if totals.records > 0 {
        None
    } else if totals.sensors.is_empty() {
        Some(format!("no record was found in these bytes{cause}"))
    } else {
        Some(format!("the chosen probe was not heard; `insonify inspect {path}` lists the others"))
    }
}

/// Prints the status until the recording ends. Returns the reason for the end, and the totals. With `is_only`, no
/// sensor is chosen, so the probe must be the only one.
fn wait(
    runtime: &Runtime,
    mut signals: StopSignals,
    duration: Option<Duration>,
    mut capture: Capture,
    is_only: bool,
) -> (String, Totals) {
    let started = Instant::now();
    let mut line = StatusLine::new();
    let mut totals = Totals::default();
    let mut show = |report: TrackerReport, bytes: u64| {
        totals.records += report.records;
        totals.damaged = report.decode_errors;
        let records = totals.records;
        report.news(TOLD).for_each(|news| terminal::say(&format!("tracker: {news}")));
        let elapsed_s = started.elapsed().as_secs_f64();
        line.set(elapsed_s, || {
            let rate = report.rate_hz.map_or_else(|| "-".to_owned(), |rate| format!("{rate:.1}"));
            let (state, missing, damaged) = (report.state.name(), report.missing, report.decode_errors);
            format!(
                "{elapsed_s:7.1} s  {state:<12} {records} records  {bytes} bytes  {rate} Hz  lost {missing}  damaged {damaged}"
            )
        });
    };
    let reason = runtime.block_on(async {
        loop {
            let left = duration.map_or(POLL, |duration| duration.saturating_sub(started.elapsed()).min(POLL));
            let asked = tokio::select! {
                _ = signals.next() => Some("it was stopped".to_owned()),
                () = tokio::time::sleep(left) => None,
            };
            let over = capture.over();
            show(capture.report(), capture.bytes());
            let done = duration.is_some_and(|duration| started.elapsed() >= duration);
            let done = done.then(|| "the duration was over".to_owned());
            if let Some(reason) = over.or(asked).or(done) {
                return reason;
            }
        }
    });
    let bytes = capture.bytes();
    let (report, sensors, summary) = capture.end();
    show(report, bytes);
    drop(line);
    totals.sensors = sensors;
    totals.undecided = is_only && totals.sensors.iter().filter(|sensor| !sensor.is_needle).count() > 1;
    if let Some(summary) = summary {
        (totals.other_senders, totals.undecided, totals.cause) =
            (summary.other_sender, summary.undecided, summary.cause);
    }
    (reason, totals)
}

#[cfg(test)]
mod tests {
    use super::*;

    #[test]
    fn a_recording_without_a_record_of_the_probe_is_useless() {
        let path = Path::new("r.mcap");
        let heard = Totals { records: 3, ..Totals::default() };
        assert_eq!(useless(90, &heard, path), None);
        assert_eq!(useless(0, &Totals::default(), path).as_deref(), Some("the tracker sent nothing"));
        let none = Totals { cause: Some("another baud".to_owned()), ..Totals::default() };
        let why = useless(90, &none, path).unwrap();
        assert_eq!(why, "no record was found in these bytes: another baud");
        let undecided = Totals { undecided: true, ..heard };
        assert!(useless(90, &undecided, path).unwrap().contains("`insonify inspect r.mcap` lists them"));
    }
}
