//! Errors of frames against wave theory, with and without an effect.

use serde::{Deserialize, Serialize};

use super::bench::{Bench, silent};
use super::half_contact::HalfContact;
use super::rig::Rig;
use super::shadow::Shadow;
use super::slide::Slide;
use super::tilted_face::{Axis, TiltedFace};
use super::wavy_border::WavyBorder;
use super::{Check, SelfTestError, Truth};
use crate::anatomy::{Bvh, Scene};
use crate::render::{Backend, Choice, RenderSettings, Renderer};
use crate::transducer::Probe;

/// Root mean square errors against theory, with and without an effect.
#[derive(Debug, Clone, PartialEq, Serialize, Deserialize)]
pub struct TruthError {
    /// Name of the effect, or of the post-processing step.
    pub effect: String,
    /// Compared quantity.
    pub quantity: String,
    /// Unit of the errors; empty for ratios.
    pub unit: String,
    /// Number of values in the errors: only values with the smallest tolerance.
    pub values: usize,
    /// Smallest tolerance of a single value, in `unit`.
    pub tolerance: f64,
    /// Error without the effect.
    pub without: f64,
    /// Error with the effect.
    pub with: f64,
}

/// Measures the RMS error against wave theory with and without each effect that theory covers, at one ray and one
/// layer. `progress` gets the number of finished comparisons and the total.
///
/// # Errors
/// A device that fails.
pub(crate) fn truth_errors(
    backend: &Backend,
    progress: &dyn Fn(usize, usize),
) -> Result<Vec<TruthError>, SelfTestError> {
    let mut bench = Bench::new(silent(1540.0, 1.5));
    let families: [Box<dyn Truth>; 6] = [
        Box::new(Shadow::new(&mut bench)),
        Box::new(HalfContact::new(&mut bench)),
        Box::new(Slide::new(&mut bench)),
        Box::new(TiltedFace::new(&mut bench, Axis::Lateral)),
        Box::new(WavyBorder::new(&mut bench)),
        Box::new(TiltedFace::new(&mut bench, Axis::Depth)),
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
        // Only values with the smallest tolerance count; very low levels have a wider one.
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

/// Root mean square difference from theory of the checks marked in `counted`.
fn rms(checks: &[Check], counted: &[bool]) -> f64 {
    let squares: Vec<f64> = checks
        .iter()
        .zip(counted)
        .filter(|(_, counted)| **counted)
        .map(|(check, _)| (check.measured - check.expected).powi(2))
        .collect();
    (squares.iter().sum::<f64>() / squares.len().max(1) as f64).sqrt()
}
