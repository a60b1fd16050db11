//! Generator settings of a station: its table `[generator]`.

use std::path::PathBuf;

use super::{Budget, Provider};

/// Generator settings of a station.
#[derive(Debug, Clone, PartialEq)]
pub struct Settings {
    /// Whether any generator runs.
    pub enabled: bool,
    /// Models (`.onnx`, each with its manifest), the best first. None: the station shows what it renders.
    pub models: Vec<PathBuf>,
    /// Execution provider.
    pub provider: Provider,
    /// Threads of one run, 0 for one a processor.
    pub threads: u32,
    /// Time that one run may take, ms.
    pub budget_ms: f64,
}

impl Settings {
    /// Least and greatest budget, ms.
    pub const BUDGET_MS: [f64; 2] = [1.0, 10_000.0];

    /// The budget with everything that follows from it.
    pub fn budget(&self) -> Budget {
        let [least, greatest] = Self::BUDGET_MS;
        // `max` before `min`, so that NaN becomes the least.
        Budget::new(std::time::Duration::from_secs_f64(self.budget_ms.max(least).min(greatest) / 1000.0))
    }
}

impl Default for Settings {
    fn default() -> Self {
        Self { enabled: true, models: Vec::new(), provider: Provider::Cpu, threads: 0, budget_ms: 50.0 }
    }
}
