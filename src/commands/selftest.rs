//! `insonify selftest`: compares frames of this device with acoustic theory.

use std::path::PathBuf;

use anyhow::anyhow;
use clap::Parser;
use insonify::files::Outputs;
use insonify::render::BackendChoice;
use insonify::report::selftest as selftest_report;
use insonify::selftest;
use insonify::sink::write_json;

use super::backend::BackendArgs;
use super::progress::Progress;
use super::{Failure, input, output};

/// Render small scenes whose answers are known, and compare: Snell, Fresnel, time of flight, attenuation, the point-spread
/// function, speckle, shadows, maps, determinism. It takes less than a minute.
///
/// Run it on a new machine, after an update of the graphics driver, and before a graded examination.
#[derive(Debug, Parser)]
#[command(after_help = "Exit codes: 0 all checks passed; 1 one did not; 2 no device.\n\n\
                        Examples:\n  \
                        insonify selftest\n  \
                        insonify selftest --html selftest.html --json selftest.json")]
pub(crate) struct Args {
    #[command(flatten)]
    backend: BackendArgs,

    /// Also write every check with its numbers as JSON
    #[arg(long, value_name = "FILE")]
    json: Option<PathBuf>,

    /// Also write a page to print or to keep (.html)
    #[arg(long, value_name = "FILE", value_parser = input::html)]
    html: Option<PathBuf>,
}

/// Runs the command.
pub(crate) fn run(args: &Args) -> Result<(), Failure> {
    let mut outputs = Outputs::default();
    for (option, path) in [("--json", &args.json), ("--html", &args.html)] {
        if let Some(path) = path {
            outputs = outputs.replaced(option, path)?;
        }
    }
    let backend = args.backend.open(BackendChoice::Auto)?;
    let progress = Progress::new("self-test", 0);
    let report = selftest::run(&backend, &|done, of| progress.set(done, of))?;
    drop(progress);
    if let Some(path) = &args.json {
        write_json(path, &report)?;
    }
    if let Some(path) = &args.html {
        selftest_report::write(path, &report)?;
    }
    output::text(selftest_report::table(&report))?;
    for path in args.json.iter().chain(&args.html) {
        output::line(path.display())?;
    }
    let failed: Vec<_> = report.failed().map(|check| format!("{}: {}", check.group, check.name)).collect();
    if failed.is_empty() {
        return Ok(());
    }
    let (device, driver) = (&report.device, &report.driver);
    Err(Failure::Other(anyhow!(
        "{device} ({driver}) does not render what it should: {}. Update its driver, or choose another one (WGPU_BACKEND)",
        failed.join("; ")
    )))
}
