//! Common parts of live sessions: generators, status and dropped frames.

use anyhow::anyhow;
use insonify::chooser::{self, PointController};
use insonify::generator::{Generator, GeneratorError, Kind, load_generators};
use insonify::pipeline::{FrameGenerators, Generators, Limits, Parts, Pipeline, Status, Summary};
use insonify::pose::{Counters, Pose};
use insonify::render::{Choice, Effect, Renderer};
use insonify::station::Station;

use super::status_line::StatusLine;
use super::{Classify, Failure, terminal};

/// Generators of a session, and the controller of its operating point.
#[derive(Default)]
pub(crate) struct Chosen {
    /// Generators; none: raw frames are shown.
    pub(crate) generators: Option<Box<dyn FrameGenerators>>,
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
    let start = chooser::choose(renderer, station, &mut generators, pose)?;
    for message in &start.messages {
        eprintln!("{message}");
    }
    let generators = Generators::new(generators).map(|generators| Box::new(generators) as Box<dyn FrameGenerators>);
    Ok(Chosen { generators, points: start.controller, aperture })
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
    let mut line = StatusLine::new();
    let summary = Pipeline::run(&station.pipeline, limits, parts, |now| {
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
    use std::path::Path;
    use std::sync::Arc;
    use std::time::Duration;

    use insonify::pipeline::{
        Clock, FrameRenderer, GenerateError, ImageShape, RenderFault, RendererFactory, SimulatedClock, StandingPose,
        Stop, Terminator,
    };
    use insonify::pose::TrackingState;
    use insonify::render::{Frame, RenderSettings};
    use insonify::sink::live::FrameSource;
    use insonify::transducer::Probe;

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
            source: FrameSource::Raw,
            frozen: false,
            dropped: 0,
            notice: None,
        };
        assert!(status(&now).contains("14.1 frames/s"), "{}", status(&now));
        (now.frames_per_s, now.silent_s) = (0.0, Some(30.4));
        assert!(status(&now).contains("no frame for 30 s") && !status(&now).contains("frames/s"), "{}", status(&now));
    }

    /// A renderer of one pixel.
    struct Pixel;

    impl FrameRenderer for Pixel {
        fn shape(&self) -> ImageShape {
            ImageShape { width: 1, height: 1, pixel_mm: 1.0 }
        }

        fn submit(&mut self, _: &Pose) -> Result<(), RenderFault> {
            Ok(())
        }

        fn receive(&mut self, frame: &mut Frame) -> Result<(), RenderFault> {
            (frame.width, frame.height) = (1, 1);
            for map in [&mut frame.bmode, &mut frame.segmentation, &mut frame.mask] {
                map.clear();
                map.push(1);
            }
            frame.attenuation.clear();
            frame.attenuation.push(0.0);
            Ok(())
        }

        fn reconfigure(&mut self, _: &Probe, _: &RenderSettings) -> Result<(), RenderFault> {
            Ok(())
        }
    }

    impl RendererFactory for Pixel {
        fn build(&mut self, _: &Probe, _: &RenderSettings) -> Result<Box<dyn FrameRenderer>, RenderFault> {
            Ok(Box::new(Self))
        }
    }

    /// A generator whose runs take 400 ms.
    struct Slow(Arc<dyn Clock>);

    impl FrameGenerators for Slow {
        fn name(&self, _: usize) -> &str {
            "slow"
        }

        fn generate(&mut self, _: usize, _: &Frame, out: &mut Vec<u8>) -> Result<(), GenerateError> {
            self.0.sleep_until(self.0.now() + Duration::from_millis(400));
            out.push(2);
            Ok(())
        }

        fn terminator(&self) -> Option<Terminator> {
            None
        }
    }

    /// Counted hangs of a session of the live station with these lines in its `[pipeline]`.
    fn hung(pipeline: &str) -> u64 {
        let directory = Path::new(env!("CARGO_MANIFEST_DIR")).join("configs");
        let text = std::fs::read_to_string(directory.join("live.toml")).unwrap();
        let text = text.replace("[pipeline]", &format!("[pipeline]\n{pipeline}"));
        let station = Station::parse(&text, &directory).unwrap();
        assert_eq!(station.generator.run_budget_ms, 64.0);
        let clock: Arc<dyn Clock> = Arc::new(SimulatedClock::new());
        let parts = Parts {
            clock: clock.clone(),
            stop: Stop::new(&clock),
            poses: Box::new(StandingPose(Pose::IDENTITY)),
            renderer: Box::new(Pixel),
            factory: Box::new(Pixel),
            probe: station.probe,
            render: station.settings,
            points: None,
            aperture: Choice::Auto,
            generators: Some(Box::new(Slow(clock))),
            sinks: Vec::new(),
            log: None,
            controls: tokio::sync::mpsc::channel(1).1,
            observer: None,
            before: Vec::new(),
            after: Vec::new(),
        };
        let limits = Limits { duration: Some(Duration::from_secs(5)), frames: None };
        let generator = run(&station, limits, parts, |_| ()).unwrap().generator.unwrap();
        assert!(generator.done > 5, "{generator:?}");
        generator.hung
    }

    #[test]
    fn a_run_hangs_after_the_stations_own_time_and_not_after_its_budget() {
        assert_eq!(hung(""), 0, "5 s by default");
        assert!(hung("hang_ms = 200") > 5);
    }
}
