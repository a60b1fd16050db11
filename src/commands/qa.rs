//! `insonify qa`: images and measures the QA phantom.

use std::fmt::Write as _;
use std::path::{Path, PathBuf};

use anyhow::anyhow;
use clap::Parser;
use glam::DVec3;
use insonify::pose::Pose;
use insonify::quality::levels::Levels;
use insonify::quality::qa_phantom::{self, QaReport, RESOLVED_DIP_DB, SEEN_DB};
use insonify::render::{RenderError, RenderSettings, Renderer};
use insonify::sink::frame_record::AdapterRecord;
use insonify::sink::{self, png};
use insonify::station::Station;
use insonify::transducer::Sector;
use serde::Serialize;

use super::backend::BackendArgs;
use super::outputs::Outputs;
use super::progress::Progress;
use super::{Failure, output, session};

/// Image the QA phantom and measure it as a scanner's service does: distances, resolution, contrast, cysts, penetration.
///
/// The station's scene is the phantom of configs/qa_phantom.toml and its probe is linear, over the middle of the phantom.
/// Change frequency, aperture, focus, gain or quality in a copy of that file to see what each does. Everything is read off
/// displayed images, several along the targets, whose levels are averaged.
#[derive(Debug, Parser)]
#[command(after_help = "Examples:\n  \
                        insonify qa configs/qa_phantom.toml\n  \
                        insonify qa configs/qa_phantom.toml --out qa    (qa/qa_phantom.md and .png)\n  \
                        insonify qa my_probe.toml --json")]
pub(crate) struct Args {
    /// Station file (TOML) with the QA phantom as its scene
    station: PathBuf,

    /// Images to average, evenly from 20 mm on one side to 20 mm on the other along the targets
    #[arg(long, value_name = "N", default_value_t = 6, value_parser = clap::value_parser!(u16).range(1..=64))]
    images: u16,

    #[command(flatten)]
    backend: BackendArgs,

    /// Also write a page (qa_phantom.md), its picture (qa_phantom.png) and the figures (qa_phantom.json) into this folder
    #[arg(long, value_name = "DIR")]
    out: Option<PathBuf>,

    /// Print the figures as JSON
    #[arg(long)]
    json: bool,
}

#[derive(Serialize)]
struct Record<'a> {
    station: &'a Path,
    device: AdapterRecord,
    frequency_mhz: f64,
    images: u16,
    #[serde(flatten)]
    report: &'a QaReport,
}

/// Runs the command.
pub(crate) fn run(args: &Args) -> Result<(), Failure> {
    let station = Station::load(&args.station)?;
    if let Some(out) = &args.out {
        let names = ["qa_phantom.png", "qa_phantom.json", "qa_phantom.md"];
        Outputs::beside_station(&station).within("--out", out, &names)?;
    }
    let sector = Sector::fit(&station.probe, station.settings.image.width, station.settings.image.height);
    if !qa_phantom::suits(&station.probe, &sector) {
        return Err(Failure::Input(anyhow!(
            "{}: the QA phantom is measured by a linear probe at least 58 mm wide, to a depth of 60 mm or more, on pixels \
             of at most 0.25 mm; here: kind {:?}, depth_mm {}, pixels of {:.2} mm. configs/qa_phantom.toml has a probe that \
             suits",
            args.station.display(),
            station.probe.kind,
            station.probe.depth_mm,
            sector.pixel_mm
        )));
    }
    session::warn_of_budget(&station);
    let scene = session::load_scene(&station)?;
    let wires = scene.surfaces.iter().any(|s| s.name == "wires");
    let targets = scene.surfaces.iter().filter(|s| s.name.starts_with("target ")).count();
    if !wires || targets != insonify::anatomy::specimens::qa::CONTRAST.len() {
        return Err(Failure::Input(anyhow!(
            "{}: the scene isn't the QA phantom (it lacks the surface \"wires\" or the \"target\" surfaces); use \
             assets/scenes/qa_phantom.glb",
            args.station.display()
        )));
    }
    let backend = args.backend.open(station.backend)?;
    let settings = RenderSettings { maps: false, ..station.settings };
    let mut renderer = Renderer::new(&backend, &scene, &station.probe, &settings)?;
    let image = station.settings.image;
    let mut levels = Levels::new(sector, image.dynamic_range_db);
    let mut first = Vec::new();
    let last = f64::from(args.images.max(2) - 1);
    let poses: Vec<Pose> = (0..args.images)
        .map(|i| {
            let along = if args.images == 1 { 0.0 } else { -20.0 + 40.0 * f64::from(i) / last };
            Pose { position_mm: DVec3::new(0.0, along, 0.0), ..Pose::IDENTITY }
        })
        .collect();
    let progress = Progress::new("images", poses.len());
    renderer.render_each(
        &poses,
        |_| 0.0,
        |index, frame| {
            if index == 0 {
                first.clone_from(&frame.bmode);
            }
            levels.add(&frame.bmode);
            progress.set(index + 1, poses.len());
            Ok::<(), RenderError>(())
        },
    )?;
    drop(progress);

    let report = qa_phantom::measure(&levels, &station.probe);
    let record = Record {
        station: &args.station,
        device: session::adapter(&backend),
        frequency_mhz: station.probe.frequency_mhz,
        images: args.images,
        report: &report,
    };
    let mut text = String::new();
    // Writing to a String cannot fail.
    let _ = write_tables(&mut text, &report);
    if let Some(out) = &args.out {
        sink::create_dir(out)?;
        png::write_grey(&out.join("qa_phantom.png"), image.width, image.height, &first, png::Effort::Small)?;
        sink::write_json(&out.join("qa_phantom.json"), &record)?;
        let page = page(&record, &text);
        sink::write_text(&out.join("qa_phantom.md"), &page)?;
    }
    if args.json { output::json(&record) } else { output::line(text.trim_end()) }
}

