//! Common parts of live sessions: generators, status and dropped frames.

use anyhow::anyhow;
use insonify::generator::{Generator, GeneratorError, Kind, load_generators};
use insonify::pipeline::{Enhancer, Generators, Limits, Parts, Pipeline, PointController, Status, Summary};
use insonify::pose::{Counters, Pose};
use insonify::render::{Choice, Effect, Renderer};
use insonify::station::Station;

use super::operating_points;
use super::status_line::StatusLine;
use super::{Classify, Failure, terminal};

/// Times its budget after which a generator's run is ended.
const RUN_ENDED: f64 = 2.0;

/// Generators of a session, and the controller of its operating point.
#[derive(Default)]
pub(crate) struct Chosen {
    /// Generators; none: rendered frames are shown.
    pub(crate) enhancer: Option<Box<dyn Enhancer>>,
    /// Controller; none: the quality stays as set.
    pub(crate) points: Option<PointController>,
    /// The station's choice for the aperture.
    pub(crate) aperture: Choice,
}

/// Loads the station's generators, unless they aren't wanted, and chooses the operating point at `pose`, else at the
/// station's. The station's settings and the renderer become those of the point.
pub(crate) fn choose(
    renderer: &mut Renderer,
    station: &mut Station,
    pose: Option<Pose>,
    generate: bool,
) -> Result<Chosen, Failure> {
    let aperture = station.settings.effects.of(Effect::Aperture);
    let mut generators = if generate { generators(station)? } else { Vec::new() };
    let points = operating_points::controller(renderer, station, &mut generators, pose)?;
    let enhancer = Generators::new(generators).map(|generators| Box::new(generators) as Box<dyn Enhancer>);
    Ok(Chosen { enhancer, points, aperture })
}

/// The station's generators; none without models, without ONNX Runtime, or if every model is refused. Failures are logged
/// as warnings, and the session shows rendered images.
fn generators(station: &Station) -> Result<Vec<Generator>, Failure> {
    let loaded = match load_generators(&station.generator, station.tissues.names()) {
        Ok(loaded) => loaded,
        Err(error) => {
            tracing::warn!("no generator runs, the rendered image is shown: {error}");
            return Ok(Vec::new());
        }
    };
    for refused in &loaded.refused {
        // A requested provider that is unavailable is an error, never a silent fallback.
        if let GeneratorError::Provider { .. } = refused.error {
            return Err(Failure::Input(anyhow!("{}: {}", refused.path.display(), refused.error)));
        }
        tracing::warn!("{} is not used: {}", refused.path.display(), refused.error);
    }
    for generator in &loaded.generators {
        if generator.manifest().kind == Kind::FixedFilter {
            eprintln!("generator: {}: a fixed filter, no trained generator", generator.manifest().name);
        }
    }
    Ok(loaded.generators)
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
    settings.hang_ms = settings.hang_ms.min(RUN_ENDED * station.generator.budget_ms);
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
    let rate = match status.silent_s {
        Some(silent_s) => format!("no frame for {silent_s:.0} s"),
        None => format!("{:5.1} frames/s", status.frames_per_s),
    };
    let frozen = if status.frozen { "  frozen" } else { "" };
    format!(
        "{:7.1} s  {rate}  latency {latency}  pose {}  {}{frozen}  {} presented, {} dropped",
        status.elapsed_s,
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
        terminal::say(&format!("tracker: {}", list.join(", ")));
    }
}

#[cfg(test)]
mod tests {
    use insonify::pose::TrackingState;
    use insonify::sink::live::FrameSource;

    use super::*;

    #[test]
    fn the_line_says_when_no_frame_came() {
        let mut now = Status {
            elapsed_s: 60.0,
            presented: 500,
            frames_per_s: 14.1,
            silent_s: None,
            latency_ms: None,
            tracking: TrackingState::Good,
            source: FrameSource::LowQuality,
            frozen: false,
            dropped: 0,
            notice: None,
        };
        assert!(status(&now).contains("14.1 frames/s"), "{}", status(&now));
        (now.frames_per_s, now.silent_s) = (0.0, Some(30.4));
        assert!(status(&now).contains("no frame for 30 s") && !status(&now).contains("frames/s"), "{}", status(&now));
    }
}
