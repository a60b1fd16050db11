//! `insonify trackers`: lists ports and devices, or prints a tracker's data.

use std::path::PathBuf;
use std::time::{Duration, Instant};

use anyhow::{Context, anyhow};
use clap::Parser;
use insonify::pose::Reading;
use insonify::recording::spawn;
use insonify::station::Station;
use insonify::tracker::devices::{self, HidDevice, SerialDevice};
use insonify::tracker::{Monitor, Report, SessionState, Settings};
use serde::Serialize;
use tokio_util::sync::CancellationToken;

use super::tracker_args::{self, TrackerArgs};
use super::{Classify, Failure, output};

/// List serial ports and HID devices, or print what a tracker says.
///
/// With a station file or --port or --address, live poses are printed until Ctrl-C: the rate of the records, the jitter
/// and the longest of the times between them, records lost and damaged, and the last pose in the tracker's own frame.
#[derive(Debug, Parser)]
#[command(after_help = AFTER_HELP)]
pub(crate) struct Args {
    /// Station file (TOML) with a [tracker]
    #[arg(conflicts_with_all = ["port", "address", "protocol", "baud", "sensor"])]
    station: Option<PathBuf>,

    #[command(flatten)]
    tracker: TrackerArgs,

    /// Stop after so many seconds, 0.1..=86400
    #[arg(long, value_name = "S", allow_negative_numbers = true)]
    seconds: Option<f64>,

    /// Print JSON: the list, or a line for each half second
    #[arg(long)]
    json: bool,
}

const AFTER_HELP: &str = "\
Examples:
  insonify trackers                                          what is plugged in
  insonify trackers --port 0403:6001 --protocol liberty      poses of a LIBERTY behind an FTDI adapter
  insonify trackers --address 192.168.1.5:5000 --protocol ascii-line --seconds 5
  insonify trackers configs/station.toml                     poses of a station's tracker";

/// Time between two lines.
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
        return Ok(Some(tracker_args::of_station(&Station::load(path)?)?));
    }
    args.tracker.over(Settings::default())
}

#[derive(Serialize)]
struct Listed {
    serial: Vec<SerialDevice>,
    hid: Vec<HidDevice>,
}

fn list(json: bool) -> Result<(), Failure> {
    #[cfg(feature = "serial")]
    let serial = devices::serial_ports().context("cannot list serial ports").other()?;
    #[cfg(not(feature = "serial"))]
    let serial = Vec::new();
    #[cfg(feature = "hid")]
    let hid = devices::hid_devices().context("cannot list HID devices").other()?;
    #[cfg(not(feature = "hid"))]
    let hid = Vec::new();
    let listed = Listed { serial, hid };
    if json {
        return output::json(&listed);
    }
    if listed.serial.is_empty() {
        output::line("no serial ports")?;
    }
    for port in &listed.serial {
        let usb = port.usb.as_ref();
        let name = usb.and_then(|usb| usb.name.as_deref()).unwrap_or("");
        output::line(format!(
            "serial  {:<16} {} {name}",
            port.path,
            usb.map(devices::UsbIdentity::id).unwrap_or_default()
        ))?;
        if let Some(by_id) = &port.by_id {
            output::line(format!("        {by_id}"))?;
        }
        if let Some(hint) = devices::latency_hint(port) {
            output::line(format!("        {hint}"))?;
        }
    }
    if listed.hid.is_empty() {
        output::line("no HID devices")?;
    }
    for device in &listed.hid {
        let puck = if device.space_mouse { " (a SpaceMouse)" } else { "" };
        let name = device.usb.name.as_deref().unwrap_or("");
        output::line(format!("hid     {:<16} {} {name}{puck}", device.path, device.usb.id()))?;
    }
    Ok(())
}

/// A report as one line of JSON.
#[derive(Serialize)]
struct Line {
    time_s: f64,
    state: &'static str,
    records: u64,
    rate_hz: Option<f64>,
    jitter_ms: Option<f64>,
    longest_ms: Option<f64>,
    missing: u64,
    reversals: u64,
    decode_errors: u64,
    sensor: Option<u16>,
    buttons: Option<u32>,
    position_mm: Option<[f64; 3]>,
    /// w, x, y, z.
    quaternion: Option<[f64; 4]>,
    /// Along x, y, z, then about them, −1..=1.
    rates: Option<[f64; 6]>,
    events: Vec<String>,
}

