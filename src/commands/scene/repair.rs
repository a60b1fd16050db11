//! `insonify scene repair`: repairs the surfaces of a scene.

use std::path::PathBuf;

use anyhow::anyhow;
use clap::Parser;
use insonify::anatomy::export::write_scene_glb;
use insonify::files::Outputs;
use insonify::names::counted;
use insonify::segmentation::repair::{RepairSettings, SurfaceRepair};
use insonify::segmentation::repair_scene::repair_scene;
use serde::Serialize;

use super::super::progress::Progress;
use super::super::{Failure, output};

/// Options of a repair.
#[derive(Debug, clap::Args)]
pub(super) struct RepairArgs {
    /// Largest distance by which a repair may move the surface, mm, 0..=10; checked afterwards
    #[arg(long, value_name = "MM", default_value_t = RepairSettings::default().max_move_mm, value_parser = farthest, allow_negative_numbers = true)]
    pub(super) max_move_mm: f64,
}

fn farthest(text: &str) -> Result<f64, String> {
    let value = text.parse().ok().filter(|mm| (0.0..=10.0).contains(mm));
    value.ok_or_else(|| "expected mm, 0..=10".to_owned())
}

/// Repair the surfaces of a scene, and report the changes to each.
///
/// Inward-facing surfaces are turned, doubled sheets and fragments removed. Surfaces that are open or cross themselves are made
/// anew from the region that they enclose, with flat caps at cuts and fills over holes. Remaining defects are listed; `insonify doctor` checks
/// everything else.
#[derive(Debug, Parser)]
#[command(after_help = "Example:\n  insonify scene repair scene.glb --out mended.glb")]
pub(crate) struct Args {
    /// Scene (.glb, .gltf)
    scene: PathBuf,

    /// Scene to write (.glb)
    #[arg(long, value_name = "FILE")]
    out: PathBuf,

    /// Overwrite FILE
    #[arg(long)]
    force: bool,

    #[command(flatten)]
    repair: RepairArgs,

    /// Print the report as JSON
    #[arg(long)]
    json: bool,
}

#[derive(Serialize)]
struct RepairedScene<'a> {
    path: &'a PathBuf,
    surfaces: &'a [SurfaceRepair],
}

/// Runs the command.
pub(crate) fn run(args: &Args) -> Result<(), Failure> {
    if args.out.extension().is_none_or(|extension| extension != "glb") {
        return Err(Failure::Input(anyhow!("--out is {}; a scene's name ends in .glb", args.out.display())));
    }
    Outputs::apart_from([&args.scene]).file("--out", &args.out, args.force)?;
    let progress = Progress::new("repair", 0);
    let settings = RepairSettings { max_move_mm: args.repair.max_move_mm, ..RepairSettings::default() };
    let (surfaces, reports, extras) = repair_scene(&args.scene, &settings, &|done, all| progress.set(done, all))?;
    drop(progress);
    if surfaces.is_empty() {
        return Err(Failure::Input(anyhow!("{}: no surface encloses a volume", args.scene.display())));
    }
    output::make_parent(&args.out)?;
    write_scene_glb(&surfaces, &extras, &args.out)?;
    if args.json {
        return output::json(&RepairedScene { path: &args.out, surfaces: &reports });
    }
    for report in &reports {
        output::line(report)?;
    }
    let left = reports.iter().filter(|report| !report.is_mended()).count();
    if left > 0 {
        output::line(format!("{} not wholly mended", counted(left, "surface")))?;
    }
    output::line(args.out.display())
}
