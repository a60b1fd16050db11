//! Self-test: comparison of a device's frames with acoustic theory.
//!
//! Specimens with closed-form answers share one scene, so shaders are compiled only once. Each family of checks builds
//! its own specimens and measures them on complete frames: lines, grey levels and maps. Intermediate data of the passes
//! are read only for the comparison with the f64 twins.

pub mod bench;
pub mod measure;

mod beam;
mod date;
mod device;
mod fixture;
mod half_contact;
mod image;
mod interfaces;
mod looks;
mod refraction;
mod rig;
mod shadow;
mod slide;
mod speckle;
mod tilted_face;
mod truth;
mod wavy_border;

use std::time::{Instant, SystemTime, UNIX_EPOCH};

use serde::Serialize;
use thiserror::Error;

use crate::anatomy::{Bvh, Scene, TissueError};
#[cfg(feature = "test-hooks")]
use crate::render::TestHooks;
use crate::render::{Backend, Choice, Effect, RenderError, RenderSettings, Renderer};
use crate::transducer::Probe;
use bench::{Bench, silent};
pub(crate) use looks::{LookError, look_errors};
use rig::{NewRenderer, Rig};
pub use truth::TruthError;
pub(crate) use truth::truth_errors;

/// Errors of the self-test.
#[derive(Debug, Error)]
pub enum SelfTestError {
    /// A frame could not be rendered.
    #[error(transparent)]
    Render(#[from] RenderError),
    /// A specimen's tissue is outside its range: a fault of this build.
    #[error("a specimen of the self-test: {0}")]
    Tissue(#[from] TissueError),
}

/// A measured quantity with its theoretical value.
#[derive(Debug, Clone, PartialEq, Serialize)]
pub struct Check {
    /// Group of the check: `Fresnel`, `Snell`, …
    pub group: &'static str,
    /// Measured quantity.
    pub name: String,
    /// Unit of `expected`, `measured` and `tolerance`; empty for ratios.
    pub unit: &'static str,
    /// Theoretical value.
    pub expected: f64,
    /// Measured value; NaN if the frames don't show it at all.
    pub measured: f64,
    /// Largest accepted difference of `measured` from `expected`.
    pub tolerance: f64,
    /// Whether the difference is within the tolerance.
    pub passed: bool,
}

impl Check {
    fn new(
        group: &'static str,
        name: impl Into<String>,
        unit: &'static str,
        expected: f64,
        measured: f64,
        tolerance: f64,
    ) -> Self {
        // A NaN fails this comparison.
        let passed = (measured - expected).abs() <= tolerance;
        Self { group, name: name.into(), unit, expected, measured, tolerance, passed }
    }

    /// A check of a dimensionless quantity that should be 0.
    fn zero(group: &'static str, name: impl Into<String>, measured: f64, tolerance: f64) -> Self {
        Self::new(group, name, "", 0.0, measured, tolerance)
    }
}

/// Result of a self-test on one device.
#[derive(Debug, Clone, PartialEq, Serialize)]
pub struct Report {
    /// Version of insonify.
    pub version: &'static str,
    /// Name of the device, or of the host's processor.
    pub device: String,
    /// Driver of the device.
    pub driver: String,
    /// Implementation of the pass `trace` on a device: by path, by lanes, or either by the number of paths. `None` on
    /// the host.
    #[serde(skip_serializing_if = "Option::is_none")]
    pub trace: Option<String>,
    /// Whether frames are rendered on a CPU, by the host or by a software device.
    pub software: bool,
    /// Start of the test, ISO 8601 in UTC.
    pub date: String,
    /// Duration of the test, s.
    pub duration_s: f64,
    /// Whether every check passed.
    pub passed: bool,
    /// Checks, in a fixed order.
    pub checks: Vec<Check>,
}

impl Report {
    /// Checks that did not pass.
    pub fn failed(&self) -> impl Iterator<Item = &Check> {
        self.checks.iter().filter(|check| !check.passed)
    }
}

/// Checks that share specimens.
trait Family {
    /// Names of the groups to which the checks belong.
    fn groups(&self) -> &'static [&'static str];

    /// Renders the specimens and measures them.
    fn measure(&self, rig: &mut Rig) -> Result<Vec<Check>, RenderError>;
}

/// Checks whose specimens agree with theory only if one effect is simulated.
trait Truth {
    /// The simulated effect.
    fn effect(&self) -> Effect;

