//! Common parts of live sessions: generators, status and dropped frames.

use std::sync::Arc;

use anyhow::anyhow;
use insonify::generator::{GeneratorError, Kind, LoadedTiers, TierState, load_tiers};
use insonify::pipeline::{Clock, Enhancer, Limits, Parts, Pipeline, QualityBudget, Status, Summary, TieredEnhancer};
use insonify::pose::{Counters, Pose};
use insonify::render::Renderer;
use insonify::station::Station;

use super::status_line::StatusLine;
use super::{Classify, Failure, quality};

/// The station's generators; `None` without models, without ONNX Runtime, or if every model is refused. Failures are
/// logged as warnings, and the session shows rendered images.
pub(crate) fn enhancer(station: &Station, clock: &Arc<dyn Clock>) -> Result<Option<Box<dyn Enhancer>>, Failure> {
    if !station.generator.enabled || station.generator.models.is_empty() {
        return Ok(None);
    }
    let (width, height) = (station.settings.image.width, station.settings.image.height);
    let mut loaded = match load_tiers(&station.generator, station.tissues.names(), width, height) {
        Ok(loaded) => loaded,
        Err(error) => {
            tracing::warn!("no generator runs, the rendered image is shown: {error}");
            return Ok(None);
        }
    };
    for refused in &loaded.refused {
        // A requested provider that is unavailable is an error, never a silent fallback.
        if let GeneratorError::Provider { .. } = refused.error {
            return Err(Failure::Input(anyhow!("{}: {}", refused.path.display(), refused.error)));
        }
        tracing::warn!("{} is not used: {}", refused.path.display(), refused.error);
    }
    say_tiers(&mut loaded, station.generator.budget_ms);
    Ok(TieredEnhancer::new(loaded, clock.clone()).map(|enhancer| Box::new(enhancer) as Box<dyn Enhancer>))
}

/// Prints the time of each generator, and marks fixed filters.
fn say_tiers(loaded: &mut LoadedTiers, budget_ms: f64) {
    for (tier, generator) in loaded.tiers.report().iter().zip(&loaded.generators) {
        let p50_ms = tier.p50.map_or(0.0, |t| t.as_secs_f64() * 1e3);
        let state = match &tier.state {
            TierState::TooSlow => ", too slow: it is not started",
            TierState::OverBudget { .. } => ", too slow now and then: it is not started yet",
            TierState::Ready | TierState::Failed(_) => "",
        };
        let kind = match generator.manifest().kind {
            Kind::Trained => "",
            Kind::FixedFilter => "; a fixed filter, no trained generator",
        };
        eprintln!("generator: {} ({p50_ms:.0} ms, budget {budget_ms} ms{state}){kind}", tier.name);
    }
}

/// Chooses and prints the quality that fits the station's budget at `pose`, else at the station's pose. Returns the
/// budget for the session to keep; `None` without one.
pub(crate) fn choose_quality(
    renderer: &mut Renderer,
    station: &mut Station,
    pose: Option<Pose>,
) -> Result<Option<QualityBudget>, Failure> {
    let Some(budget_ms) = station.quality_budget_ms else { return Ok(None) };
    // The tracked pose is not known yet; the session later corrects a wrong choice.
    let pose = pose.or(station.default_pose).unwrap_or(Pose::IDENTITY);
    let climbed = renderer.choose_quality(&station.probe, &station.settings, &[pose], budget_ms)?;
    quality::say_chosen(&climbed);
    station.settings.quality = climbed.point().with_seed(station.settings.quality.seed);
    Ok(Some(QualityBudget::new(&climbed)))
}

/// Runs a session and prints its status; `each` also receives every status.
pub(crate) fn run(
    station: &Station,
    limits: Limits,
    parts: Parts,
    mut each: impl FnMut(&Status),
) -> Result<Summary, Failure> {
    let mut settings = station.pipeline;
    // Ends a generator's run that is far over its budget, not only one that hangs.
    settings.hang_ms = settings.hang_ms.min(station.generator.budget().stop_after.as_secs_f64() * 1e3);
    let mut line = StatusLine::new();
    let summary = Pipeline::run(&settings, limits, parts, |now| {
        line.set(now.elapsed_s, || status(now));
        each(now);
    });
    drop(line);
    summary.other()
}

fn status(status: &Status) -> String {
    let latency = status.latency_ms.map_or_else(|| "-".to_owned(), |ms| format!("{ms:.0} ms"));
    let frozen = if status.frozen { "  frozen" } else { "" };
    format!(
        "{:7.1} s  {:5.1} frames/s  latency {latency}  pose {}  {}{frozen}  {} presented, {} dropped",
        status.elapsed_s,
        status.frames_per_s,
        status.tracking.name(),
        status.source.name(),
        status.presented,
        status.dropped,
    )
}

/// Prints the counts of tracker measurements that were not used.
pub(crate) fn say_left_out(counters: &Counters) {
    let named = counters.named().filter(|(name, count)| *count > 0 && !["measurements", "used"].contains(name));
    let list: Vec<String> = named.map(|(name, count)| format!("{name} {count}")).collect();
    if !list.is_empty() {
        eprintln!("tracker: {}", list.join(", "));
    }
}
