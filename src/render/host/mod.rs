//! The passes on the host's cores, for devices that are software on those same cores: those of the paths, and those of the
//! image. Each is its shader's function, over slices in the device's layouts.
//!
//! What `shaders/locate.wgsl` and `shaders/trace.wgsl` compute, in the same single precision and into the same buffers:
//! software Vulkan runs every branch of a shader for eight paths at once, where a core takes a branch if a path does.
//! The tree's boxes are tested eight at a time, nearest first. Fused multiplications are not used, so that a frame does not
//! depend on what the processor offers.

mod arrivals;
mod bundle;
mod detect;
mod echo;
mod frame;
mod hull;
mod interface;
mod lateral;
mod march;
mod membership;
mod packet;
mod path;
mod percentile;
mod scan_convert;
mod search;
mod section;
mod staging;
mod traverse;
mod tree;
mod walk;
mod wide;

use std::ops::Range;
use std::time::Instant;

use rayon::prelude::*;

use bundle::Bundle;
pub(super) use frame::{HostFrame, HostScene};
use path::Scene;
use staging::PathOutputs;
pub(super) use staging::{StagingRing, StagingSize};
use traverse::Tree;
use tree::WideNode;

use super::configuration::{Configuration, Media};
use super::params::Params;
use super::plan::{Effect, EffectSet};
use super::renderer::{RenderError, Renderer};
use super::tables::{CELL_MM, REFLECTION_FOLLOWED, Tables};
use crate::anatomy::Bvh;
use crate::anatomy::bvh::Changed;

/// Paths that one core follows before others may take over.
const PATHS_A_TASK: usize = Bundle::PATHS;

/// Numbers of the host's `trace`. A test may change one, to see the comparison with the twin fail.
#[derive(Debug, Clone, Copy, PartialEq)]
pub struct TraceConstants {
    /// Part of the way back through the scene that is searched for the surfaces that a path starts inside.
    pub reach: f32,
    /// Reflections of which less than this part returns (energy, within the aperture) are not followed.
    pub reflection_followed: f32,
    /// How far the lattice that offsets echoes lies beside round coordinates, mm.
    pub off_the_grid_mm: f32,
    /// Energy that a very rough surface returns diffusely at normal incidence.
    pub diffuse: f32,
}

impl Default for TraceConstants {
    fn default() -> Self {
        Self { reach: 1.0, reflection_followed: REFLECTION_FOLLOWED as f32, off_the_grid_mm: 0.0077, diffuse: 0.02 }
    }
}

/// Numbers of the host's other passes. A test may change one, to see the comparison with the twin fail.
#[derive(Debug, Clone, Copy, PartialEq)]
pub struct ImageConstants {
    /// `march`: side of a cell of the scatterer lattice, mm.
    pub cell_mm: f32,
    /// `echo`: the first segment that begins at an interface.
    pub first_interface: usize,
    /// `lateral`: weights of the beam below this are zeros.
    pub least_weight: f32,
    /// `detect`: decibels a doubling of power.
    pub db_a_doubling: f32,
    /// `section`: part of the two-way attenuation that is one way's.
    pub one_way: f32,
    /// `percentile`: part of the sector's area that is brighter.
    pub brightest_part: f32,
    /// `scan_convert`: number of the first tissue.
    pub first_number: u32,
}

impl Default for ImageConstants {
    fn default() -> Self {
        Self {
            cell_mm: CELL_MM as f32,
            first_interface: 1,
            least_weight: f32::MIN_POSITIVE,
            // 10·log10(2).
            db_a_doubling: 3.010_3,
            one_way: 0.5,
            brightest_part: 0.02,
            first_number: 1,
        }
    }
}

/// Effects that paths follow; without one, the tables hold values with which its arithmetic would do nothing.
#[derive(Debug, Clone, Copy)]
struct Effects {
    moving: bool,
    refraction: bool,
    interface_echoes: bool,
    roughness: bool,
    reflections: bool,
}

impl Effects {
    fn new(effects: EffectSet, displaced: bool) -> Self {
        Self {
            moving: displaced && effects.has(Effect::Motion),
            refraction: effects.has(Effect::Refraction),
            interface_echoes: effects.has(Effect::InterfaceEchoes),
            roughness: effects.has(Effect::Roughness),
            reflections: effects.has(Effect::Reflections),
        }
    }
}

/// Follows paths on the host.
#[derive(Debug)]
pub(super) struct HostTrace {
    nodes: Vec<WideNode>,
    constants: TraceConstants,
    image: ImageConstants,
    follow: Follow,
}

/// Follows the paths from `first` on into `outputs`; how much found no room.
type Follow = fn(&Scene<'_>, usize, &mut PathOutputs<'_>) -> u32;

impl HostTrace {
    pub(super) fn new(bvh: &Bvh, constants: TraceConstants, image: ImageConstants) -> Self {
        let nodes = bvh.nodes.par_iter().map(WideNode::decode).collect();
        Self { nodes, constants, image, follow: fastest() }
    }

