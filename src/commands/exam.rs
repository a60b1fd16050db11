//! `insonify exam`: the recorded exam of `assets/exams`, made anew.

use std::path::PathBuf;

use clap::Parser;
use insonify::anatomy::exam;
use insonify::sink::create_dir;
use serde::Serialize;

use super::{Failure, output};

/// Record a simulated exam over the obstetric phantom: a freehand sweep from view to view, as raw tracker bytes.
///
/// The same seed gives the same file, byte for byte. Key views are events in the recording.
#[derive(Debug, Parser)]
#[command(after_help = "Example (makes the recording that the demo plays):\n  \
                        insonify exam --out assets/exams/obstetric_sweep.mcap")]
pub(crate) struct Args {
    /// File to write (.mcap)
    #[arg(long, value_name = "FILE")]
    out: PathBuf,

    /// Seed of the hand's tremor, 0..=18446744073709551615
    #[arg(long, value_name = "N", default_value_t = exam::SEED, allow_negative_numbers = true)]
    seed: u64,

    /// Print what was recorded as JSON
    #[arg(long)]
    json: bool,
}

#[derive(Serialize)]
struct Report<'a> {
    path: &'a PathBuf,
    seed: u64,
    duration_s: u32,
    rate_hz: u32,
    key_frames: Vec<KeyFrame>,
}

#[derive(Serialize)]
struct KeyFrame {
    name: &'static str,
    time_s: f64,
}

/// Runs the command.
pub(crate) fn run(args: &Args) -> Result<(), Failure> {
    if let Some(directory) = args.out.parent().filter(|d| !d.as_os_str().is_empty()) {
        create_dir(directory)?;
    }
    exam::write(&args.out, args.seed)?;
    let key_frames = exam::KEY_FRAMES.map(|(name, time_s)| KeyFrame { name, time_s }).into();
    let (duration_s, rate_hz) = (exam::DURATION_S, exam::RATE_HZ);
    if args.json {
        return output::json(&Report { path: &args.out, seed: args.seed, duration_s, rate_hz, key_frames });
    }
    output::line(format!("{duration_s} s at {rate_hz} poses a second, seed {}", args.seed))?;
    key_frames.iter().try_for_each(|k| output::line(format!("{:6.1} s  {}", k.time_s, k.name)))?;
    output::line(args.out.display())
}
