//! `insonify qa`: renders images of the QA phantom and measures them.

use std::path::{Path, PathBuf};

use clap::Parser;
use insonify::files::Outputs;
use insonify::quality::qa_phantom::{self, QaMeasurements};
use insonify::sink::frame_record::AdapterRecord;
use insonify::sink::{self, png};
use insonify::station::Station;
use serde::Serialize;

use super::backend::BackendArgs;
use super::progress::Progress;
use super::{Classify, Failure, output, session};

/// Image the QA phantom and measure it as a scanner's service does: distances, resolution, contrast, cysts, penetration.
///
/// The station's scene is the phantom of configs/qa_phantom.toml, and its probe is linear, over the middle of the
/// phantom. Change frequency, aperture, focus, gain or quality in a copy of that file to see their influence.
/// Everything is measured in displayed images: several along the targets, whose levels are averaged.
#[derive(Debug, Parser)]
#[command(after_help = "Examples:\n  \
                        insonify qa configs/qa_phantom.toml\n  \
                        insonify qa configs/qa_phantom.toml --out qa    (qa/qa_phantom.md and .png)\n  \
                        insonify qa my_probe.toml --json")]
pub(crate) struct Args {
    /// Station file (TOML) with the QA phantom as its scene
    station: PathBuf,

    /// Number of averaged images, evenly spaced along the targets from -20 mm to 20 mm
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
    report: &'a QaMeasurements,
}

/// Runs the command.
pub(crate) fn run(args: &Args) -> Result<(), Failure> {
    let station = Station::load(&args.station)?;
    if let Some(out) = &args.out {
        let names = ["qa_phantom.png", "qa_phantom.json", "qa_phantom.md"];
        Outputs::apart_from(station.files()).within("--out", out, &names)?;
    }
    qa_phantom::check_probe(&station.probe, &station.settings.image).input_of(&args.station)?;
    session::warn_of_budget(&station);
    let scene = session::load_scene(&station)?;
    qa_phantom::check_scene(&scene).input_of(&args.station)?;
    let backend = args.backend.open(station.backend)?;
    let progress = Progress::new("images", args.images.into());
    let show = |done| progress.set(done, args.images.into());
    let (report, first) =
        qa_phantom::image_and_measure(&backend, &scene, &station.probe, &station.settings, args.images, &show)?;
    drop(progress);
    let record = Record {
        station: &args.station,
        device: AdapterRecord::from(&backend),
        frequency_mhz: station.probe.frequency_mhz,
        images: args.images,
        report: &report,
    };
    if let Some(out) = &args.out {
        sink::create_dir(out)?;
        let image = station.settings.image;
        png::write_grey(&out.join("qa_phantom.png"), image.width, image.height, &first, png::Effort::Small)?;
        sink::write_json(&out.join("qa_phantom.json"), &record)?;
        sink::write_text(&out.join("qa_phantom.md"), &page(&record))?;
    }
    if args.json { output::json(&record) } else { output::text(&report) }
}

fn page(record: &Record<'_>) -> String {
    format!(
        "# The QA phantom, measured\n\n`insonify qa {} --out DIR` on {} ({}). {} images, {} MHz.\n\n\
         ![one of the images](qa_phantom.png)\n\n{}",
        record.station.display(),
        record.device.name,
        record.device.driver,
        record.images,
        record.frequency_mhz,
        record.report
    )
}
