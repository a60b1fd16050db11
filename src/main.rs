//! The command line: parse, dispatch, exit code.
//!
//! Exit codes: 0 done; 2 what was asked for cannot be done as asked (arguments, station, scene, pose, recording, no GPU
//! driver); 1 anything else (a full disk, a lost device); 130 ended by Ctrl-C.

mod commands;

use std::process::ExitCode;

use clap::Parser;
use tracing_subscriber::EnvFilter;

fn main() -> ExitCode {
    let cli = commands::Cli::parse();
    let default = ["warn", "insonify=info", "insonify=debug"][usize::from(cli.verbose.min(2))];
    let filter = EnvFilter::builder().with_default_directive(tracing::Level::WARN.into());
    // An unreadable RUST_LOG must not silence anything.
    let filter = std::env::var("RUST_LOG").ok().filter(|v| !v.is_empty()).map_or_else(
        || filter.parse_lossy(default),
        |wanted| filter.parse(&wanted).unwrap_or_else(|_| EnvFilter::new(default)),
    );
    tracing_subscriber::fmt().with_env_filter(filter).with_writer(std::io::stderr).with_target(false).init();
    match cli.run() {
        Ok(()) => ExitCode::SUCCESS,
        Err(failure) => failure.report(),
    }
}
