//! The obstetric phantom: a pregnant abdomen, made by signed-distance modelling from [`Parameters`].
//!
//! Scene frame: x mother's left, y cranial, z anterior, in mm, with the origin at the centre of the uterine cavity. By
//! default the fetus is 22 weeks old and lies head down on its right side, its back to the mother's right. A probe on
//! the belly thus faces the side of the head, and the midline echo runs across the beam. The placenta is anterior,
//! left and fundal.
//!
//! [`organs`] lists every closed surface as a solid, [`build`] meshes them, [`cached`] stores the file, and
//! [`landmarks()`] gives positions.
//!
//! An organ is one function in `fetus/` or `mother/` that returns [`Organ`]s. Its sizes come from [`Biometry`], its
//! position from [`Attitude`]. A new organ is one more entry in its body's list.

pub mod attitude;
pub mod biometry;
mod budget;
mod cache;
mod fetal_surfaces;
mod fetus;
mod fiducials;
mod fragments;
mod landmarks;
mod meshing;
mod mother;
mod movement;
mod organ;
pub mod parameters;
mod placement;
mod planes;
mod spine;
mod surface_list;
#[cfg(test)]
mod tests;
mod vary;

use std::sync::atomic::{AtomicUsize, Ordering};

use rayon::prelude::*;
use serde::{Deserialize, Serialize};
use thiserror::Error;

pub use attitude::Attitude;
pub use biometry::Biometry;
pub use cache::cached_or_temporary;
pub use cache::{CacheError, PhantomFile, cached};
pub use fetal_surfaces::{FETAL_SKIN, FETAL_SURFACES};
pub use fiducials::fiducials;
pub use insonify_core::settings::SCALE_RANGE;
use insonify_core::settings::SceneSettings;
pub use landmarks::{Landmarks, landmarks};
pub use movement::movement;
pub use organ::{Body, Organ};
pub use parameters::{Lie, Parameters, ParametersError, PlacentaSite};
pub use planes::planes;
pub use surface_list::SurfaceList;

use insonify_core::anatomy::Skin;
pub use insonify_core::anatomy::Wall;

pub use insonify_core::anatomy::export::LabelledSurface as PhantomSurface;

/// Triangles of the fetus at scale 1.
pub const FETUS_TRIANGLES: usize = 400_000;
/// Triangles of the mother, with placenta, cord and fluid, at scale 1.
pub const MOTHER_TRIANGLES: usize = 275_000;

/// Options of a phantom.
#[derive(Debug, Clone, Copy, PartialEq, Serialize, Deserialize)]
pub struct PhantomOptions {
    /// Factor on the triangle budgets, within [`SCALE_RANGE`].
    pub scale: f64,
    /// Parameters of the individual.
    #[serde(flatten)]
    pub parameters: Parameters,
}

impl Default for PhantomOptions {
    fn default() -> Self {
        Self::from(&SceneSettings::default())
    }
}

/// Phantom of a station.
impl From<&SceneSettings> for PhantomOptions {
    fn from(scene: &SceneSettings) -> Self {
        Self { scale: scene.phantom_scale, parameters: scene.into() }
    }
}

/// Progress of a build. Calls come from several threads; `done` never exceeds `total`.
#[derive(Debug, Clone, Copy, PartialEq, Eq)]
pub struct Progress {
    /// Completed steps.
    pub done: usize,
    /// Total steps.
    pub total: usize,
}

/// Errors in building the phantom.
#[derive(Debug, Error, Clone, PartialEq)]
pub enum PhantomError {
    /// A scale that is not in range.
    #[error("the phantom's scale is {scale}; it must lie in {}..={}", SCALE_RANGE.start(), SCALE_RANGE.end())]
    Scale {
        /// Requested scale.
        scale: f64,
    },
    /// A parameter outside its range.
    #[error(transparent)]
    Parameters(#[from] ParametersError),
    /// Too few triangles: a rib or a vessel would fall apart.
    #[error("the phantom's scale is {scale}; its finest parts need at least {least:.3}")]
    ScaleTooSmall {
        /// Requested scale.
        scale: f64,
        /// Smallest scale that resolves every part.
        least: f64,
    },
}

/// All surfaces of the phantom as solids, the mother's first. Parameters are not checked here, but by [`build`].
pub fn organs(parameters: &Parameters) -> Vec<Organ> {
    let attitude = Attitude::of(parameters);
    let mut organs = mother::organs(parameters, &attitude);
    organs.extend(fetus::organs(&attitude));
    organs
}

/// Surfaces called `names` of a phantom with `parameters`, with cells of at most `cell_mm`; unknown names are ignored.
/// For measurements: the mesh is finer than the complete phantom's, and made faster.
pub fn parts(parameters: &Parameters, names: &[&str], cell_mm: f32) -> Vec<PhantomSurface> {
    let wanted: Vec<_> = organs(parameters).into_iter().filter(|organ| names.contains(&organ.name)).collect();
    wanted.par_iter().map(|organ| organ.surface(cell_mm.min(organ.coarsest_mm))).collect()
}

/// Skin of the mother, from her solid model.
pub fn skin(parameters: &Parameters) -> Skin {
    Skin::of_solid(mother::skin(parameters))
}

/// Builds the phantom: closed, outward-facing surfaces in ascending priority, the same on each run.
///
/// The fetus has [`FETUS_TRIANGLES`] and the mother [`MOTHER_TRIANGLES`] times the scale, within two percent.
/// `progress` is called after every step, possibly from several threads.
///
/// # Errors
/// A scale outside [`SCALE_RANGE`], a parameter outside its range, or a scale so small that fine parts would be lost.
pub fn build(
    options: &PhantomOptions,
    progress: &(dyn Fn(Progress) + Sync),
) -> Result<Vec<PhantomSurface>, PhantomError> {
    let PhantomOptions { scale, parameters } = *options;
    if !SCALE_RANGE.contains(&scale) {
        return Err(PhantomError::Scale { scale });
    }
    parameters.validate()?;
    let (mother, fetus): (Vec<Organ>, Vec<Organ>) =
        organs(&parameters).into_iter().partition(|o| o.body == Body::Mother);
    // One step per surface for its count, and one for its mesh.
    let total = 2 * (mother.len() + fetus.len());
    let done = AtomicUsize::new(0);
    let step = || progress(Progress { done: done.fetch_add(1, Ordering::Relaxed) + 1, total });

    let mut jobs = Vec::new();
    let mut least_scale = 0.0f64;
    for (organs, budget) in [(mother, MOTHER_TRIANGLES), (fetus, FETUS_TRIANGLES)] {
        let triangles = (budget as f64 * scale).round() as usize;
        match budget::cell_sizes_mm(&organs, triangles, &step) {
            Ok(sizes) => jobs.extend(organs.into_iter().zip(sizes)),
            Err(least) => least_scale = least_scale.max(least as f64 / budget as f64),
        }
    }
    if least_scale > 0.0 {
        return Err(PhantomError::ScaleTooSmall { scale, least: least_scale });
    }
    let mut surfaces: Vec<PhantomSurface> = jobs
        .par_iter()
        .map(|(organ, cell_mm)| {
            let surface = organ.surface(*cell_mm);
            step();
            surface
        })
        .collect();
    surfaces.sort_by_key(|s| s.priority);
    Ok(surfaces)
}
