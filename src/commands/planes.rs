//! `insonify planes`: lists the standard planes of a station's scene.

use std::path::PathBuf;

use clap::Parser;
use insonify::exam::score::HOLD_S;
use insonify::station::{PlaneScene, Station};

use super::{Failure, output};

/// List the standard planes of a station's scene: where they are, how near counts, and what is measured there.
///
/// The obstetric phantom knows its planes. Any other scene brings them in a file beside its glTF file: SCENE.glb has
/// SCENE.planes.json. Planes are those of the scene at rest. --json prints a whole such file, to start from.
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

    /// Print the planes as the file beside a scene has them
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
