//! `insonify view`: draws a scene with the probe in it.

use std::path::PathBuf;
use std::time::Instant;

use anyhow::anyhow;
use clap::Parser;
use insonify::anatomy::{Scene, TissueTable, import};
use insonify::files::Outputs;
use insonify::pose::Pose;
use insonify::render::{Frame, Renderer};
use insonify::report::scene_view::{
    BmodeImage, Cut, Direction, Fan, Opacity, Orbit, PIXELS_MAX, PictureSettings, SceneView, Selection, ViewError,
};
use insonify::sink::png;
use insonify::station::Station;
use insonify::transducer::Probe;
use serde::Serialize;

use super::backend::BackendArgs;
use super::{Classify, Failure, input, output, session};

/// Picture a scene with the probe's fan in it, as a PNG: shaded surfaces in the colours of their tissues.
///
/// Needs no GPU, except for --bmode. Fat and soft tissue, and around a fetus also muscle, are transparent, or hidden
/// except in sections. --opacity shows them.
#[derive(Debug, Parser)]
#[command(after_help = AFTER_HELP)]
pub(crate) struct Args {
    /// Scene (.glb, .gltf) or station file (.toml)
    scene: PathBuf,

    /// Pose of the probe: x,y,z,qw,qx,qy,qz [default: the station's; a scene alone has none]
    #[arg(long, value_name = "POSE", allow_hyphen_values = true)]
    pose: Option<Pose>,

    #[command(flatten)]
    backend: BackendArgs,

    /// File to write
    #[arg(long, value_name = "FILE", default_value = "out/view.png")]
    out: PathBuf,

    /// Viewing direction: fan, probe, front, back, left, right, top, bottom, or anterior, posterior, cranial, caudal [default: fan; front without a probe]
    #[arg(long, value_name = "DIRECTION")]
    from: Option<Direction>,

    /// Turn about the scene: azimuth,elevation in degrees [default: 0,0 with --from, else 30,20]
    #[arg(long, value_name = "AZ,EL", allow_hyphen_values = true)]
    orbit: Option<Orbit>,

    /// Hide surfaces, by the names of surfaces, tissues or layers
    #[arg(long, value_name = "NAME", num_args = 1..)]
    hide: Vec<String>,

    /// Show only these surfaces, by the names of surfaces, tissues or layers
    #[arg(long, value_name = "NAME", num_args = 1..)]
    only: Vec<String>,

    /// Opacity of surfaces, by their names, their tissues' or their layers', percent: skin, fat, muscle, soft_tissue, bones, organs, vessels, uterus, placenta, fetus, fetal_organs, fetal_bones
    #[arg(long, value_name = "NAME=PERCENT", num_args = 1..)]
    opacity: Vec<Opacity>,

    /// Remove everything in front of a plane: fan, or x=MM, y=MM, z=MM
    #[arg(long, value_name = "PLANE", allow_hyphen_values = true)]
    cut: Option<Cut>,

    /// Size, pixels: each side 64..=8192, at most 16777216 in all
    #[arg(long, value_name = "WxH", default_value = "1280x960", value_parser = size)]
    size: (u32, u32),

    /// Four views in one picture: front, side, top and onto the fan
    #[arg(long, conflicts_with_all = ["from", "orbit"])]
    sheet: bool,

    /// Lay the B-mode image into the fan; needs a station and a GPU driver
    #[arg(long)]
    bmode: bool,

    /// Print what was made as JSON
    #[arg(long)]
    json: bool,
}

const AFTER_HELP: &str = "\
Examples:
  insonify view configs/gallbladder_stones.toml --cut fan --bmode
  insonify view configs/obstetric.toml --only fetus fetal_bones --orbit 40,10 --out out/fetus.png
  insonify view configs/obstetric.toml --opacity muscle=30 uterus=5
  insonify view scene.glb --pose 0,0,0,1,0,0,0 --sheet";

#[derive(Serialize)]
struct WrittenPicture {
    path: PathBuf,
    width: u32,
    height: u32,
    surfaces: usize,
    triangles: usize,
    picture_ms: f64,
}

