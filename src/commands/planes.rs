//! `insonify planes`: lists the standard planes of a station's scene.

use std::path::PathBuf;

use clap::Parser;
use insonify::exam::score::HOLD_S;
use insonify::station::{PlaneScene, Station};

use super::{Failure, output};

/// List the standard planes of a station's scene: their positions, tolerances and measurements.
///
/// The planes of the obstetric phantom are built in. Other scenes have them in a file next to the glTF file:
/// SCENE.planes.json for SCENE.glb. Planes refer to the scene at rest. --json prints such a file as a starting point.
#[derive(Debug, Parser)]
#[command(after_help = "Examples:\n  \
                        insonify planes configs/obstetric.toml\n  \
                        insonify planes configs/obstetric.toml --json > my_scene.planes.json\n\n\
                        In the file, lengths are in mm and in the scene's frame (glTF metres x 1000). A plane has one \
                        or more views, any of which will do. Each has a centre, a normal, the direction that lies \
                        across the beam (lateral), and the direction from the centre to the probe (to_probe). A \
                        caliper is a line (2 points) or an ellipse (4: the ends of both axes) on the border of a \
                        surface, named as its glTF node; without true_mm the surface itself is measured.")]
pub(crate) struct Args {
    /// Station file (TOML); `insonify station-keys` lists its keys
    station: PathBuf,

    /// Print the planes in the format of SCENE.planes.json
    #[arg(long)]
    json: bool,
}

/// Runs the command.
pub(crate) fn run(args: &Args) -> Result<(), Failure> {
    let station = Station::load(&args.station)?;
    let planes = PlaneScene::open(&station)?.planes;
    if args.json {
        return output::json(&planes);
    }
    output::text(&planes)?;
    output::line(format!(
        "\na plane is found when all of that holds for {HOLD_S} s, with the probe on the skin; points: docs/commands.md"
    ))
}
