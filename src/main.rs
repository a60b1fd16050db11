//! The command line: parse, dispatch, exit code.
//!
//! Exit codes: 0 done; 2 what was asked for cannot be done as asked (arguments, station, scene, pose, recording, no GPU
//! driver); 1 anything else (a full disk, a lost device); 130 ended by Ctrl-C.

mod commands;

use std::io::IsTerminal;
use std::process::ExitCode;

use clap::Parser;
use tracing_subscriber::EnvFilter;

fn main() -> ExitCode {
    quiet_the_driver();
    let cli = commands::Cli::parse();
    let default = ["warn", "insonify=info", "insonify=debug"][usize::from(cli.verbose.min(2))];
    let filter = EnvFilter::builder().with_default_directive(tracing::Level::WARN.into());
    // An unreadable RUST_LOG must not silence anything.
    let filter = std::env::var("RUST_LOG").ok().filter(|v| !v.is_empty()).map_or_else(
        || filter.parse_lossy(default),
        |wanted| filter.parse(&wanted).unwrap_or_else(|_| EnvFilter::new(default)),
    );
    tracing_subscriber::fmt()
        .with_env_filter(filter)
        .with_writer(std::io::stderr)
        .with_ansi(std::io::stderr().is_terminal())
        .with_target(false)
        .without_time()
        .init();
    match cli.run() {
        Ok(()) => ExitCode::SUCCESS,
        Err(failure) => failure.report(),
    }
}

/// Keeps Mesa from printing `error: XDG_RUNTIME_DIR is invalid` on machines without a desktop, where nothing is wrong.
fn quiet_the_driver() {
    if cfg!(target_os = "linux") && std::env::var_os("XDG_RUNTIME_DIR").is_none() {
        // SAFETY: the first thing in `main`; no other thread runs yet that could read the environment.
        unsafe { std::env::set_var("XDG_RUNTIME_DIR", std::env::temp_dir()) };
    }
}
