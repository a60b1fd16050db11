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

        /// Number of threads of a run; 0: one per processor.
        threads: u32 = 0, "", 0.0..=256.0, Everything;

        /// Time limit of a run. Default: `quality.frame_budget_ms`, if given.
        run_budget_ms: f64 = 50.0, "ms", RUN_BUDGET_MIN_MS..=RUN_BUDGET_MAX_MS, Everything;

        /// Execution provider of the models; an unavailable provider is an error.
        provider: Provider = Provider::Cpu, "", Provider::RANGE, Everything;

        /// Precision of the models; auto: int8 or float16 where available and faster.
        precision: Precision = Precision::Auto, "", Precision::RANGE, Everything;
    }
    plain {
        /// Models (`.onnx`, each with its manifest); with a fixed quality, in order of preference. Empty: raw frames.
        models: Vec<PathBuf> = Vec::new(), Everything;
    }
}