    /// Takes what of `bvh` has moved.
    pub(super) fn take(&mut self, bvh: &Bvh, changed: &Changed) {
        let moved = &bvh.nodes[changed.nodes.clone()];
        for (node, words) in self.nodes[changed.nodes.clone()].iter_mut().zip(moved) {
            *node = WideNode::decode(words);
        }
    }

    /// Follows the paths that `params` call for; how many crossings and segments found no room.
    fn run(
        &self,
        (media, bvh): (&Media, &Bvh),
        (tables, effects): (&Tables, EffectSet),
        params: &Params,
        out: PathOutputs<'_>,
    ) -> u32 {
        let scene = Scene {
            tree: Tree { nodes: &self.nodes, triangles: &bvh.triangles },
            displacements: bvh.displacements(),
            surface_words: &media.surface_words,
            params,
            rays: &tables.rays,
            layers: &tables.layers,
            tissues: &tables.tissues,
            effects: Effects::new(effects, !bvh.displacements().is_empty()),
            constants: &self.constants,
        };
        let paths = params.paths(params.layer_count) as usize;
        // The last batch may have fewer layers.
        follow_all(&scene, self.follow, 0..paths, out.split_at(paths).0)
    }
}

/// What the host did for a frame.
#[derive(Debug, Default)]
pub(super) struct HostWork {
    /// Crossings and segments that found no room.
    lost: u32,
    /// How long it took, ms.
    pub(super) ms: f64,
}

impl Renderer {
    /// Follows the paths of a batch and records their way to the device; does nothing where the device follows them.
    ///
    /// # Errors
    /// A device that fails.
    pub(super) fn trace_on_host(
        &mut self,
        batch: u32,
        encoder: &mut wgpu::CommandEncoder,
        work: &mut HostWork,
    ) -> Result<(), RenderError> {
        let Configuration { staging, params, plan, tables, effects, buffers, .. } = &mut self.now;
        let (Some(host), Some(ring)) = (&self.host, staging) else { return Ok(()) };
        let params = plan.params(batch, params);
        let staging = ring.next();
        let (scene, media) = (&self.bvh, &self.media);
        let ms = &mut work.ms;
        staging.fill(&self.gpu, &mut work.lost, |outputs| {
            let started = Instant::now();
            let lost = host.run((media, scene), (tables, effects.effects()), &params, outputs);
            *ms += started.elapsed().as_secs_f64() * 1e3;
            lost
        })?;
        staging.record(encoder, buffers);
        Ok(())
    }
}

/// Splits the paths over the cores, in whole bundles. A path's outputs depend on nothing but the path, unless more lies behind
/// its first ray than has room: what is lost then, and counted, depends on its neighbours.
fn follow_all(scene: &Scene<'_>, follow: Follow, paths: Range<usize>, mut out: PathOutputs<'_>) -> u32 {
    if paths.len() <= PATHS_A_TASK {
        return follow(scene, paths.start, &mut out);
    }
    let half = (paths.len() / 2).next_multiple_of(Bundle::PATHS);
    let middle = paths.start + half;
    let (low, high) = out.split_at(half);
    let (a, b) = rayon::join(
        || follow_all(scene, follow, paths.start..middle, low),
        || follow_all(scene, follow, middle..paths.end, high),
    );
    a + b
}

#[inline(always)]
fn follow_run(scene: &Scene<'_>, first: usize, out: &mut PathOutputs<'_>) -> u32 {
    let mut bundle = Bundle::new();
    let mut lost = 0;
    for i in (0..out.paths()).step_by(Bundle::PATHS) {
        let count = Bundle::PATHS.min(out.paths() - i);
        lost += bundle.follow(scene, first + i, count);
        for (path, record) in bundle.records[..count].iter().enumerate() {
            out.write(i + path, record);
        }
    }
    lost
}

/// With the instructions that every processor of the kind has.
fn follow_portable(scene: &Scene<'_>, first: usize, out: &mut PathOutputs<'_>) -> u32 {
    follow_run(scene, first, out)
}

/// With eight lanes a register; the same numbers bit for bit. AVX-512 is slower here; interfaces take it.
#[cfg(target_arch = "x86_64")]
#[target_feature(enable = "avx2,bmi1,bmi2,lzcnt,popcnt")]
fn follow_avx2(scene: &Scene<'_>, first: usize, out: &mut PathOutputs<'_>) -> u32 {
    follow_run(scene, first, out)
}

/// The fastest that this processor runs.
fn fastest() -> Follow {
    #[cfg(target_arch = "x86_64")]
    if is_x86_feature_detected!("avx2")
        && is_x86_feature_detected!("bmi1")
        && is_x86_feature_detected!("bmi2")
        && is_x86_feature_detected!("lzcnt")
        && is_x86_feature_detected!("popcnt")
    {
        // SAFETY: the processor has every feature that the function is compiled for.
        return |scene, first, out| unsafe { follow_avx2(scene, first, out) };
    }
    follow_portable
}
