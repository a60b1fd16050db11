//! Poses recorded with a station's tracker while the user follows instructions.

use std::io::BufRead;
use std::path::{Path, PathBuf};
use std::time::{Duration, Instant};

use anyhow::{Context, anyhow};
use insonify::pose::Pose;
use insonify::recording::spawn;
use insonify::station::Station;
use insonify::tracker::{ProbeSensor, Settings, pose_tap};
use tokio_util::sync::CancellationToken;

use super::super::{Classify, Failure, tracker_args};
use super::calibration_file;

/// Time without a pose after which the tracker counts as lost.
const SILENCE: Duration = Duration::from_secs(2);

/// Recorder of poses for a number of seconds; a reason if no pose came.
pub(super) type Recorder<'a> = dyn FnMut(u64) -> Result<Vec<Pose>, String> + 'a;

/// Options of a live tracker.
#[derive(Debug, clap::Args)]
pub(super) struct LiveArgs {
    /// Record the poses with the tracker of this station (TOML)
    #[arg(long, value_name = "STATION")]
    pub(super) tracker: Option<PathBuf>,

    /// Sensor of the tool [default: the station's]
    #[arg(long, requires = "tracker")]
    pub(super) sensor: Option<u16>,

    /// OpenIGTLink name of the tool [default: the station's]
    #[arg(long, value_name = "NAME", requires = "tracker", conflicts_with = "sensor")]
    pub(super) tool: Option<String>,
}

/// Motion that the user makes with a tool.
pub(super) struct Motion {
    /// Instruction, with the request to press Enter.
    pub(super) what: &'static str,
    /// Duration of the recording, s.
    pub(super) seconds: u64,
    /// Whether the tool is the needle, whose sensor is never the probe's.
    pub(super) of_needle: bool,
}

/// Settings of the station's tracker, with the given sensor or tool.
pub(super) fn settings(station: &Station, sensor: Option<u16>, tool: Option<&str>) -> Result<Settings, Failure> {
    let mut settings = tracker_args::of_station(station)?;
    settings.device.choose(sensor, tool.map(str::to_owned));
    Ok(settings)
}

/// Settings of the tracker of the station at `path` for the tool of `args`, and the calibration file to write: `out`,
/// else the station's.
///
/// Refuses a needle whose sensor is not named if the station's choice is the probe's.
pub(super) fn open(
    path: &Path,
    args: &LiveArgs,
    out: Option<&Path>,
    motion: &Motion,
) -> Result<(Settings, PathBuf), Failure> {
    let station = Station::load(path)?;
    let mut settings = settings(&station, args.sensor, args.tool.as_deref())?;
    settings.check_probe().input()?;
    let is_named = args.sensor.is_some() || args.tool.is_some();
    if motion.of_needle {
        let needle = settings.of_needle().filter(|_| !is_named);
        match (is_named, needle, settings.stream(None).sensor) {
            (false, Some(needle), _) => settings = needle,
            (false, None, Some(probe @ (ProbeSensor::Number(_) | ProbeSensor::Tool(_)))) => {
                let path = path.display();
                return Err(Failure::Input(anyhow!(
                    "{path}: {probe} is the probe's; name the needle's with --sensor N or --tool NAME (`insonify trackers {path}` lists what is heard)"
                )));
            }
            // The needle is the only tool of its calibration.
            _ => settings.device.needle = None,
        }
    }
    let out = calibration_file(&station, out, std::iter::empty())?;
    Ok((settings, out))
}

/// Runs `ask` with a recorder of the tracker's poses.
pub(super) fn recorded<T>(settings: &Settings, ask: impl FnOnce(&mut Recorder<'_>) -> T) -> Result<T, Failure> {
    let (tap, stream) = pose_tap();
    let cancel = CancellationToken::new();
    let session = spawn(settings, Box::new(tap), cancel.clone())?;
    let found = ask(&mut |seconds| {
        let end = Instant::now() + Duration::from_secs(seconds);
        let poses: Vec<Pose> = stream.poses(SILENCE).take_while(|_| Instant::now() < end).collect();
        if poses.is_empty() { Err(format!("no pose came; {stream}")) } else { Ok(poses) }
    });
    cancel.cancel();
    session.join();
    Ok(found)
}

/// Records a motion until `accept` takes its poses. Returns what `accept` made of them.
pub(super) fn motion<T>(
    settings: &Settings,
    motion: &Motion,
    accept: impl Fn(&[Pose]) -> Result<T, String>,
) -> Result<T, Failure> {
    recorded(settings, |record| {
        ask(motion, &mut std::io::stdin().lock(), |seconds| record(seconds).and_then(|poses| accept(&poses)))
    })?
}

/// Asks for the motion until `take` accepts it. The user answers with a line of `input`.
fn ask<T>(
    motion: &Motion,
    input: &mut impl BufRead,
    mut take: impl FnMut(u64) -> Result<T, String>,
) -> Result<T, Failure> {
    let Motion { what, seconds, .. } = motion;
    let mut trouble = String::new();
    eprintln!("{what} ({seconds} s); `quit` ends without a result");
    loop {
        let mut line = String::new();
        if input.read_line(&mut line).context("cannot read the input").other()? == 0 {
            return Err(Failure::Input(anyhow!("the input ended before the motion; nothing was written{trouble}")));
        }
        match line.trim() {
            "" => match take(*seconds) {
                Ok(found) => return Ok(found),
                Err(reason) => {
                    eprintln!("   {reason}; once more");
                    trouble = format!("; {reason}");
                }
            },
            "q" | "quit" => return Err(Failure::Input(anyhow!("ended before the motion; nothing was written"))),
            other => eprintln!("   `{other}` is none of Enter and quit"),
        }
    }
}

#[cfg(test)]
mod tests {
    use super::*;

    const MOTION: Motion = Motion { what: "tilt it", seconds: 3, of_needle: false };

    /// Result of `ask` for the answers `input`, if the motion succeeds at the given attempt.
    fn asked(input: &str, good: usize) -> Result<usize, String> {
        let mut attempts = 0;
        let take = |seconds| {
            assert_eq!(seconds, 3);
            attempts += 1;
            if attempts == good { Ok(attempts) } else { Err("it slipped".to_owned()) }
        };
        ask(&MOTION, &mut input.as_bytes(), take).map_err(|failure| match failure {
            Failure::Input(error) => error.to_string(),
            other => panic!("{other:?}"),
        })
    }

    #[test]
    fn a_motion_is_repeated_until_it_succeeds() {
        assert_eq!(asked("\n", 1), Ok(1));
        assert_eq!(asked("what\n\n\n\n", 3), Ok(3));
        assert_eq!(asked("", 1).unwrap_err(), "the input ended before the motion; nothing was written");
        assert!(asked("\n", 2).unwrap_err().ends_with("nothing was written; it slipped"));
        assert_eq!(asked("\nq\n\n", 2).unwrap_err(), "ended before the motion; nothing was written");
    }
}
