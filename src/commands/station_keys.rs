//! `insonify station-keys`: lists the keys of a station file.

use clap::Parser;
use insonify::station::print_keys;

use super::{Classify, Failure, output};

/// List every key of a station file with its unit, default and range.
#[derive(Debug, Parser)]
pub(crate) struct Args {}

/// Runs the command.
pub(crate) fn run(_: &Args) -> Result<(), Failure> {
    let mut text = String::new();
    print_keys(&mut text).other()?;
    output::line(text.trim_end())
}