fn page(record: &Record<'_>, tables: &str) -> String {
    format!(
        "# The QA phantom, measured\n\n`insonify qa {} --out DIR` on {} ({}). {} images, {} MHz.\n\n\
         ![one of the images](qa_phantom.png)\n\n{tables}",
        record.station.display(),
        record.device.name,
        record.device.driver,
        record.images,
        record.frequency_mhz
    )
}

/// The report as Markdown tables, which read well on a terminal, too.
fn write_tables(out: &mut String, report: &QaReport) -> std::fmt::Result {
    writeln!(out, "## Distances\n\n| direction | depth, mm | true, mm | measured, mm | off |\n|---|---|---|---|---|")?;
    for d in &report.distances {
        let off = 100.0 * (d.measured_mm / d.true_mm - 1.0);
        let (direction, depth, want, got) = (d.direction, d.depth_mm, d.true_mm, d.measured_mm);
        writeln!(out, "| {direction} | {depth:.0} | {want:.1} | {got:.2} | {off:+.2} % |")?;
    }
    writeln!(out, "\n## Resolution\n\nFull widths at half the amplitude of the wires of the vertical group.\n")?;
    writeln!(
        out,
        "| depth, mm | lateral, mm | beam and wire, mm | axial, mm | pulse and wire, mm |\n|---|---|---|---|---|"
    )?;
    for w in &report.widths {
        writeln!(
            out,
            "| {:.0} | {:.2} | {:.2} | {:.2} | {:.2} |",
            w.depth_mm, w.lateral_mm, w.lateral_expected_mm, w.axial_mm, w.axial_expected_mm
        )?;
    }
    writeln!(out, "\nPairs of wires, seen as two where the level dips by {RESOLVED_DIP_DB} dB between them.\n")?;
    writeln!(out, "| direction | depth, mm | apart, mm | dip, dB | seen as |\n|---|---|---|---|---|")?;
    for p in &report.pairs {
        let seen = if p.is_resolved() { "two" } else { "one" };
        writeln!(out, "| {} | {:.0} | {:.2} | {:.1} | {seen} |", p.direction, p.depth_mm, p.apart_mm, p.dip_db)?;
    }
    writeln!(out, "\n## Contrast\n\n| target, dB | measured, dB | off, dB |\n|---|---|---|")?;
    for c in &report.contrast {
        writeln!(out, "| {:+.0} | {:+.2} | {:+.2} |", c.true_db, c.measured_db, c.measured_db - c.true_db)?;
    }
    writeln!(out, "\n## Anechoic cylinders\n\n| diameter, mm | depth, mm | below the background, dB |\n|---|---|---|")?;
    for c in &report.cysts {
        writeln!(out, "| {:.1} | {:.0} | {:.1} |", c.diameter_mm, c.depth_mm, c.void_db)?;
    }
    let p = &report.penetration;
    let end = if p.whole_depth { "the bottom of the image" } else { "below that it is lost in black" };
    writeln!(
        out,
        "\n## Penetration\n\nThe background stays {SEEN_DB} dB above black down to {:.0} mm ({end}). Its level changes by \
         {:+.2} dB a cm.\n",
        p.seen_mm, p.slope_db_cm
    )?;
    writeln!(out, "| depth, mm | level above black, dB |\n|---|---|")?;
    p.levels
        .iter()
        .filter(|(depth, _)| depth % 10.0 == 0.0)
        .try_for_each(|(d, db)| writeln!(out, "| {d:.0} | {db:.1} |"))
}
