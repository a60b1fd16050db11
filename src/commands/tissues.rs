//! `insonify tissues`: lists the built-in tissues.

use clap::Parser;
use insonify::anatomy::builtin::sourced_tissues;

use super::{Classify, Failure, output};

/// List the built-in tissues with their acoustic properties; --json adds ranges and sources.
#[derive(Debug, Parser)]
pub(crate) struct Args {
    /// Print every property with its value, published range, source, and whether it is assumed, as JSON
    #[arg(long)]
    json: bool,
}

/// Runs the command.
pub(crate) fn run(args: &Args) -> Result<(), Failure> {
    let tissues = sourced_tissues().other()?;
    if args.json {
        return output::json(&tissues);
    }
    output::line(format!(
        "{:22} {:>7} {:>7} {:>8} {:>10} {:>8}  echogenicity",
        "tissue", "m/s", "kg/m3", "MRayl", "dB/cm/MHz", "exponent"
    ))?;
    for (name, sourced) in &tissues {
        let t = sourced.tissue();
        output::line(format!(
            "{name:22} {:>7.0} {:>7.1} {:>8.4} {:>10.4} {:>8.2}  {}",
            t.speed_m_s,
            t.density_kg_m3,
            t.impedance_mrayl(),
            t.attenuation_db_cm_mhz,
            t.attenuation_exponent,
            sourced.echogenicity
        ))?;
    }
    output::line("Sources and ranges: insonify tissues --json")
}
