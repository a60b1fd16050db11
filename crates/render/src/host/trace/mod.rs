//! The passes `locate` and `trace`: paths through the scene, in packets of neighbours over all cores.
//!
//! `path_packet.rs` holds the loop of a packet, `path.rs` the steps of one path. Up to its first reflection a path is
//! straight: one traversal of the tree (`packet.rs`) finds all its crossings (`line_crossings.rs`). After a reflection,
//! each path has a search of its own (`stream.rs`). Interfaces are computed for all paths of a packet at once
//! (`interface_response.rs`).

pub(super) mod interface;
mod interface_batch;
mod interface_response;
mod line_crossings;
pub(super) mod membership;
pub(super) mod packet;
mod packet_bounds;
pub(super) mod path;
pub(super) mod path_outputs;
mod path_packet;
mod path_record;
mod path_start;
mod path_state;
mod ray_triangle;
pub(super) mod search;
mod stream;
pub(super) mod traverse;
pub(super) mod tree;

use std::ops::Range;

#[cfg(target_arch = "x86_64")]
use insonify_core::instructions::Instructions;

use crate::params::Params;
use path::Scene;
use path_outputs::PathOutputs;
use path_packet::PathPacket;

/// Parallel tasks per thread, so that none waits long for the last one.
const TASKS_A_THREAD: usize = 16;

/// Function that follows the paths from an index on and fills their outputs. Returns the number of crossings lost for
/// lack of room.
pub(in crate::host) type Follow = fn(&Scene<'_>, usize, &mut Outputs<'_>) -> u32;

/// Outputs of consecutive paths.
#[derive(Debug)]
pub(in crate::host) struct Outputs<'a> {
    paths: PathOutputs<'a>,
    /// Outputs of the paths' axial paths; `None` unless each scanline has a single path and an axial path.
    axial_paths: Option<PathOutputs<'a>>,
}

impl Outputs<'_> {
    /// Splits off the outputs of the first `paths` paths.
    fn split_at(self, paths: usize) -> (Self, Self) {
        let (low, high) = self.paths.split_at(paths);
        let (axial_low, axial_high) = self.axial_paths.map(|axial_paths| axial_paths.split_at(paths)).unzip();
        (Self { paths: low, axial_paths: axial_low }, Self { paths: high, axial_paths: axial_high })
    }
}

/// Follows the paths of a batch and its axial paths, split over the cores in whole packets. Returns the number of
/// crossings lost for lack of room.
///
/// A path's outputs depend on that path alone, with one exception. If more crossings lie behind its start than fit, its
/// neighbours decide which crossings are lost.
pub(in crate::host) fn trace(scene: &Scene<'_>, follow: Follow, out: PathOutputs<'_>) -> u32 {
    let Params { axial_paths, scanlines, .. } = *scene.params;
    // With the aperture, an axial path passes every interface. Up to the first reflection of its scanline's only path,
    // the two paths are the same.
    if axial_paths > 0 && scene.effects.aperture && scene.params.single() {
        let (paths, axial_paths) = out.split_at(scanlines as usize);
        over_cores(scene, follow, 0..paths.paths(), Outputs { paths, axial_paths: Some(axial_paths) })
    } else {
        over_cores(scene, follow, 0..out.paths(), Outputs { paths: out, axial_paths: None })
    }
}

fn over_cores(scene: &Scene<'_>, follow: Follow, paths: Range<usize>, out: Outputs<'_>) -> u32 {
    let a_task = (paths.len() / (TASKS_A_THREAD * rayon::current_num_threads())).max(PathPacket::PATHS);
    in_tasks(scene, follow, paths, out, a_task)
}

/// Follows paths in parallel tasks of up to `a_task` paths. Each task has working memory of its own.
fn in_tasks(scene: &Scene<'_>, follow: Follow, paths: Range<usize>, mut out: Outputs<'_>, a_task: usize) -> u32 {
    if paths.len() <= a_task {
        return follow(scene, paths.start, &mut out);
    }
    let half = (paths.len() / 2).next_multiple_of(PathPacket::PATHS);
    let middle = paths.start + half;
    let (low, high) = out.split_at(half);
    let (a, b) = rayon::join(
        || in_tasks(scene, follow, paths.start..middle, low, a_task),
        || in_tasks(scene, follow, middle..paths.end, high, a_task),
    );
    a + b
}

/// Follows consecutive paths, with the instruction set of the function that it is inlined into.
#[inline(always)]
fn follow_run(scene: &Scene<'_>, first: usize, out: &mut Outputs<'_>) -> u32 {
    let mut packet = PathPacket::new();
    let mut lost = 0;
    for i in (0..out.paths.paths()).step_by(PathPacket::PATHS) {
        let count = PathPacket::PATHS.min(out.paths.paths() - i);
        lost += packet.follow(scene, first + i..first + i + count);
        for (path, record) in packet.records(count).enumerate() {
            out.paths.write(i + path, record);
        }
        if let Some(axial_paths) = &mut out.axial_paths {
            lost += packet.follow_axial_paths(scene, count);
            for (path, record) in packet.records(count).enumerate() {
                axial_paths.write(i + path, record);
            }
        }
    }
    lost
}

/// [`follow_run`] with AVX2, bit-identical. AVX-512 is slower here; only interfaces use it.
#[cfg(target_arch = "x86_64")]
#[target_feature(enable = "avx2,bmi1,bmi2,lzcnt,popcnt")]
fn follow_avx2(scene: &Scene<'_>, first: usize, out: &mut Outputs<'_>) -> u32 {
    follow_run(scene, first, out)
}

/// The fastest function that this processor runs within [`Instructions::widest`].
pub(in crate::host) fn fastest() -> Follow {
    #[cfg(target_arch = "x86_64")]
    if Instructions::widest() >= Instructions::Avx2
        && is_x86_feature_detected!("bmi1")
        && is_x86_feature_detected!("bmi2")
        && is_x86_feature_detected!("lzcnt")
        && is_x86_feature_detected!("popcnt")
    {
        // SAFETY: the processor has every feature that the function is compiled for.
        return |scene, first, out| unsafe { follow_avx2(scene, first, out) };
    }
    follow_run
}
