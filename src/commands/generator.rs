//! `insonify generator`: checks, times and applies a model.

use std::path::PathBuf;

use clap::Parser;
use insonify::generator::{Generator, Kind, Manifest, ParityReport, Precision, Provider, Runtime, generator_files};
use insonify::sink::FrameFiles;
use insonify::sink::png::{self, Effort};
use insonify::statistics::{nearest_rank, sorted};
use serde::Serialize;

use super::frame_dir::FrameDir;
use super::outputs::Outputs;
use super::runtime_args::RuntimeArgs;
use super::{Classify, Failure, input, output};

/// Check a generator against its manifest and parity pair, measure it, and apply it to a frame.
#[derive(Debug, Parser)]
#[command(after_help = AFTER_HELP)]
pub(crate) struct Args {
    /// Model (.onnx); its manifest is the .toml of the same name beside it
    model: PathBuf,

    /// Directory of a frame to apply it to: mask.png and of bmode.png and the maps those that it takes, as `insonify render` writes
    #[arg(long, value_name = "DIR")]
    frame: Option<PathBuf>,

    /// Image to write [default: generated.png in the frame's directory]
    #[arg(long, value_name = "PNG", requires = "frame")]
    out: Option<PathBuf>,

    /// Runs to measure, 0..=10000
    #[arg(long, value_name = "N", default_value_t = 30, value_parser = clap::value_parser!(u16).range(0..=10_000))]
    runs: u16,

    /// Size to measure at, pixels [default: the frame's, or 1386x1000]
    #[arg(long, value_name = "WxH", value_parser = size)]
    size: Option<(u32, u32)>,

    #[command(flatten)]
    runtime: RuntimeArgs,

    /// Print everything as JSON
    #[arg(long)]
    json: bool,
}

const AFTER_HELP: &str = "\
Needs ONNX Runtime's library: scripts/setup fetches it, or ORT_DYLIB_PATH names it.

Examples:
  insonify generator assets/generators/fast_msa/fast_msa.onnx
  insonify render configs/obstetric.toml --out out/frame
  insonify generator assets/generators/fast_msa/fast_msa.onnx --frame out/frame --out out/generated.png";

fn size(text: &str) -> Result<(u32, u32), String> {
    let in_range = input::product(text).filter(|(w, h)| (16..=4096).contains(w) && (16..=4096).contains(h));
    in_range.ok_or_else(|| "expected width x height such as `1386x1000`, each 16..=4096".to_owned())
}

#[derive(Serialize)]
struct Report<'a> {
    version: &'static str,
    model: &'a PathBuf,
    library: PathBuf,
    provider: Provider,
    precision: Precision,
    manifest: &'a Manifest,
    parity: &'a ParityReport,
    times: Option<Times>,
    written: Option<PathBuf>,
}

#[derive(Serialize)]
struct Times {
    width: u32,
    height: u32,
    runs: usize,
    min_ms: f64,
    p50_ms: f64,
    p95_ms: f64,
}

/// Runs the command.
pub(crate) fn run(args: &Args) -> Result<(), Failure> {
    let frame = args.frame.as_deref().map(FrameDir::read).transpose().input()?;
    let tissues = frame.as_ref().map_or(&[][..], |f| &f.tissues);
    let written = frame.as_ref().map(|f| args.out.clone().unwrap_or_else(|| f.directory.join("generated.png")));
    if let (Some(frame), Some(path)) = (&frame, &written) {
        let read = FrameFiles::NAMES.map(|name| frame.directory.join(name));
        Outputs::beside(read).and(generator_files(&args.model)).replaced("--out", path)?;
    }
    let runtime = Runtime::get().input()?;
    let mut generator = Generator::load(&args.model, runtime, &args.runtime.options(tissues))?;
    let default = frame.as_ref().map_or((1386, 1000), |f| (f.width, f.height));
    let (width, height) = args.size.unwrap_or(default);
    let times = measure(&mut generator, width, height, args.runs.into())?;
    if let (Some(frame), Some(path)) = (&frame, &written) {
        let mut image = Vec::new();
        generator.run(&frame.input(generator.manifest()).input()?, &mut image)?;
        png::write_grey(path, frame.width, frame.height, &image, Effort::Small)?;
    }
    let parity = generator.parity();
    if args.json {
        return output::json(&Report {
            version: env!("CARGO_PKG_VERSION"),
            model: &args.model,
            library: runtime.library().to_owned(),
            provider: args.runtime.provider,
            precision: generator.precision(),
            manifest: generator.manifest(),
            parity,
            times,
            written,
        });
    }
    print_manifest(generator.manifest())?;
    output::line(format!("parity     {parity}"))?;
    output::line(format!(
        "runs on    {} in {} by {}",
        args.runtime.provider,
        generator.precision(),
        runtime.library().display()
    ))?;
    if let Some(t) = times {
        let (min, p50, p95) = (t.min_ms, t.p50_ms, t.p95_ms);
        let line =
            format!("{width} x {height}: p50 {p50:.1} ms, p95 {p95:.1} ms, least {min:.1} ms of {} runs", t.runs);
        output::line(format!("time       {line}"))?;
    }
    written.map_or(Ok(()), |path| output::line(format!("written    {}", path.display())))
}

fn measure(generator: &mut Generator, width: u32, height: u32, runs: usize) -> Result<Option<Times>, Failure> {
    let measured = generator.measure(width, height, runs)?;
    let times = sorted(measured.into_iter().map(|time| time.as_secs_f64() * 1e3));
    let ms = |part| nearest_rank(&times, part);
    let [Some(min_ms), Some(p50_ms), Some(p95_ms)] = [0.0, 0.5, 0.95].map(ms) else { return Ok(None) };
    Ok(Some(Times { width, height, runs, min_ms, p50_ms, p95_ms }))
}

fn print_manifest(manifest: &Manifest) -> Result<(), Failure> {
    let kind = match manifest.kind {
        Kind::Trained => "trained",
        Kind::FixedFilter => "a fixed filter, not trained",
    };
    output::line(format!("generator  {}: {}", manifest.name, manifest.description))?;
    let channels: Vec<_> = manifest.input.channels.iter().map(|c| format!("{c:?}").to_lowercase()).collect();
    let multiple = manifest.padding_multiple;
    output::line(format!("kind       {kind}; {:?} ({}), padded to {multiple}", manifest.variant, channels.join(", ")))?;
    if let Some(training) = &manifest.training {
        let start = training.data_sha256.get(..12).unwrap_or_default();
        output::line(format!("training   {} iterations on data {start}…", training.iterations))?;
    }
    if let Some(quality) = &manifest.quality {
        let optional = |name: &str, v: Option<f64>| v.map_or(String::new(), |v| format!(", {name} {v:.4}"));
        let more = optional("pKL", quality.pkl) + &optional("FID", quality.fid);
        output::line(format!("quality    PSNR {:.2} dB, SSIM {:.4}{more}", quality.psnr_db, quality.ssim))?;
    }
    Ok(())
}
