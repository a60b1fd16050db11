//! Operating points of a session: what this station and machine can choose from.

mod times;

use insonify::generator::{Generator, Provider};
use insonify::pipeline::{Candidate, FrameBudget, PointController};
use insonify::pose::Pose;
use insonify::render::{FrameQuality, Renderer};
use insonify::station::{SceneSource, Station};
use insonify::tradeoff::{ErrorTable, ExpectedErrors, GeneratorKey};

use super::{Classify, Failure};
use times::{Bench, Times};

/// Part of a frame's period that rendering and generating may take: the rest goes to the displays.
const PART_OF_PERIOD: f64 = 0.9;
/// Error of a generator that nobody has measured, over that of the frames below it.
const UNMEASURED: f64 = 0.9;
/// Part of the present error that another point must have to be worth a hint.
const HINT: f64 = 0.9;

/// Name of a station's scene in the table of errors.
pub(crate) fn scene_name(station: &Station) -> String {
    match &station.scene {
        SceneSource::ObstetricPhantom(_) => "obstetric".to_owned(),
        SceneSource::File(path) => path.file_stem().map(|s| s.to_string_lossy().into_owned()).unwrap_or_default(),
    }
}

/// Identity of a generator in the table of errors.
pub(crate) fn key(generator: &Generator) -> GeneratorKey {
    let manifest = generator.manifest();
    GeneratorKey { name: manifest.name.clone(), sha256: manifest.sha256.clone() }
}

/// The controller of a live session; the station's settings become those of its first point. `None` if there is nothing
/// to choose: a fixed quality without generators. Reports the choice, and what would fit better than a fixed one.
pub(crate) fn controller(
    renderer: &mut Renderer,
    station: &mut Station,
    generators: &mut [Generator],
    pose: Option<Pose>,
) -> Result<Option<PointController>, Failure> {
    if station.quality_budget_ms.is_none() && generators.is_empty() {
        return Ok(None);
    }
    // The tracked pose is not known yet; the session later corrects a wrong choice.
    let pose = pose.or(station.default_pose).unwrap_or(Pose::IDENTITY);
    let period_ms = 1e3 / station.pipeline.frame_rate_hz;
    let most_ms = PART_OF_PERIOD * period_ms;
    let frame_ms = station.quality_budget_ms.unwrap_or(most_ms).min(most_ms);
    if station.quality_budget_ms.is_some_and(|budget_ms| budget_ms > most_ms) {
        eprintln!(
            "quality: frames may take {most_ms:.0} ms, {:.0} % of the period at {} frames/s; quality.budget_ms is more",
            100.0 * PART_OF_PERIOD,
            station.pipeline.frame_rate_hz
        );
    }
    let apart = !(renderer.on_host() && station.generator.provider == Provider::Cpu);
    let names: Vec<String> = generators.iter().map(|g| g.manifest().name.clone()).collect();
    let table = ErrorTable::shipped().other()?;
    let expected = table.expected(&scene_name(station), &station.probe);
    let own = FrameQuality::of(&station.settings);
    let mut qualities = expected.qualities();
    // A hint for a fixed quality looks at all angles.
    let angles_open = station.angles_open || station.quality_budget_ms.is_none();
    qualities.retain(|quality| fits(quality, &own, angles_open));
    let as_here = |quality: FrameQuality| FrameQuality { aperture: quality.aperture && own.aperture, ..quality };
    for quality in generators.iter().flat_map(|g| g.manifest().lq()).map(as_here).chain([own]) {
        if !qualities.contains(&quality) {
            qualities.push(quality);
        }
    }
    qualities.sort_by_key(|quality| (quality.paths(), quality.layers, quality.angles));
    let mut bench = Bench { station, renderer, generators, pose, frame_ms };
    let (times, measured) = Times::known_or_measured(&mut bench, &qualities)?;
    let all = candidates(&expected, &qualities, &own, generators, &times);
    let budget = |frame_ms| FrameBudget { frame_ms, run_ms: station.generator.budget_ms, apart, spread: times.spread };
    let controller = match station.quality_budget_ms {
        Some(_) => PointController::new(all, names, budget(Some(frame_ms))),
        None => {
            let fixed = of_fixed_quality(own, generators, &times);
            let fixed = PointController::new(fixed, names.clone(), budget(None));
            let free = FrameBudget { run_ms: f64::INFINITY, ..budget(Some(frame_ms)) };
            if let (Some(fixed), Some(best)) = (&fixed, PointController::new(all, names, free)) {
                hint(&expected, fixed, &best, generators, frame_ms);
            }
            fixed
        }
    };
    let Some(controller) = controller else { return Ok(None) };
    let aperture = station.settings.effects.of(insonify::render::Effect::Aperture);
    if station.quality_budget_ms.is_some() {
        station.settings = controller.point().quality.apply(&station.settings, aperture);
        say(&controller, &expected, measured);
    }
    renderer.reconfigure(&station.probe, &station.settings)?;
    Ok(Some(controller))
}

