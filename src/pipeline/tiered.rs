//! Generators as the pipeline runs them: the tier that keeps the budget.

use std::sync::Arc;

use super::clock::Clock;
use super::parts::{EnhanceError, Enhancer, Terminator};
use crate::generator::{Change, Generator, GeneratorError, Input, LoadedTiers, Outcome, Tiers};
use crate::render::Frame;

/// The generators of a station, the best that keeps the budget at work.
pub struct TieredEnhancer {
    generators: Vec<Generator>,
    tiers: Tiers,
    clock: Arc<dyn Clock>,
    name: String,
    can_stop: bool,
}

impl TieredEnhancer {
    /// From loaded models; none where no model is left to run.
    pub fn new(loaded: LoadedTiers, clock: Arc<dyn Clock>) -> Option<Self> {
        let LoadedTiers { generators, tiers, .. } = loaded;
        let can_stop = generators.first()?.provider().can_stop();
        let name = tiers.name().unwrap_or("none").to_owned();
        Some(Self { generators, tiers, clock, name, can_stop })
    }

    fn changed(&mut self, change: Option<Change>) {
        if let Some(change) = change {
            let name = self.tiers.name().unwrap_or("none");
            tracing::warn!("generator: {name} from now on: {}", change.reason);
            name.clone_into(&mut self.name);
        }
    }
}

impl Enhancer for TieredEnhancer {
    fn tier(&self) -> &str {
        &self.name
    }

    fn ready(&mut self) -> bool {
        let step = self.tiers.step_up(self.clock.now());
        self.changed(step);
        self.tiers.current().is_some()
    }

    fn enhance(&mut self, frame: &Frame, out: &mut Vec<u8>) -> Result<(), EnhanceError> {
        let ticket = self.tiers.start(self.clock.now());
        let Some((ticket, generator)) = ticket.and_then(|t| Some((t, self.generators.get_mut(t.tier)?))) else {
            return Err(EnhanceError("no generator keeps the budget".to_owned()));
        };
        let result = generator.run(&Input::from(frame), out);
        let outcome = match &result {
            Ok(()) => Outcome::Done,
            Err(GeneratorError::Terminated { .. }) => Outcome::Stopped,
            Err(error) => Outcome::Failed(error.to_string()),
        };
        let change = self.tiers.finish(ticket, self.clock.now(), &outcome);
        self.changed(change);
        result.map_err(|error| EnhanceError(error.to_string()))
    }

    fn terminator(&self) -> Option<Terminator> {
        let runs: Vec<_> = self.generators.iter().map(Generator::terminator).collect();
        self.can_stop.then(|| -> Terminator {
            Arc::new(move || {
                for run in &runs {
                    // Only the one at work has a run to end.
                    run.terminate();
                }
            })
        })
    }
}
