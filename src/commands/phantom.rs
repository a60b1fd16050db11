//! `insonify phantom`: the obstetric phantom as a glTF file.

use std::path::PathBuf;

use clap::Parser;
use insonify::anatomy::export::write_glb;
use insonify::anatomy::phantom::{PhantomOptions, PhantomSurface, build};
use insonify::anatomy::planes;
use insonify::sink::write_json;
use serde::Serialize;

use super::output::thousands;
use super::progress::Progress;
use super::{Failure, output};

/// Make the obstetric phantom: a pregnant belly at 22 weeks, as closed surfaces in a .glb file.
///
/// Its standard planes go into a file beside it (.planes.json). The same scale gives the same files, byte for byte. At scale 1 the fetus has 400 000 triangles and the mother 275 000.
#[derive(Debug, Parser)]
#[command(after_help = "Example:\n  insonify phantom --out out/phantom.glb --scale 0.25")]
pub(crate) struct Args {
    /// File to write (.glb)
    #[arg(long, value_name = "FILE")]
    out: PathBuf,

    /// Number of triangles over that of the full phantom, 0.01..=20; refused where the finest parts would be lost (below about 0.18; the message says the least)
    #[arg(long, value_name = "S", default_value_t = 1.0, allow_negative_numbers = true)]
    scale: f64,

    /// Print the table of surfaces as JSON
    #[arg(long)]
    json: bool,
}

#[derive(Serialize)]
struct Row<'a> {
    name: &'a str,
    tissue: &'a str,
    priority: i32,
    triangles: usize,
    volume_ml: f64,
}

#[derive(Serialize)]
struct Report<'a> {
    path: &'a PathBuf,
    scale: f64,
    triangles: usize,
    surfaces: Vec<Row<'a>>,
}

fn row(surface: &PhantomSurface) -> Row<'_> {
    Row {
        name: &surface.name,
        tissue: &surface.tissue,
        priority: surface.priority,
        triangles: surface.mesh.triangles.len(),
        volume_ml: surface.mesh.signed_volume_mm3() * 1e-3,
    }
}

/// Runs the command.
pub(crate) fn run(args: &Args) -> Result<(), Failure> {
    let progress = Progress::new("phantom", 0);
    let surfaces = build(&PhantomOptions { scale: args.scale }, &|p| progress.set(p.done, p.total))?;
    drop(progress);
    if let Some(directory) = args.out.parent().filter(|d| !d.as_os_str().is_empty()) {
        insonify::sink::create_dir(directory)?;
    }
    write_glb(&surfaces, &args.out)?;
    write_json(&planes::file_beside(&args.out), &planes::obstetric())?;
    let rows: Vec<_> = surfaces.iter().map(row).collect();
    let triangles = rows.iter().map(|r| r.triangles).sum();
    if args.json {
        return output::json(&Report { path: &args.out, scale: args.scale, triangles, surfaces: rows });
    }
    output::line(format!("{:24} {:22} {:>8} {:>10} {:>10}", "surface", "tissue", "priority", "triangles", "ml"))?;
    for r in &rows {
        let (name, tissue, count) = (r.name, r.tissue, thousands(r.triangles));
        output::line(format!("{name:24} {tissue:22} {:>8} {count:>10} {:>10.2}", r.priority, r.volume_ml))?;
    }
    output::line(format!("{} triangles in {} surfaces", thousands(triangles), rows.len()))?;
    output::line(args.out.display())
}
