//! `insonify record`: a tracker's bytes become a recording.

use std::fmt;
use std::io::{ErrorKind, Read};
use std::net::TcpStream;
use std::path::PathBuf;
use std::str::FromStr;
use std::thread;
use std::time::Duration;

use anyhow::{Context, anyhow};
use clap::Parser;
use insonify::sink::create_dir;
use insonify::station::Station;
use insonify::tracker::recording::{
    Event, QueueLimits, Recorded, Recorder, RecorderHandle, RecordingInfo, RecordingWriter, SessionSettings,
};
use insonify::tracker::{Protocol, host_time_ns};
use serde::Serialize;
use tokio::sync::oneshot;

use super::{Classify, Failure, output};

/// How often a recording that has nothing to read looks whether the disk still takes it.
const LOOK: Duration = Duration::from_millis(250);

/// How long a stream may wait for a slow disk.
const PATIENCE: Duration = Duration::from_secs(10);

/// Longest piece that is read at once, bytes.
const PIECE: usize = 4096;

/// Record a tracker's bytes as they come, until the stream ends, the duration is over, or Ctrl-C.
///
/// The recording keeps the station file, so that it can be replayed without it. While it runs its file is called
/// FILE.part; after a kill that holds all but the last second.
#[derive(Debug, Parser)]
#[command(after_help = "Examples:\n  \
                        insonify record configs/obstetric.toml --from tcp:192.168.1.20:4000 --out session.mcap\n  \
                        cat /dev/ttyACM0 | insonify record configs/obstetric.toml --duration 60 --out session.mcap")]
pub(crate) struct Args {
    /// Station file (TOML); `insonify station-keys` lists its keys
    station: PathBuf,

    /// Recording to write (.mcap)
    #[arg(long, value_name = "FILE")]
    out: PathBuf,

    /// Where the bytes come from: stdin, or tcp:HOST:PORT
    #[arg(long, value_name = "SOURCE", default_value = "stdin")]
    from: Source,

    /// Wire format of the bytes
    #[arg(long, value_name = "PROTOCOL", default_value = "ascii-line")]
    protocol: Protocol,

    /// Sensor whose poses count, where the tracker has several [default: the first that reports]
    #[arg(long, value_name = "N")]
    sensor: Option<u16>,

    /// End after so many seconds
    #[arg(long, value_name = "S")]
    duration: Option<f64>,

    /// Replace FILE if it is there
    #[arg(long)]
    force: bool,

    /// Print what was recorded as JSON
    #[arg(long)]
    json: bool,
}

/// Where bytes come from.
#[derive(Debug, Clone, PartialEq, Eq)]
enum Source {
    Stdin,
    Tcp(String),
}

impl FromStr for Source {
    type Err = String;

    fn from_str(text: &str) -> Result<Self, String> {
        match text.split_once(':') {
            None if text == "stdin" => Ok(Self::Stdin),
            Some(("tcp", address)) if address.contains(':') => Ok(Self::Tcp(address.to_owned())),
            _ => Err("expected stdin or tcp:HOST:PORT".to_owned()),
        }
    }
}

impl fmt::Display for Source {
    fn fmt(&self, f: &mut fmt::Formatter<'_>) -> fmt::Result {
        match self {
            Self::Stdin => f.write_str("stdin"),
            Self::Tcp(address) => write!(f, "tcp:{address}"),
        }
    }
}

impl Source {
    fn open(&self) -> Result<Box<dyn Read + Send>, Failure> {
        match self {
            Self::Stdin => Ok(Box::new(std::io::stdin())),
            Self::Tcp(address) => {
                let stream = TcpStream::connect(address).with_context(|| format!("cannot connect to {address}"));
                Ok(Box::new(stream.input()?))
            }
        }
    }
}

#[derive(Serialize)]
struct Report<'a> {
    path: &'a PathBuf,
    messages: u64,
    bytes: u64,
    events: u64,
}