impl Line {
    fn new(report: &Report, time_s: f64) -> Self {
        // An old pose must not look current.
        let last = report.last.as_ref().filter(|_| report.records > 0);
        let (mut position_mm, mut quaternion, mut rates) = (None, None, None);
        match last.map(|record| record.reading) {
            Some(Reading::Pose(pose)) => {
                let [x, y, z, qw, qx, qy, qz] = pose.components();
                (position_mm, quaternion) = (Some([x, y, z]), Some([qw, qx, qy, qz]));
            }
            Some(Reading::Orientation(q)) => quaternion = Some([q.w, q.x, q.y, q.z]),
            Some(Reading::Rates { translation: t, rotation: r }) => rates = Some([t.x, t.y, t.z, r.x, r.y, r.z]),
            Some(Reading::OutOfView) | None => {}
        }
        Self {
            time_s,
            state: report.state.name(),
            records: report.records,
            rate_hz: report.rate_hz,
            jitter_ms: report.jitter_ms,
            longest_ms: report.longest_ms,
            missing: report.missing,
            reversals: report.reversals,
            decode_errors: report.decode_errors,
            sensor: last.map(|record| record.sensor),
            buttons: last.map(|record| record.buttons),
            position_mm,
            quaternion,
            rates,
            events: report.events.clone(),
        }
    }

    fn for_people(&self) -> String {
        let number = |value: Option<f64>| value.map_or_else(|| "-".to_owned(), |value| format!("{value:.1}"));
        let numbers = |values: &[f64], decimals: usize| {
            values.iter().map(|v| format!("{v:9.decimals$}")).collect::<Vec<_>>().join("")
        };
        let mut text = format!(
            "{:>7.1} s  {:<12} {:>6} Hz  jitter {:>5} ms  longest {:>6} ms  lost {}  damaged {}",
            self.time_s,
            self.state,
            number(self.rate_hz),
            number(self.jitter_ms),
            number(self.longest_ms),
            self.missing,
            self.decode_errors,
        );
        if let Some(position) = &self.position_mm {
            text += &format!("  mm {}", numbers(position, 2));
        }
        if let Some(quaternion) = &self.quaternion {
            text += &format!("  q {}", numbers(quaternion, 4));
        }
        if let Some(rates) = &self.rates {
            text += &format!("  rates {}", numbers(rates, 3));
        }
        if self.sensor.is_some() && self.position_mm.is_none() && self.quaternion.is_none() && self.rates.is_none() {
            text += "  out of view";
        }
        text
    }
}

/// Prints the tracker's data until Ctrl-C, the end of its recording, or for `seconds`.
fn watch(settings: &Settings, seconds: f64, json: bool) -> Result<(), Failure> {
    let (monitor, cancel) = (Monitor::default(), CancellationToken::new());
    let session = spawn(settings, Box::new(monitor.clone()), cancel.clone())?;
    hint(settings);
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
    if !json {
        output::line(format!(
            "{} records in {} bytes; {} damaged pieces, {} of other sensors, {} connections, {} silences",
            total.records, total.bytes, total.decode_errors, total.other_sensor, total.connections, total.silences
        ))?;
    }
    Ok(())
}

fn print(report: &Report, time: Duration, json: bool) -> Result<(), Failure> {
    let line = Line::new(report, time.as_secs_f64());
    if json {
        return output::line(serde_json::to_string(&line).other()?);
    }
    for event in &line.events {
        eprintln!("tracker: {event}");
    }
    if report.events_dropped > 0 {
        eprintln!("tracker: and {} more", report.events_dropped);
    }
    output::line(line.for_people())
}

/// Prints a hint if a setting of the serial adapter adds latency.
fn hint(settings: &Settings) {
    #[cfg(feature = "serial")]
    if let insonify::tracker::Transport::Serial { port, .. } = &settings.transport
        && let Ok(ports) = devices::serial_ports()
    {
        let used = |device: &&SerialDevice| match port {
            insonify::tracker::PortName::Path(path) => device.path == *path || device.by_id.as_deref() == Some(path),
            usb => device.usb.as_ref().is_some_and(|u| usb.is(u.vendor, u.product, u.serial.as_deref())),
        };
        if let Some(hint) = ports.iter().find(used).and_then(devices::latency_hint) {
            eprintln!("hint: {hint}");
        }
    }
    #[cfg(not(feature = "serial"))]
    let _ = settings;
}
