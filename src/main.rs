//! The program `insonify`: parses the command line, runs the command, and returns its exit code.
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

/// Sets `XDG_RUNTIME_DIR` on machines without a desktop, where Mesa would otherwise print a harmless error about it.
fn quiet_the_driver() {
    if cfg!(target_os = "linux") && std::env::var_os("XDG_RUNTIME_DIR").is_none() {
        // SAFETY: this is the first statement of `main`, so no other thread reads the environment yet.
        unsafe { std::env::set_var("XDG_RUNTIME_DIR", std::env::temp_dir()) };
    }
}