/// Runs the command.
pub(crate) fn run(args: &Args) -> Result<(), Failure> {
    let duration = args.duration.map(seconds).transpose()?;
    let station = Station::load(&args.station)?;
    let text = std::fs::read_to_string(&args.station).context("cannot read the station file again").input()?;
    if args.out.exists() && !args.force {
        return Err(Failure::Input(anyhow!("{} is there already; --force replaces it", args.out.display())));
    }
    if let Some(directory) = args.out.parent().filter(|d| !d.as_os_str().is_empty()) {
        create_dir(directory)?;
    }
    let source = args.from.open()?;
    let info = RecordingInfo {
        protocol: args.protocol,
        device: args.from.to_string(),
        scene: args.station.display().to_string(),
        start_time_ns: host_time_ns(),
        sensor: args.sensor,
    };
    let mut writer = RecordingWriter::create(&args.out, &info)?;
    writer.settings(&SessionSettings {
        version: env!("CARGO_PKG_VERSION").to_owned(),
        seed: station.settings.quality.seed,
        adapter: String::new(),
        station_path: args.station.display().to_string(),
        station: text,
    })?;
    let recorder = Recorder::start(writer, QueueLimits::default()).other()?;
    let handle = recorder.handle();
    let ended = listen(source, handle.clone())?;
    eprintln!("recording {} to {}; Ctrl-C ends it", args.from, args.out.display());
    let reason = wait(duration, ended, &handle)?;
    eprintln!("{reason}");
    handle.event(Event::new(host_time_ns(), "end").with(reason));
    finish(args, recorder.finish())
}

fn finish(args: &Args, recorded: Recorded) -> Result<(), Failure> {
    if let Some(failure) = recorded.failure {
        return Err(Failure::Other(anyhow!("{failure}; what was written before can be replayed")));
    }
    let Recorded { messages, bytes, events, .. } = recorded;
    if args.json {
        return output::json(&Report { path: &args.out, messages, bytes, events });
    }
    output::line(format!("{bytes} bytes in {messages} messages"))?;
    output::line(args.out.display())
}

/// Reads `source` on a thread of its own, which is left behind if it never ends; sends why it ended.
fn listen(mut source: Box<dyn Read + Send>, handle: RecorderHandle) -> Result<oneshot::Receiver<String>, Failure> {
    let (end, ended) = oneshot::channel();
    let read = move || {
        let mut piece = [0; PIECE];
        let reason = loop {
            match source.read(&mut piece) {
                Ok(0) => break "the stream ended".to_owned(),
                Ok(read) => handle.raw_within(host_time_ns(), &piece[..read], PATIENCE),
                Err(error) if error.kind() == ErrorKind::Interrupted => {}
                Err(error) => break format!("the stream broke: {error}"),
            }
        };
        // Nobody waits any more where the recording has ended otherwise.
        let _ = end.send(reason);
    };
    thread::Builder::new().name("tracker".to_owned()).spawn(read).other()?;
    Ok(ended)
}

/// Waits for whatever ends the recording, and says what it was.
fn wait(
    duration: Option<Duration>,
    ended: oneshot::Receiver<String>,
    handle: &RecorderHandle,
) -> Result<String, Failure> {
    let runtime = tokio::runtime::Builder::new_current_thread().enable_all().build().other()?;
    let over = async {
        match duration {
            Some(duration) => tokio::time::sleep(duration).await,
            None => std::future::pending().await,
        }
    };
    let failed = async {
        while handle.failure().is_none() {
            tokio::time::sleep(LOOK).await;
        }
    };
    runtime.block_on(async {
        tokio::select! {
            reason = ended => Ok(reason.unwrap_or_else(|_| "the reader stopped".to_owned())),
            () = over => Ok("the duration was over".to_owned()),
            () = failed => Ok("the disk does not take it".to_owned()),
            stopped = stop_signal() => stopped.map(|()| "it was stopped".to_owned()).other(),
        }
    })
}

/// Ctrl-C, or the signal that a service manager sends.
async fn stop_signal() -> std::io::Result<()> {
    #[cfg(unix)]
    {
        let mut terminate = tokio::signal::unix::signal(tokio::signal::unix::SignalKind::terminate())?;
        tokio::select! {
            stopped = tokio::signal::ctrl_c() => stopped,
            _ = terminate.recv() => Ok(()),
        }
    }
    #[cfg(not(unix))]
    tokio::signal::ctrl_c().await
}

fn seconds(seconds: f64) -> Result<Duration, Failure> {
    match Duration::try_from_secs_f64(seconds) {
        Ok(duration) if !duration.is_zero() => Ok(duration),
        _ => Err(Failure::Input(anyhow!("--duration is {seconds}; it must be a number of seconds above 0"))),
    }
}

#[cfg(test)]
mod tests {
    use super::*;

    #[test]
    fn sources_are_understood() {
        for text in ["stdin", "tcp:localhost:4000", "tcp:[::1]:4000"] {
            assert_eq!(text.parse::<Source>().unwrap().to_string(), text);
        }
        for wrong in ["", "tcp", "tcp:", "tcp:4000", "udp:localhost:4000", "Stdin"] {
            assert!(wrong.parse::<Source>().is_err(), "{wrong}");
        }
    }
}
