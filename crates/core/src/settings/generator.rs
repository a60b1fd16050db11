//! Generator settings of a station: its table `[generator]`.

use std::path::PathBuf;

use super::{Precision, Provider, settings};

/// Smallest and largest time budget of a generator run, ms.
const RUN_BUDGET_MIN_MS: f64 = 1.0;
const RUN_BUDGET_MAX_MS: f64 = 10_000.0;

settings! {
    /// Generator settings of a station.
    #[derive(Debug, Clone, PartialEq)]
    pub struct GeneratorSettings in "generator" {
        /// Whether generators run at all.
        enabled: bool = true, "", 0.0..=1.0, Everything;

        /// Threads of one run; 0 is one per processor.
        threads: u32 = 0, "", 0.0..=256.0, Everything;

        /// Time that one run may take. Default: `quality.frame_budget_ms`, if given.
        run_budget_ms: f64 = 50.0, "ms", RUN_BUDGET_MIN_MS..=RUN_BUDGET_MAX_MS, Everything;

        /// Execution provider; one that is not available is an error.
        provider: Provider = Provider::Cpu, "", Provider::RANGE, Everything;

        /// Precision of the models: int8 or float16 where it is quicker and available (auto), or the one that is named.
        precision: Precision = Precision::Auto, "", Precision::RANGE, Everything;
    }
    plain {
        /// Models (`.onnx`, each with its manifest); with a fixed quality, in order of preference. Empty: raw frames.
        models: Vec<PathBuf> = Vec::new(), Everything;
    }
}
