//! A station's generators in the pipeline.

use std::sync::Arc;

use super::parts::{FrameGenerators, GenerateError, Terminator};
use crate::generator::{Generator, GeneratorError, Input, Provider};
use crate::render::{ComputeDevice, Frame};

/// Loaded generators, by index.
pub struct Generators {
    generators: Vec<Generator>,
    provider: Provider,
    compute_device: ComputeDevice,
}

impl Generators {
    /// Generators that share one provider; `None` if `generators` is empty.
    pub fn new(generators: Vec<Generator>) -> Option<Self> {
        let first = generators.first()?;
        let (provider, compute_device) = (first.provider(), first.compute_device());
        Some(Self { generators, provider, compute_device })
    }
}

impl FrameGenerators for Generators {
    fn count(&self) -> usize {
        self.generators.len()
    }

    fn name(&self, generator: usize) -> &str {
        self.generators.get(generator).map_or("none", |generator| &generator.manifest().name)
    }

    fn compute_device(&self) -> ComputeDevice {
        self.compute_device
    }

    fn reads_maps(&self, generator: usize) -> bool {
        self.generators.get(generator).is_some_and(|generator| generator.manifest().reads_maps())
    }

    fn generate(&mut self, generator: usize, frame: &Frame, out: &mut Vec<u8>) -> Result<(), GenerateError> {
        let Some(generator) = self.generators.get_mut(generator) else {
            return Err(GenerateError::Failed(format!("there is no generator {generator}")));
        };
        generator.run(&Input::from(frame), out).map_err(|error| match error {
            GeneratorError::Terminated { .. } => GenerateError::Terminated,
            other => GenerateError::Failed(other.to_string()),
        })
    }

    fn terminator(&self) -> Option<Terminator> {
        let runs: Vec<_> = self.generators.iter().map(Generator::terminator).collect();
        self.provider.can_stop().then(|| -> Terminator {
            Arc::new(move || {
                for run in &runs {
                    // Only one generator runs at a time, so at most one of these calls has an effect.
                    run.terminate();
                }
            })
        })
    }
}