    /// Measured quantity.
    fn quantity(&self) -> &'static str;

    /// Compares frames with theory, with the effect on or off.
    fn compare(&self, rig: &mut Rig, choice: Choice) -> Result<Vec<Check>, RenderError>;
}

/// Runs every check on `backend`. `progress` gets the number of finished families of checks and the total.
///
/// # Errors
/// A device that fails. A wrong result is not an error, but clears [`Report::passed`].
pub fn run(backend: &Backend, progress: &dyn Fn(usize, usize)) -> Result<Report, SelfTestError> {
    let new = |scene: &Scene, bvh: Bvh, probe: &Probe, settings: &RenderSettings| {
        Renderer::with_bvh(backend, scene, bvh, probe, settings)
    };
    checked(backend, &new, None, progress)
}

/// Runs [`run`]'s checks with passes modified by a test. With a `group`, runs only that group's families, until one of
/// its checks has failed.
///
/// # Errors
/// Errors of [`run`].
#[cfg(feature = "test-hooks")]
pub fn run_with_hooks(
    backend: &Backend,
    hooks: &TestHooks,
    group: Option<&str>,
    progress: &dyn Fn(usize, usize),
) -> Result<Report, SelfTestError> {
    let new = |scene: &Scene, bvh: Bvh, probe: &Probe, settings: &RenderSettings| {
        Renderer::with_hooks(backend, scene, bvh, probe, settings, hooks)
    };
    checked(backend, &new, group, progress)
}

/// Runs the checks on frames of the renderer created by `new`. With `only`, runs only that group's families, until one
/// of its checks has failed.
fn checked(
    backend: &Backend,
    new: &NewRenderer<'_>,
    only: Option<&str>,
    progress: &dyn Fn(usize, usize),
) -> Result<Report, SelfTestError> {
    let (date, started) = (SystemTime::now().duration_since(UNIX_EPOCH).map_or(0, |d| d.as_secs()), Instant::now());
    let mut bench = Bench::new(silent(1540.0, 1.5));
    let families: [Box<dyn Family>; 11] = [
        Box::new(interfaces::Interfaces::new(&mut bench)),
        Box::new(refraction::Refraction::new(&mut bench)),
        Box::new(tilted_face::TiltedFace::new(&mut bench, tilted_face::Axis::Lateral)),
        Box::new(wavy_border::WavyBorder::new(&mut bench)),
        Box::new(beam::Beam::new(&mut bench)),
        Box::new(shadow::Shadow::new(&mut bench)),
        Box::new(half_contact::HalfContact::new(&mut bench)),
        Box::new(speckle::Speckle::new(&mut bench)),
        Box::new(slide::Slide::new(&mut bench)),
        Box::new(image::Image::new(&mut bench)),
        Box::new(device::Device::new(&mut bench)),
    ];
    let mut rig = Rig::new(&bench.scene()?, new)?;
    let mut checks = Vec::new();
    for (done, family) in families.iter().enumerate() {
        progress(done, families.len());
        let failed = checks.iter().any(|check: &Check| Some(check.group) == only && !check.passed);
        if only.is_some_and(|group| failed || !family.groups().contains(&group)) {
            continue;
        }
        let measured = family.measure(&mut rig)?;
        debug_assert!(measured.iter().all(|check| family.groups().contains(&check.group)), "{:?}", family.groups());
        checks.extend(measured);
    }
    checks.extend(rig.checks());
    // Sorts the checks by group, in order of each group's first check.
    let groups: Vec<&str> = checks.iter().map(|check| check.group).collect();
    checks.sort_by_key(|check| groups.iter().position(|group| *group == check.group));
    progress(families.len(), families.len());
    Ok(Report {
        version: env!("CARGO_PKG_VERSION"),
        device: backend.name(),
        driver: backend.driver(),
        trace: backend.trace(),
        software: backend.is_software(),
        date: date::utc(date),
        duration_s: started.elapsed().as_secs_f64(),
        passed: checks.iter().all(|check| check.passed),
        checks,
    })
}
