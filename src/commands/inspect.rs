//! `insonify inspect`: shows the contents of a recording.

use std::path::PathBuf;

use clap::Parser;
use insonify::recording::{Inspection, RecordingReader, read_tools};

use super::{Failure, output};

/// Summarise a recording: duration, rate, jitter, gaps, damage, events and settings.
///
/// The `.part` file of a recording that was not finished can be inspected too.
#[derive(Debug, Parser)]
#[command(after_help = "Examples:\n  \
                        insonify inspect assets/exams/obstetric_sweep.mcap\n  \
                        insonify inspect session.mcap --station > station.toml   the station it was made with")]
pub(crate) struct Args {
    /// Recording (.mcap)
    recording: PathBuf,

    /// Print as JSON
    #[arg(long)]
    json: bool,

    /// Print only the station file in the recording; recordings by `insonify run` and `insonify record` hold one
    #[arg(long, conflicts_with = "json")]
    station: bool,
}

/// Runs the command.
pub(crate) fn run(args: &Args) -> Result<(), Failure> {
    let tools = read_tools(RecordingReader::open(&args.recording)?)?;
    if args.station {
        let station = tools.summary.settings.as_ref().map(|settings| settings.station.trim_end());
        let path = args.recording.display();
        let none = || {
            Failure::Input(anyhow::anyhow!(
                "{path} holds no station file; only recordings by `insonify run` and `insonify record` do"
            ))
        };
        return output::line(station.filter(|text| !text.is_empty()).ok_or_else(none)?);
    }
    let inspection = Inspection::new(&args.recording, &tools);
    if args.json { output::json(&inspection) } else { output::text(&inspection) }
}
