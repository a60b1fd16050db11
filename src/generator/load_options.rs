//! Options for loading a model.

use super::{Precision, Provider};

/// Options for loading a model.
#[derive(Debug, Clone, Default)]
pub struct LoadOptions<'a> {
    /// Execution provider.
    pub provider: Provider,
    /// Threads of one run, 0 for one per processor.
    pub threads: u32,
    /// Precision of the model.
    pub precision: Precision,
    /// Names of the station's tissues in the order of their numbers, from number 1.
    pub tissues: &'a [String],
}
