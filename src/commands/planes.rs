//! `insonify planes`: the standard planes of a station's scene.

use std::path::PathBuf;

use clap::Parser;
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
    let head = format!("{:12} {:6} {:>7} {:>9} {:>9}  measured", "plane", "view", "angle", "distance", "depth");
    output::line(head)?;
    for plane in &planes.planes {
        let t = &plane.tolerances;
        for view in &plane.views {
            let depth_mm = view.pose.map(|pose| pose.position_mm.distance(view.centre_mm));
            let depth = depth_mm.map_or_else(|| "no skin".to_owned(), |mm| format!("{mm:.0} mm"));
            let calipers: Vec<_> = view
                .calipers
                .iter()
                .map(|c| c.true_mm.map_or_else(|| c.name.clone(), |mm| format!("{} {mm:.1} mm", c.name)))
                .collect();
            output::line(format!(
                "{:12} {:6} {:>5.0}° {:>6.0} mm {depth:>9}  {}",
                plane.name,
                view.name,
                t.angle_deg,
                t.distance_mm,
                calipers.join(", ")
            ))?;
        }
    }
    output::line("")?;
    planes.planes.iter().try_for_each(|p| output::line(format!("{:12} {} ({})", p.name, p.title, p.source)))
}
