//! The command line: parse, dispatch, exit code.
//!
//! Exit codes: 0 success; 2 invalid input (arguments, station, scene, pose, recording) or no GPU driver; 1 any other
//! failure (a full disk, a lost device); 130 ended by Ctrl-C.

mod commands;

use std::process::ExitCode;

use clap::Parser;

fn main() -> ExitCode {
    quiet_the_driver();
    let cli = commands::Cli::parse();
    commands::start_log(cli.verbose);
    match cli.run() {
        Ok(()) => ExitCode::SUCCESS,
        Err(failure) => failure.report(),
    }
}

/// Suppresses Mesa's message `error: XDG_RUNTIME_DIR is invalid` on machines without a desktop, where it is harmless.
fn quiet_the_driver() {
    if cfg!(target_os = "linux") && std::env::var_os("XDG_RUNTIME_DIR").is_none() {
        // SAFETY: the first thing in `main`; no other thread runs yet that could read the environment.
        unsafe { std::env::set_var("XDG_RUNTIME_DIR", std::env::temp_dir()) };
    }
}
