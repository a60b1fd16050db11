//! Reference pictures with enough rays and layers: further ones change the picture little.

use std::fmt;

use serde::{Deserialize, Serialize};

use super::MeasuringError;
use super::harness::Harness;
use super::knobs::Knobs;
use super::reference::Reference;
use super::store::Store;
use crate::files::read_grey;
use crate::pose::Pose;
use crate::quality::{QualityError, level_difference};
use crate::render::FrameQuality;
use crate::sink::png::{self, Effort};
use crate::statistics::mean;

/// Convergence limit for doubled rays: mean change of a pixel, grey levels. Chosen: 2 of 255 levels are 0.5 dB at a
/// dynamic range of 60 dB.
const RAYS_BOUND: f64 = 2.0;
/// Convergence limit for the next number of layers: mean change of the levels of 32 × 32 pixels, grey levels. Also
/// chosen.
const LAYERS_BOUND: f64 = 2.0;
/// Base of the references' seeds. They differ from the seeds of measured points, so no point shares paths with its
/// reference.
const SEED: u32 = 0x5eed_0000;
/// Rays with which a reference starts.
const RAYS: u32 = 32;
/// Numbers of layers of the reference, in order of trial. HQ has the first number.
const LAYERS: [u32; 3] = [3, 5, 9];

/// Rays and layers that a reference usually needs until it converges, for estimated times.
pub(super) const USUAL: [(u32, u32); 4] = [(32, 3), (64, 3), (128, 3), (128, 5)];

/// Convergence of a reference: how little it changes with doubled rays, and with more layers.
#[derive(Debug, Clone, Serialize, Deserialize)]
pub struct Check {
    /// Rays of the reference.
    pub rays: u32,
    /// Layers of the reference.
    pub layers: u32,
    /// Steering angles of the reference.
    pub angles: u32,
    /// Number of layers of the comparison picture.
    pub layers_compared: u32,
    /// Mean magnitude of a pixel's change from half the rays to `rays`, grey levels.
    pub rays_change: f64,
    /// Upper limit of `rays_change`.
    pub rays_bound: f64,
    /// Mean magnitude of the change from `layers` to `layers_compared`, grey levels. The levels are means over 32 × 32
    /// pixels.
    pub layers_change: f64,
    /// Upper limit of `layers_change`.
    pub layers_bound: f64,
    /// Whether both changes are below their limits.
    pub converged: bool,
}

impl fmt::Display for Check {
    fn fmt(&self, f: &mut fmt::Formatter<'_>) -> fmt::Result {
        let Self { rays, layers, angles, rays_change, rays_bound, layers_change, layers_bound, .. } = self;
        let layers_compared = self.layers_compared;
        let quality = FrameQuality { angles: *angles, ..FrameQuality::new(*rays, *layers) };
        let not = if self.converged { "is" } else { "is not" };
        write!(
            f,
            "The reference, {quality} with all effects, {not} converged: doubling the rays to {rays} changed a pixel by {rays_change:.2} grey levels in the mean (chosen bound: {rays_bound}), {layers_compared} layers instead of {layers} change the level of 32 x 32 pixels by {layers_change:.2} (chosen bound: {layers_bound})"
        )
    }
}

/// A step towards a converged reference.
#[derive(Debug, Clone, Copy, PartialEq)]
pub struct Convergence {
    /// Rays after this step.
    pub rays: u32,
    /// Layers after this step.
    pub layers: u32,
    /// Number of layers of the comparison picture; `None` if this step doubled the rays.
    pub compared: Option<u32>,
    /// Mean magnitude of the change, grey levels: of a pixel if the rays were doubled, else of means over 32 × 32
    /// pixels.
    pub change: f64,
}

impl fmt::Display for Convergence {
    fn fmt(&self, f: &mut fmt::Formatter<'_>) -> fmt::Result {
        let Self { rays, layers, compared, change } = self;
        match compared {
            None => {
                write!(f, "reference {rays}x{layers}: a pixel changes by {change:.2} grey levels from half the rays")
            }
            Some(n) => write!(f, "reference {rays}x{layers}: levels change by {change:.2} with {n} layers"),
        }
    }
}

/// Reference pictures of all poses.
#[derive(Debug)]
pub(super) struct References {
    pub(super) pictures: Vec<Reference>,
    pub(super) check: Check,
}

impl References {
    /// Reads the references from the store, or renders them with more and more paths until they converge. The flag is
    /// true if the references were stored.
    pub(super) fn make(
        harness: &mut Harness,
        store: &Store,
        poses: &[Pose],
        quick: bool,
        progress: &dyn Fn(Convergence),
    ) -> Result<(Self, bool), MeasuringError> {
        if let Some(check) = store.read("reference")? {
            let pictures = (0..poses.len()).map(|i| load(harness, store, i)).collect::<Result<_, _>>()?;
            return Ok((Self { pictures, check }, true));
        }
        let references = Self::converge(harness, poses, quick, progress)?;
        for (index, picture) in references.pictures.iter().enumerate() {
            save(store, index, picture)?;
        }
        // Written last: its presence marks complete references.
        store.write("reference", &references.check)?;
        Ok((references, false))
    }

