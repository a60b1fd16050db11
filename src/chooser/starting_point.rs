//! The first operating point of a session.

use super::candidates::{Model, Open};
use super::control::{FrameBudget, PointController};
use super::times::{TimedStation, Times};
use crate::generator::{Generator, compute_device_of};
use crate::measuring::{ErrorTable, ExpectedErrors, MeasuringError, scene_name};
use crate::pose::{BySpeed, Pose, ProbeSpeed};
use crate::render::{Effect, FrameQuality, Renderer};
use crate::station::Station;

/// Fraction of a frame's period that rendering and generating may take. The rest is left to the displays.
const PART_OF_PERIOD: f64 = 0.9;
/// Largest ratio of another point's error to the present one at which the user gets a hint.
const HINT: f64 = 0.9;

/// Controller of a session at its first operating point, and sentences for its user.
#[derive(Debug, Default)]
pub struct StartingPoint {
    /// The controller; `None` if there is nothing to choose: a fixed quality without generators.
    pub controller: Option<PointController>,
    /// Sentences about the choice: the point with error and time; for a fixed quality, a better point if there is one.
    pub messages: Vec<String>,
}

/// Chooses the operating point of a live session from frames at `pose`, else at the station's pose. Applies the point
/// to the station's settings and to the renderer.
///
/// # Errors
/// The shipped error table can't be read, or a frame of the measurement can't be rendered. Points that don't fit
/// the device's memory, and generators that don't run, are left out with a warning.
pub fn choose(
    renderer: &mut Renderer,
    station: &mut Station,
    generators: &mut [Generator],
    pose: Option<Pose>,
) -> Result<StartingPoint, MeasuringError> {
    let mut messages = Vec::new();
    let budgeted = station.frame_budget_ms.is_some();
    // The default quality was not chosen by the user, so no hint compares it with others.
    let own = FrameQuality::of(&station.settings);
    if !budgeted && generators.is_empty() && own.paths() == 1 {
        return Ok(StartingPoint::default());
    }
    // The tracked pose is not known yet; the session later corrects a wrong choice.
    let pose = pose.or(station.default_pose).unwrap_or(Pose::IDENTITY);
    let frame_ms = frame_ms(station, &mut messages);
    let apart = !renderer.compute_device().shares_with(compute_device_of(station.generator.provider));
    let expected = ErrorTable::shipped()?.expected(&scene_name(station), &station.probe);
    let open = Open::of(station);
    let models: Vec<Model> = generators.iter().map(Model::of).collect();
    let names: Vec<String> = models.iter().map(|model| model.key.name.clone()).collect();
    let qualities = open.qualities(&expected, &models);
    let mut timed = TimedStation { station, renderer, generators, pose, frame_ms };
    let (times, measured) = Times::known_or_measured(&mut timed, &qualities, open.own)?;
    let all = open.candidates(&expected, &qualities, &models, &times);
    let budget =
        |frame_ms| FrameBudget { frame_ms, run_ms: station.generator.run_budget_ms, apart, spread: times.spread };
    let best = PointController::new(all, names.clone(), budget(Some(frame_ms)));
    let controller = if budgeted {
        match &best {
            Some(best) => {
                let aperture = station.settings.effects.of(Effect::Aperture);
                station.settings = best.point().quality.apply(&station.settings, aperture);
                messages.extend(report(best, &expected, measured));
            }
            None => tracing::warn!("quality: no operating point could be measured; {} stays", open.own),
        }
        best
    } else {
        let fixed = PointController::new(open.fixed(&models, &times), names, budget(None));
        if let (Some(fixed), Some(best)) = (&fixed, &best) {
            messages.extend(hint(&expected, fixed, best, &models, frame_ms));
        }
        fixed.filter(|_| !models.is_empty())
    };
    messages.extend(controller.as_ref().and_then(PointController::generator_reason).map(str::to_owned));
    renderer.reconfigure(&station.probe, &station.settings)?;
    Ok(StartingPoint { controller, messages })
}

/// Largest time of a frame, ms: the station's budget, limited to a fraction of the frame period.
fn frame_ms(station: &Station, messages: &mut Vec<String>) -> f64 {
    let rate_hz = station.pipeline.frame_rate_hz;
    let most_ms = PART_OF_PERIOD * 1e3 / rate_hz;
    let Some(frame_budget_ms) = station.frame_budget_ms else { return most_ms };
    if frame_budget_ms > most_ms {
        messages.push(format!(
            "quality: frames may take {most_ms:.0} ms, {:.0} % of the period at {rate_hz} frames/s; quality.frame_budget_ms is more",
            100.0 * PART_OF_PERIOD,
        ));
    }
    frame_budget_ms.min(most_ms)
}

/// A sentence about the chosen point. `None` if the point may exceed the budget, which is logged as a warning instead.
fn report(controller: &PointController, expected: &ExpectedErrors<'_>, measured: bool) -> Option<String> {
    let point = controller.point();
    let (ms, limit_ms) = (controller.expected_ms(&point), controller.limit_ms());
    let name = controller.name(&point);
    let when = if measured { "measured now" } else { "as measured before" };
    let whose = if expected.measured { "" } else { " in the mean of the shipped scenes" };
    if !controller.is_expected_to_fit(&point) {
        tracing::warn!("quality: no point is sure to keep {limit_ms:.0} ms here; {name} takes {ms:.1} ms ({when})");
        return None;
    }
    let BySpeed { at_rest, slow, fast } = point.error;
    let moving = if slow == at_rest && fast == at_rest {
        String::new()
    } else {
        format!(" at rest, {slow:.1} slow, {fast:.1} fast")
    };
    Some(format!(
        "quality: {name}, {ms:.0} ms of {limit_ms:.0} ({when}), {at_rest:.1} grey levels off the converged \
         picture{whose}{moving} ({})",
        expected.measure
    ))
}

/// A sentence about a point that is much better than the fixed quality and keeps the budget; `None` if there is none.
fn hint(
    expected: &ExpectedErrors<'_>,
    fixed: &PointController,
    best: &PointController,
    models: &[Model],
    frame_ms: f64,
) -> Option<String> {
    let point = fixed.point();
    let key = point.generator.and_then(|index| models.get(index)).map(|model| &model.key);
    let error = expected.of(point.quality, key, ProbeSpeed::AtRest)?;
    let better = best.point();
    let worth = better.error.at_rest < HINT * error && best.is_expected_to_fit(&better);
    worth.then(|| {
        format!(
            "quality: {} is fixed, {error:.1} grey levels off the converged picture; {} would take {:.0} ms and be off by {:.1} ({}): \
             `quality.frame_budget_ms = {frame_ms:.0}` in place of rays and layers lets the station choose",
            fixed.name(&point),
            best.name(&better),
            best.expected_ms(&better),
            better.error.at_rest,
            expected.measure
        )
    })
}