fn size(text: &str) -> Result<(u32, u32), String> {
    let wrong = || {
        format!("expected WIDTHxHEIGHT in pixels, each 64..=8192 and at most {PIXELS_MAX} in all, for example 1280x960")
    };
    let sides = 64..=8192;
    let fits = |&(width, height): &(u32, u32)| {
        sides.contains(&width) && sides.contains(&height) && width * height <= PIXELS_MAX
    };
    input::product(text).filter(fits).ok_or_else(wrong)
}

/// Runs the command.
pub(crate) fn run(args: &Args) -> Result<(), Failure> {
    let (scene, station) = load(args)?;
    let read = station.as_ref().map_or_else(|| import::files_of(&args.scene), Station::files);
    Outputs::apart_from(read).replaced("--out", &args.out)?;
    let selection = Selection::of(&scene, &args.only, &args.hide).input()?;
    let selection = selection.with_opacities(&scene, &args.opacity).input()?;
    let pose = args.pose.or(station.as_ref().and_then(|station| station.default_pose));
    let probe = station.as_ref().map_or_else(Probe::default, |station| station.probe);
    let image = if args.bmode { Some(bmode(args, &scene, station.as_ref(), pose)?) } else { None };
    let fan = pose.map(|scene_from_probe| Fan { scene_from_probe, probe, image });
    let axes = station.as_ref().map_or(scene.axes, |station| station.axes(&scene));

    let fallback = if fan.is_some() { Direction::Fan } else { Direction::Front };
    let turned = Orbit { azimuth_deg: 30.0, elevation_deg: 20.0 };
    let orbit = args.orbit.unwrap_or(if args.from.is_some() { Orbit::default() } else { turned });
    let (width, height) = args.size;
    let settings = PictureSettings { width, height, from: args.from.unwrap_or(fallback), orbit, cut: args.cut };
    let begun = Instant::now();
    let view = SceneView::new(&scene, &selection, fan, axes);
    let picture = if args.sheet { view.sheet(&settings) } else { view.picture(&settings) };
    let picture = picture.input()?;
    let picture_ms = begun.elapsed().as_secs_f64() * 1e3;
    png::write_rgb(&args.out, picture.width, picture.height, &picture.rgb)?;
    let (surfaces, triangles) = (scene.surfaces.len(), scene.triangle_count());
    if args.json {
        let path = args.out.clone();
        return output::json(&WrittenPicture { path, width, height, surfaces, triangles, picture_ms });
    }
    output::line(format!(
        "{surfaces} surfaces, {triangles} triangles, {width} x {height} pixels in {picture_ms:.0} ms"
    ))?;
    output::line(args.out.display())
}

/// Loads the scene, and the station if a station file is given.
fn load(args: &Args) -> Result<(Scene, Option<Station>), Failure> {
    if input::is_station(&args.scene) {
        let station = Station::load(&args.scene)?;
        return Ok((session::load_scene(&station)?, Some(station)));
    }
    let tissues = TissueTable::builtin().other()?;
    let background = tissues.index_of("gel").unwrap_or(0);
    Ok((import::load(&args.scene, &tissues, background).input()?, None))
}

/// Renders the B-mode image at the probe's pose.
fn bmode(args: &Args, scene: &Scene, station: Option<&Station>, pose: Option<Pose>) -> Result<BmodeImage, Failure> {
    let station = station.ok_or_else(|| {
        anyhow!("--bmode needs a station file, which has the probe and the image; {} is a scene", args.scene.display())
    });
    let station = station.input()?;
    let pose = pose.ok_or(ViewError::NoFan { what: "--bmode" }).input()?;
    session::warn_of_budget(station);
    let backend = args.backend.open(station.backend)?;
    let mut renderer = Renderer::new(&backend, scene, &station.probe, &station.settings)?;
    renderer.set_needle(station.standing_needle());
    let mut frame = Frame::default();
    renderer.render(&pose, &mut frame)?;
    Ok(BmodeImage { sector: *renderer.sector(), grey: frame.bmode })
}

#[cfg(test)]
mod tests {
    use super::*;

    #[test]
    fn sizes_are_two_numbers_of_pixels() {
        assert_eq!(size("1280x960"), Ok((1280, 960)));
        assert_eq!(size("4096x4096"), Ok((4096, 4096)));
        for wrong in ["8192x8192", "8192x2049", "1280", "63x100", "100x9000", "-1x100", "axb", ""] {
            assert!(size(wrong).is_err(), "{wrong}");
        }
    }
}
