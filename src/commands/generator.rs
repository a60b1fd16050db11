//! `insonify generator`: checks, times and applies a model.

use std::path::PathBuf;

use clap::Parser;
use insonify::files::Outputs;
use insonify::generator::{Generator, Manifest, ParityReport, Precision, Provider, RunTimes, Runtime, generator_files};
use insonify::sink::png::{self, Effort};
use insonify::sink::{FrameDirectory, FrameFiles};
use serde::Serialize;

use super::runtime_args::RuntimeArgs;
use super::{Classify, Failure, input, output};

/// Check a generator against its manifest and parity pair, measure it, and apply it to a frame.
#[derive(Debug, Parser)]
#[command(after_help = AFTER_HELP)]
pub(crate) struct Args {
    /// Model (.onnx); its manifest is the .toml file of the same name in the same folder
    model: PathBuf,

    /// Directory of a frame to translate, from `insonify render`: mask.png, and bmode.png and maps as the model needs
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
struct CheckedGenerator<'a> {
    version: &'static str,
    model: &'a PathBuf,
    library: PathBuf,
    provider: Provider,
    precision: Precision,
    manifest: &'a Manifest,
    parity: &'a ParityReport,
    times: Option<RunTimes>,
    written: Option<PathBuf>,
}

/// Runs the command.
pub(crate) fn run(args: &Args) -> Result<(), Failure> {
    let frame = args.frame.as_deref().map(FrameDirectory::read).transpose().input()?;
    let tissues = frame.as_ref().map_or(&[][..], |f| &f.tissues);
    let written = frame.as_ref().map(|f| args.out.clone().unwrap_or_else(|| f.directory.join("generated.png")));
    if let (Some(frame), Some(path)) = (&frame, &written) {
        let read = FrameFiles::NAMES.map(|name| frame.directory.join(name));
        Outputs::apart_from(read).and(generator_files(&args.model)).replaced("--out", path)?;
    }
    let runtime = Runtime::get().input()?;
    let mut generator = Generator::load(&args.model, runtime, &args.runtime.options(tissues))?;
    let default = frame.as_ref().map_or((1386, 1000), |f| (f.width, f.height));
    let (width, height) = args.size.unwrap_or(default);
    let times = generator.times(width, height, args.runs.into())?;
    if let (Some(frame), Some(path)) = (&frame, &written) {
        let mut image = Vec::new();
        generator.run(&frame.input(generator.manifest()).input()?, &mut image)?;
        png::write_grey(path, frame.width, frame.height, &image, Effort::Small)?;
    }
    let parity = generator.parity();
    if args.json {
        return output::json(&CheckedGenerator {
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
    output::text(generator.manifest())?;
    output::line(format!("parity     {parity}"))?;
    let (provider, precision) = (args.runtime.provider, generator.precision());
    output::line(format!("runs on    {provider} in {precision} by {}", runtime.library().display()))?;
    if let Some(times) = times {
        output::line(format!("time       {times}"))?;
    }
    written.map_or(Ok(()), |path| output::line(format!("written    {}", path.display())))
}
