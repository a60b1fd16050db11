//! Generator for the pipeline: runs the best tier that meets the budget.

use std::sync::Arc;

use super::clock::Clock;
use super::parts::{EnhanceError, Enhancer, Readiness, Terminator};
use crate::generator::{Change, Channel, Generator, GeneratorError, Input, LoadedTiers, Outcome, Provider, Tiers};
use crate::render::Frame;

/// Generators of a station; the best tier that meets the budget is active.
pub struct TieredEnhancer {
    generators: Vec<Generator>,
    tiers: Tiers,
    clock: Arc<dyn Clock>,
    name: String,
    provider: Provider,
    /// Whether the next frames need their maps.
    reads_maps: bool,
}

impl TieredEnhancer {
    /// An enhancer of the loaded models; none if no model was loaded.
    pub fn new(loaded: LoadedTiers, clock: Arc<dyn Clock>) -> Option<Self> {
        let LoadedTiers { generators, tiers, .. } = loaded;
        let provider = generators.first()?.provider();
        let name = tiers.name().unwrap_or("none").to_owned();
        let reads_maps = tiers.current().is_some_and(|tier| reads_maps(&generators, tier));
        Some(Self { generators, tiers, clock, name, provider, reads_maps })
    }

    fn changed(&mut self, change: Option<Change>) {
        if let Some(change) = change {
            let name = self.tiers.name().unwrap_or("none");
            tracing::warn!("generator: {name} from now on: {}", change.reason);
            name.clone_into(&mut self.name);
        }
    }
}

/// Whether the tier reads segmentation or attenuation.
fn reads_maps(generators: &[Generator], tier: usize) -> bool {
    let manifest = generators.get(tier).map(Generator::manifest);
    manifest.is_some_and(|m| m.takes(Channel::Segmentation) || m.takes(Channel::Attenuation))
}

impl Enhancer for TieredEnhancer {
    fn tier(&self) -> &str {
        &self.name
    }

    fn on_processors(&self) -> bool {
        self.provider == Provider::Cpu
    }

    fn ready(&mut self, maps: bool) -> Readiness {
        let now = self.clock.now();
        let reads = |tier| reads_maps(&self.generators, tier);
        // A better tier takes over at the first frame with the maps that it reads.
        let next = self.tiers.next_up(now);
        self.reads_maps = next.or(self.tiers.current()).is_some_and(reads);
        if next.is_some_and(|tier| maps || !reads(tier)) {
            let step = self.tiers.step_up(now);
            self.changed(step);
        }
        match self.tiers.current() {
            Some(tier) if maps || !reads_maps(&self.generators, tier) => Readiness::Runs,
            Some(_) => Readiness::NeedsMaps,
            None => Readiness::Rests,
        }
    }

    fn reads_maps(&self) -> bool {
        self.reads_maps
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
        self.provider.can_stop().then(|| -> Terminator {
            Arc::new(move || {
                for run in &runs {
                    // Only the active generator has a run to terminate.
                    run.terminate();
                }
            })
        })
    }
}
