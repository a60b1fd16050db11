//! Options for running generators.

use insonify::generator::{LoadOptions, Precision, Provider, Settings};
use insonify::settings::{Setting, SettingsGroup as _};

/// Execution provider, precision and threads of generators.
#[derive(Debug, clap::Args)]
pub(super) struct RuntimeArgs {
    /// Execution provider of generators: cpu, cuda or tensorrt
    #[arg(long, value_name = "NAME", default_value_t)]
    pub(super) provider: Provider,

    /// Precision of generators: int8 or float16 where it is quicker and available (auto), float32, int8, or on a GPU float16
    #[arg(long, value_name = "NAME", default_value_t)]
    pub(super) precision: Precision,

    #[arg(long, value_name = "N", default_value_t = 0, value_parser = clap::value_parser!(u32).range(0..=256), help = threads())]
    pub(super) threads: u32,
}

fn threads() -> String {
    Settings::setting("threads").map_or_else(String::new, Setting::described)
}

impl RuntimeArgs {
    /// Options for loading a generator. `tissues` holds the station's tissue names, from class number 1.
    pub(super) fn options<'a>(&self, tissues: &'a [String]) -> LoadOptions<'a> {
        LoadOptions { provider: self.provider, threads: self.threads, precision: self.precision, tissues }
    }
}