/// Whether a quality of the table may be chosen: the station's own angles, unless they are open, and the aperture only
/// where the station has it.
fn fits(quality: &FrameQuality, own: &FrameQuality, angles_open: bool) -> bool {
    (angles_open || quality.angles == own.angles) && (own.aperture || !quality.aperture)
}

/// All points with their errors and times.
fn candidates(
    expected: &ExpectedErrors<'_>,
    qualities: &[FrameQuality],
    own: &FrameQuality,
    generators: &[Generator],
    times: &Times,
) -> Vec<Candidate> {
    let raw = qualities.iter().filter_map(|&quality| {
        let (error, render_ms) = (expected.of(quality, None)?, times.render(quality, false)?);
        Some(Candidate { quality, generator: None, error, render_ms, run_ms: 0.0 })
    });
    let generated = generators.iter().enumerate();
    let generated = generated.flat_map(|(index, generator)| {
        generator.manifest().lq().into_iter().map(move |quality| (index, generator, quality))
    });
    let generated = generated.filter_map(|(index, generator, trained_on)| {
        let quality = FrameQuality { aperture: trained_on.aperture && own.aperture, ..trained_on };
        let known = expected.of(trained_on, Some(&key(generator)));
        // Of a generator that was measured when it was trained, else a guess: that it was worth training.
        let trained = || generator.manifest().quality.as_ref().map(|q| 255.0 * 10f64.powf(-q.psnr_db / 20.0));
        let guessed = || expected.of(quality, None).map(|error| UNMEASURED * error);
        let (render_ms, run_ms) = (times.render(quality, generator.manifest().reads_maps())?, times.run(generator)?);
        Some(Candidate {
            quality,
            generator: Some(index),
            error: known.or_else(trained).or_else(guessed)?,
            render_ms,
            run_ms,
        })
    });
    raw.chain(generated).collect()
}

/// Points of a fixed quality: the station's generators in their order, then the rendered frame.
fn of_fixed_quality(quality: FrameQuality, generators: &[Generator], times: &Times) -> Vec<Candidate> {
    let render_ms = times.render(quality, true).unwrap_or_default();
    let of = |(rank, generator): (usize, &Generator)| {
        let run_ms = times.run(generator)?;
        Some(Candidate { quality, generator: Some(rank), error: 1.0 + rank as f64, render_ms, run_ms })
    };
    let raw = Candidate { quality, generator: None, error: 1.0 + generators.len() as f64, render_ms, run_ms: 0.0 };
    generators.iter().enumerate().filter_map(of).chain([raw]).collect()
}

/// Prints the chosen point.
fn say(controller: &PointController, expected: &ExpectedErrors<'_>, measured: bool) {
    let point = controller.point();
    let (ms, limit_ms) = (controller.expected_ms(&point), controller.limit_ms());
    let when = if measured { "measured now" } else { "as measured before" };
    let whose = if expected.measured { "" } else { " in the mean of the shipped scenes" };
    if ms > limit_ms {
        tracing::warn!(
            "quality: nothing keeps {limit_ms:.0} ms here; {} is the least, and takes {ms:.1} ms",
            controller.name(&point)
        );
        return;
    }
    eprintln!(
        "quality: {}, {ms:.0} ms of {limit_ms:.0} ({when}), {:.1} grey levels off the converged picture{whose}",
        controller.name(&point),
        point.error
    );
}

/// Tells of a point that would fit better than a fixed quality.
fn hint(
    expected: &ExpectedErrors<'_>,
    fixed: &PointController,
    best: &PointController,
    generators: &[Generator],
    frame_ms: f64,
) {
    let point = fixed.point();
    let key = point.generator.and_then(|index| generators.get(index)).map(key);
    let Some(error) = expected.of(point.quality, key.as_ref()) else { return };
    let better = best.point();
    if better.error < HINT * error && best.expected_ms(&better) <= frame_ms {
        eprintln!(
            "quality: {} is fixed, {error:.1} grey levels off the converged picture; {} would take {:.0} ms and be off by {:.1}: \
             `quality.budget_ms = {frame_ms:.0}` in place of rays and layers lets the station choose",
            fixed.name(&point),
            best.name(&better),
            best.expected_ms(&better),
            better.error
        );
    }
}
