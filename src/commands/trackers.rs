//! `insonify trackers`: lists ports and devices, or prints a tracker's data.

use std::path::PathBuf;
use std::time::{Duration, Instant};

use anyhow::{Context, anyhow};
use clap::Parser;
use insonify::recording::spawn;
use insonify::station::Station;
use insonify::tracker::devices::{self, Devices};
use insonify::tracker::{
    Monitor, ReportLine, SensorName, SessionState, SessionSummary, Settings, TrackerEvent, TrackerReport,
};
use tokio_util::sync::CancellationToken;

use super::tracker_args::{self, ASCII_LINE_HELP, TrackerArgs};
use super::{Classify, Failure, output};

/// List serial ports and HID devices, or print a tracker's data.
///
/// With a station file, --port or --address, live poses are printed until Ctrl-C, in the tracker's own frame. With them
/// come rate, jitter and longest interval of the records, and lost and damaged records. If several sensors or tools
/// report, each has a line with its rate, validity and position; --sensor or --tool selects the probe. Without a record
/// of the probe, the exit code is 1.
#[derive(Debug, Parser)]
#[command(after_help = format!("{EXAMPLES}\n\n{ASCII_LINE_HELP}"))]
pub(crate) struct Args {
    /// Station file (TOML) with a [tracker]
    #[arg(conflicts_with_all = ["port", "address", "protocol", "baud"])]
    station: Option<PathBuf>,

    #[command(flatten)]
    tracker: TrackerArgs,

    /// Stop after this many seconds, 0.1..=86400
    #[arg(long, value_name = "S", allow_negative_numbers = true)]
    seconds: Option<f64>,

    /// Print JSON: the list, or a line every half second
    #[arg(long)]
    json: bool,
}

const EXAMPLES: &str = "\
Examples:
  insonify trackers                                          what is plugged in
  insonify trackers --port 0403:6001 --protocol liberty      poses of a LIBERTY behind an FTDI adapter
  insonify trackers --address 192.168.1.5:5000 --protocol ascii-line --seconds 5
  insonify trackers --address 192.168.1.5:18944 --protocol openigtlink --tool ProbeToTracker
  insonify trackers --address 0.0.0.0:4242 --protocol opentrack            datagrams of a phone or another PC
  insonify trackers configs/station.toml                     poses of a station's tracker";

/// Time between two printed lines.
const PERIOD: Duration = Duration::from_millis(500);

/// Runs the command.
pub(crate) fn run(args: &Args) -> Result<(), Failure> {
    let seconds = args.seconds.unwrap_or(f64::INFINITY);
    if !(0.1..=86_400.0).contains(&seconds) && args.seconds.is_some() {
        return Err(Failure::Input(anyhow!("--seconds is {seconds}; it must be in 0.1..=86400")));
    }
    match settings(args)? {
        Some(settings) => watch(&settings, seconds, args.json),
        None => list(args.json),
    }
}

fn settings(args: &Args) -> Result<Option<Settings>, Failure> {
    if let Some(path) = &args.station {
        let mut settings = tracker_args::of_station(&Station::load(path)?)?;
        args.tracker.choose_probe(&mut settings)?;
        return Ok(Some(settings));
    }
    args.tracker.over(Settings::default())
}

fn list(json: bool) -> Result<(), Failure> {
    let listed = Devices::list().context("cannot list the devices").other()?;
    if json {
        return output::json(&listed);
    }
    output::text(&listed)
}

/// Prints the tracker's data until Ctrl-C, the end of its recording, or for `seconds`.
fn watch(settings: &Settings, seconds: f64, json: bool) -> Result<(), Failure> {
    let (monitor, cancel) = (Monitor::default(), CancellationToken::new());
    let session = spawn(settings, Box::new(monitor.clone()), cancel.clone())?;
    if let Some(hint) = devices::hint_of(settings) {
        eprintln!("hint: {hint}");
    }
    let started = Instant::now();
    let runtime = tokio::runtime::Builder::new_current_thread().enable_all().build().other()?;
    let result: Result<(), Failure> = runtime.block_on(async {
        let mut interrupted = std::pin::pin!(tokio::signal::ctrl_c());
        loop {
            let left = (seconds - started.elapsed().as_secs_f64()).max(0.0);
            let period = Duration::try_from_secs_f64(left).unwrap_or(PERIOD).min(PERIOD);
            let last = tokio::select! {
                signal = &mut interrupted => {
                    signal.context("cannot wait for Ctrl-C").other()?;
                    true
                }
                () = tokio::time::sleep(period) => started.elapsed().as_secs_f64() >= seconds,
            };
            let report = monitor.report();
            print(&report, started.elapsed(), json)?;
            if last || report.state == SessionState::Ended {
                return Ok(());
            }
        }
    });
    cancel.cancel();
    let total = session.join();
    result?;
    // Damage in the last second is known only when the session ends.
    monitor.report().news(usize::MAX).for_each(|news| eprintln!("tracker: {news}"));
    if !json {
        let other_senders = match total.other_sender {
            0 => String::new(),
            count => format!(", {count} datagrams of other senders"),
        };
        let needle = match total.needle_records {
            0 => String::new(),
            count => format!(" {count} of the needle,"),
        };
        output::line(format!(
            "{} records in {} bytes; {} damaged pieces,{needle} {} of other sensors{other_senders}, {} connections, {} silences",
            total.records, total.bytes, total.decode_errors, total.other_sensor, total.connections, total.silences
        ))?;
    }
    verdict(settings, &total)
}

/// Fails if the probe sent no record, or if several sensors sent records and none is chosen.
fn verdict(settings: &Settings, total: &SessionSummary) -> Result<(), Failure> {
    if total.undecided {
        let event = TrackerEvent::Undecided { heard: total.heard.clone() };
        return Err(Failure::Other(anyhow!("{settings}: {event}")));
    }
    if total.records > 0 {
        return Ok(());
    }
    let why = match (&total.cause, total.connections) {
        (Some(cause), _) => cause.clone(),
        (None, 0) => "it could not be opened".to_owned(),
        (None, _) if !total.heard.is_empty() => {
            format!("only others are heard: {}", SensorName::listed(&total.heard))
        }
        (None, _) => format!("{} bytes arrived, {} damaged pieces", total.bytes, total.decode_errors),
    };
    Err(Failure::Other(anyhow!("no record of the probe from {settings}: {why}")))
}

fn print(report: &TrackerReport, time: Duration, json: bool) -> Result<(), Failure> {
    let line = ReportLine::new(report, time.as_secs_f64());
    if json {
        return output::line(serde_json::to_string(&line).other()?);
    }
    report.news(usize::MAX).for_each(|news| eprintln!("tracker: {news}"));
    output::line(line)
}
