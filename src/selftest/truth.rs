//! Errors of frames against wave theory, with an effect and without it.

use serde::{Deserialize, Serialize};

use super::bench::{Bench, silent};
use super::rig::Rig;
use super::shadow::Shadow;
use super::slide::Slide;
use super::tilted_face::{TiltedFace, Way};
use super::{Check, SelfTestError};
use crate::anatomy::{Bvh, Scene};
use crate::render::{Backend, Choice, Effect, RenderError, RenderSettings, Renderer};
use crate::transducer::Probe;

/// Specimens whose frames one effect brings near theory.
pub(super) trait Truth {
    /// The effect.
    fn effect(&self) -> Effect;

    /// Measured quantity.
    fn quantity(&self) -> &'static str;

    /// Measures frames with the effect as chosen, and compares them with theory.
    fn compare(&self, rig: &mut Rig, choice: Choice) -> Result<Vec<Check>, RenderError>;
}

/// Root mean square errors against wave theory.
#[derive(Debug, Clone, PartialEq, Serialize, Deserialize)]
pub struct TruthError {
    /// The effect's name.
    pub effect: String,
    /// Compared quantity.
    pub quantity: String,
    /// Unit of the errors; empty for ratios.
    pub unit: String,
    /// Number of compared values.
    pub values: usize,
    /// Accepted error of a single value.
    pub tolerance: f64,
    /// Error without the effect.
    pub without: f64,
    /// Error with it.
    pub with: f64,
}

/// Measures what each effect that wave theory speaks of does to the error of frames, at one ray and one layer.
/// `progress` gets the number of finished comparisons, and the total.
///
/// # Errors
/// A device that fails.
pub fn truth_errors(backend: &Backend, progress: &dyn Fn(usize, usize)) -> Result<Vec<TruthError>, SelfTestError> {
    let mut bench = Bench::new(silent(1540.0, 1.5));
    let families: [Box<dyn Truth>; 4] = [
        Box::new(Shadow::new(&mut bench)),
        Box::new(Slide::new(&mut bench)),
        Box::new(TiltedFace::new(&mut bench, Way::Lateral)),
        Box::new(TiltedFace::new(&mut bench, Way::Depth)),
    ];
    let new = |scene: &Scene, bvh: Bvh, probe: &Probe, settings: &RenderSettings| {
        Renderer::with_bvh(backend, scene, bvh, probe, settings)
    };
    let mut rig = Rig::new(&bench.scene()?, &new)?;
    let total = 2 * families.len();
    let mut errors = Vec::new();
    for (done, family) in families.iter().enumerate() {
        progress(2 * done, total);
        let without = family.compare(&mut rig, Choice::Off)?;
        progress(2 * done + 1, total);
        let with = family.compare(&mut rig, Choice::On)?;
        // Levels that theory leaves more room for are not of the mean.
        let tolerance = with.iter().map(|check| check.tolerance).fold(f64::INFINITY, f64::min);
        let counted: Vec<bool> = with.iter().map(|check| check.tolerance == tolerance).collect();
        errors.push(TruthError {
            effect: family.effect().name().to_owned(),
            quantity: family.quantity().to_owned(),
            unit: with.first().map_or_else(String::new, |check| check.unit.to_owned()),
            values: counted.iter().filter(|counted| **counted).count(),
            tolerance,
            without: rms(&without, &counted),
            with: rms(&with, &counted),
        });
    }
    progress(total, total);
    Ok(errors)
}

/// Root mean square difference of the counted values from theory.
fn rms(checks: &[Check], counted: &[bool]) -> f64 {
    let squares: Vec<f64> = checks
        .iter()
        .zip(counted)
        .filter(|(_, counted)| **counted)
        .map(|(check, _)| (check.measured - check.expected).powi(2))
        .collect();
    (squares.iter().sum::<f64>() / squares.len().max(1) as f64).sqrt()
}

#[cfg(test)]
pub(super) mod tests {
    /// Value in column `wanted` of the row of a fixture whose columns hold the given numbers.
    pub(in crate::selftest) fn fixture(text: &str, row: &[(&str, f64)], wanted: &str) -> f64 {
        let mut lines =
            text.lines().filter(|line| !line.starts_with('#')).map(|line| line.split(',').collect::<Vec<_>>());
        let head = lines.next().unwrap();
        let column = |name: &str| head.iter().position(|column| *column == name).unwrap();
        let number = |line: &[&str], name: &str| line[column(name)].parse::<f64>().unwrap();
        let found = lines.find(|line| row.iter().all(|&(name, value)| number(line, name) == value)).unwrap();
        number(&found, wanted)
    }
}