    /// Reference picture at one more pose, from the store or rendered. It has as many paths as the references that
    /// `check` describes.
    pub(super) fn of_pose(
        harness: &mut Harness,
        store: &Store,
        pose: Pose,
        check: &Check,
    ) -> Result<Reference, MeasuringError> {
        let quality = (check.rays, check.layers);
        if store.read("reference")? == Some(quality) {
            return load(harness, store, 0);
        }
        configure(harness, quality, SEED)?;
        let range_db = harness.settings().image.dynamic_range_db;
        let reference = Reference::of(harness.render(&pose)?, range_db)?;
        save(store, 0, &reference)?;
        store.write("reference", &quality)?;
        Ok(reference)
    }

    fn converge(
        harness: &mut Harness,
        poses: &[Pose],
        quick: bool,
        progress: &dyn Fn(Convergence),
    ) -> Result<Self, MeasuringError> {
        let (rays_max, layers_max) = if quick { (64, LAYERS[0]) } else { (256, LAYERS[1]) };
        let mut rays = RAYS;
        let [mut layers, mut next] = [LAYERS[0], LAYERS[1]];
        let mut turn = 0;
        let mut render = |rays, layers| {
            turn += 1;
            rendered(harness, poses, (rays, layers), SEED + turn)
        };
        let mut pictures = render(rays, layers)?;
        loop {
            let mut rays_change = f64::INFINITY;
            while rays_change >= RAYS_BOUND && rays < rays_max {
                rays *= 2;
                let twice = render(rays, layers)?;
                rays_change = mean_change(&pictures, &twice);
                progress(Convergence { rays, layers, compared: None, change: rays_change });
                pictures = twice;
            }
            let more = render(rays, next)?;
            let layers_change = level_change(&pictures, &more)?;
            progress(Convergence { rays, layers, compared: Some(next), change: layers_change });
            let enough = layers_change < LAYERS_BOUND;
            if enough || layers >= layers_max {
                let check = Check {
                    rays,
                    layers,
                    angles: harness.reference_angles(),
                    layers_compared: next,
                    rays_change,
                    rays_bound: RAYS_BOUND,
                    layers_change,
                    layers_bound: LAYERS_BOUND,
                    converged: enough && rays_change < RAYS_BOUND,
                };
                return Ok(Self { pictures, check });
            }
            // Starts again with half the rays, so that their convergence is checked with the new layers.
            rays = (rays / 2).max(RAYS);
            (layers, next) = (next, LAYERS[2]);
            pictures = render(rays, layers)?;
        }
    }
}

/// Renders the reference pictures at `poses`.
fn rendered(
    harness: &mut Harness,
    poses: &[Pose],
    quality: (u32, u32),
    seed: u32,
) -> Result<Vec<Reference>, MeasuringError> {
    configure(harness, quality, seed)?;
    let range_db = harness.settings().image.dynamic_range_db;
    let mut pictures = Vec::new();
    harness.render_many(poses, |frame| {
        pictures.push(Reference::of(frame, range_db)?);
        Ok(())
    })?;
    Ok(pictures)
}

/// Configures a reference: every effect is on, so that omitting a relevant one shows as an error, and every path follows
/// reflections.
fn configure(harness: &mut Harness, (rays, layers): (u32, u32), seed: u32) -> Result<(), MeasuringError> {
    let knobs = harness.base().with(rays, layers).compounded(harness.reference_angles(), false);
    harness.configure(&Knobs { reflecting_percent: 100, ..knobs.with_all_effects() }, seed)
}

fn path(store: &Store, name: &str, index: usize) -> std::path::PathBuf {
    store.path(&format!("reference_{index}_{name}"), "png")
}

fn save(store: &Store, index: usize, reference: &Reference) -> Result<(), MeasuringError> {
    let [width, height] = reference.size.map(|n| n as u32);
    for (name, map) in
        [("bmode", &reference.bmode[..]), ("segmentation", &reference.segmentation), ("mask", &reference.mask)]
    {
        png::write_grey(&path(store, name, index), width, height, map, Effort::Fast)?;
    }
    Ok(())
}

fn load(harness: &Harness, store: &Store, index: usize) -> Result<Reference, MeasuringError> {
    let map = |name| read_grey(&path(store, name, index));
    let (bmode, [width, height]) = map("bmode")?;
    let size = [width as usize, height as usize];
    let range_db = harness.settings().image.dynamic_range_db;
    Ok(Reference::new(size, bmode, map("segmentation")?.0, map("mask")?.0.into(), range_db)?)
}

/// Mean absolute change of a pixel inside the sectors, over all poses, grey levels.
fn mean_change(before: &[Reference], after: &[Reference]) -> f64 {
    let (mut sum, mut count) = (0u64, 0u64);
    for (a, b) in before.iter().zip(after) {
        for ((x, y), _) in a.bmode.iter().zip(&b.bmode).zip(&*b.mask).filter(|(_, mask)| **mask > 0) {
            sum += u64::from(x.abs_diff(*y));
            count += 1;
        }
    }
    sum as f64 / count.max(1) as f64
}

/// Mean absolute change of the levels of 32 × 32 pixels, over all poses, grey levels.
fn level_change(before: &[Reference], after: &[Reference]) -> Result<f64, QualityError> {
    let changes = before.iter().zip(after).map(|(a, b)| level_difference(&b.pair(&a.bmode)?));
    let changes = changes.collect::<Result<Vec<f64>, QualityError>>()?;
    Ok(mean(changes).unwrap_or(0.0))
}
