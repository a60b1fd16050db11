//! `insonify import`: converts tracked sequences of other programs into recordings.

use std::path::{Path, PathBuf};

use clap::Parser;
use insonify::files::Outputs;
use insonify::recording::interchange::{Imported, read_rows, write_recording};
use serde::Serialize;

use super::{Failure, input, output};

/// Make a recording of a PLUS sequence (.mha, .igs.mha) or of a table (.csv, .tsv).
///
/// Poses are read as scene_from_probe: the sequence's tracker frame becomes the scene's frame. On playback, a station's
/// calibration is not applied to them. Neither kind of file holds planes, measurements or texts of a session; a
/// sequence holds no events either.
#[derive(Debug, Parser)]
#[command(after_help = AFTER_HELP)]
pub(crate) struct Args {
    /// File to import (.mha or .csv)
    file: PathBuf,

    /// Recording to write (.mcap)
    #[arg(long, value_name = "FILE")]
    out: PathBuf,

    /// Replace the recording if it is there
    #[arg(long)]
    force: bool,

    /// Transform of a sequence to take
    #[arg(long, value_name = "NAME", default_value = "ProbeToTrackerTransform")]
    transform: String,

    /// Print what was imported as JSON
    #[arg(long)]
    json: bool,
}

const AFTER_HELP: &str = "\
Columns of a table, in any order, named in its first line:
  time_s               seconds from any origin; must not fall
  x_mm, y_mm, z_mm     centre of the transducer's face
  qw, qx, qy, qz       unit quaternion that turns probe axes into the scene's
  status               optional: ok or empty, or invalid for a row without a pose
  event                optional: name of something that happened then
Other units are time_ms, x_cm, x_m, x_in. Fields are separated by commas, semicolons or tabs; numbers have a decimal
point. A row whose pose is empty, NaN or zero throughout has none. A column of another name is refused.

Examples:
  insonify import sweep.igs.mha --out sweep.mcap
  insonify import sweep.igs.mha --transform ProbeToReferenceTransform --out sweep.mcap
  insonify import poses.csv --out poses.mcap";

#[derive(Serialize)]
struct ImportedRecording<'a> {
    path: &'a PathBuf,
    #[serde(flatten)]
    imported: Imported,
}

/// Runs the command.
pub(crate) fn run(args: &Args) -> Result<(), Failure> {
    Outputs::apart_from([&args.file]).file("--out", &args.out, args.force)?;
    let rows = read_rows(&args.file, &args.transform)?;
    output::make_parent(&args.out)?;
    let imported = write_recording(&rows, &args.file, &args.out)?;
    if args.json {
        return output::json(&ImportedRecording { path: &args.out, imported });
    }
    output::line(format!("{} poses over {:.1} s, {} events", imported.poses, imported.duration_s, imported.events))?;
    if imported.without_pose > 0 {
        output::line(format!("{} rows without a pose became gaps", imported.without_pose))?;
    }
    if is_sequence(&args.file) {
        output::line(format!("not in the recording: {}", input::NOT_IN_SEQUENCES))?;
    }
    output::line(args.out.display())
}

/// Whether `path` names a tracked sequence; otherwise it is a table.
fn is_sequence(path: &Path) -> bool {
    path.extension().is_some_and(|extension| ["mha", "mhd"].iter().any(|known| extension.eq_ignore_ascii_case(known)))
}
