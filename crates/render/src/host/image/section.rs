//! Media along straight map rays: the cross-section of the surfaces, and the attenuation from the face.

use std::hint::black_box;

use glam::Vec3;
use insonify_core::simd::{at_least, real, widened};
use rayon::prelude::*;

use crate::constants::{CROSSINGS_OF_A_MAP_RAY, ENTRIES, TAG, TISSUE_MASK, WHOLE};
use crate::host::constants::{COUPLED_MIN, TOUCH_MM};
use crate::host::lanes::RAYS;
use crate::host::trace::membership::{Inside, coupling, cross, medium_word};
use crate::host::trace::packet::{Packet, Visits};
use crate::host::trace::search::collect;
use crate::host::trace::traverse::{Crossing, Ray, Tree, by_distance};
use crate::params::Params;

/// Capacity for crossings of one ray.
const CROSSINGS: usize = CROSSINGS_OF_A_MAP_RAY as usize;

/// Inputs of the map rays.
#[derive(Debug, Clone, Copy)]
pub(crate) struct Scene<'a> {
    pub(crate) tree: Tree<'a>,
    /// Tissue of each surface, with [`MOVES`](crate::constants::MOVES) if it moves.
    pub(crate) surface_words: &'a [u32],
    /// Origin and direction of each map ray, probe frame.
    pub(crate) map_rays: &'a [[f32; 4]],
    /// One-way attenuation of each tissue, nepers/mm.
    pub(crate) rates_np_mm: &'a [f32; 256],
}

impl Scene<'_> {
    /// Depth of a ray's start below the apex of the face (mm), and the depth that it gains per mm.
    fn start_of(&self, ray: usize) -> [f32; 2] {
        let [_, _, depth_mm, _] = self.map_rays[2 * ray];
        let [x, y, z, _] = self.map_rays[2 * ray + 1];
        [depth_mm, z / Vec3::new(x, y, z).length()]
    }
}

/// Media along the map rays.
#[derive(Debug)]
pub(crate) struct Section<'a> {
    /// Runs [start mm, one-way Σμ at the start in nepers, μ nepers/mm, tissue] [map_rays × ENTRIES].
    pub(crate) entries: &'a mut [[f32; 4]],
    /// Number of runs of each ray.
    pub(crate) entry_counts: &'a mut [u32],
    /// One word per map_step_mm of depth [map_rays × map_depths]: bits of Σμ, without the sign and the lowest 8; a bit
    /// that is set if the run reaches the next depth; the tissue.
    pub(crate) raster: &'a mut [u32],
}

/// Fills `section`. Returns the number of crossings and runs lost for lack of room.
pub(crate) fn section(params: &Params, scene: Scene<'_>, section: Section<'_>) -> u32 {
    let depths = params.map_depths as usize;
    let entries =
        section.entries.par_chunks_mut(RAYS * ENTRIES as usize).zip(section.entry_counts.par_chunks_mut(RAYS));
    let packets = entries.zip(section.raster.par_chunks_mut(RAYS * depths)).enumerate();
    let packets = packets.take((params.map_rays as usize).div_ceil(RAYS));
    // A follower is large: it is made once a task, not once a packet.
    let lost = packets.map_init(Follower::new, |follower, (packet, ((entries, counts), raster))| {
        let first = RAYS * packet;
        follower.rays = (params.map_rays as usize - first).min(RAYS);
        follow(params, &scene, first, follower);
        let mut lost = follower.lost;
        let parts = entries.chunks_exact_mut(ENTRIES as usize).zip(counts).zip(raster.chunks_exact_mut(depths));
        for (lane, ((entries, count), raster)) in parts.take(follower.rays).enumerate() {
            let mut runs = Runs { entries, count: 0, lost: 0 };
            let start = scene.start_of(first + lane);
            divide(params, &scene, start, &mut follower.found[lane][..follower.counts[lane]], &mut runs);
            *count = runs.count as u32;
            lost += runs.lost;
            rasterise(params, &runs.entries[..runs.count], raster);
        }
        lost
    });
    lost.sum()
}

/// Memory for the crossings of a packet of neighbouring rays.
struct Follower {
    rays: usize,
    found: [[Crossing; CROSSINGS]; RAYS],
    counts: [usize; RAYS],
    lost: u32,
}

impl Follower {
    fn new() -> Self {
        Self { rays: 0, found: [[Crossing::default(); CROSSINGS]; RAYS], counts: [0; RAYS], lost: 0 }
    }
}

/// The runs of one ray.
struct Runs<'a> {
    entries: &'a mut [[f32; 4]],
    count: usize,
    lost: u32,
}

widened! {
    /// Follows rays from outside the scene through the face to the full depth.
    fn follow(params: &Params, scene: &Scene<'_>, first: usize, follower: &mut Follower) = follow_body
}

#[inline(always)]
fn follow_body(params: &Params, scene: &Scene<'_>, first: usize, follower: &mut Follower) {
    let from_probe = |[x, y, z, _]: [f32; 4]| params.scene_vector(Vec3::new(x, y, z));
    let mut packet = Packet::new();
    for lane in 0..follower.rays {
        let origin = params.face_mm() + from_probe(scene.map_rays[2 * (first + lane)]);
        let direction = from_probe(scene.map_rays[2 * (first + lane) + 1]).normalize();
        packet.set(lane, Ray::new(origin, direction), -params.reach_mm, params.depth_mm);
    }
    let into = follower.found.each_mut().map(|lane| &mut lane[..]);
    (follower.counts, follower.lost) = collect(&scene.tree, &packet, &mut Visits::new(), into);
}

/// Divides a ray into runs at its crossings. A ray that is not coupled is all air.
fn divide(params: &Params, scene: &Scene<'_>, [depth_mm, down]: [f32; 2], found: &mut [Crossing], runs: &mut Runs<'_>) {
    found.sort_unstable_by(by_distance);
    let mut ahead = found;
    let mut inside = [0u32; 8];
    let mut begun = false;
    loop {
        let t = ahead.first().map(|crossing| crossing.t);
        // The first run begins at the face.
        if !begun && t.is_none_or(|t| t > 0.0) {
            begun = true;
            if coupling(params.film_mm, depth_mm, down, &inside, ahead) < COUPLED_MIN {
                runs.begin(scene, 0.0, params.beyond);
                return;
            }
            runs.begin(scene, 0.0, medium(params, scene, depth_mm, &inside));
        }
        let Some(t) = t else { break };
        let (coincident, rest) = ahead.split_at_mut(ahead.partition_point(|crossing| crossing.t <= t + TOUCH_MM));
        cross(scene.tree.triangles, coincident, &mut inside);
        if begun {
            runs.begin(scene, t, medium(params, scene, depth_mm + down * t, &inside));
        }
        ahead = rest;
    }
}

impl Runs<'_> {
    /// Begins a run at `start_mm`, unless the last one has the same tissue.
    fn begin(&mut self, scene: &Scene<'_>, start_mm: f32, tissue: u32) {
        let mut sum_np = 0.0;
        if let Some(&[start, sum, rate, tag]) = self.count.checked_sub(1).and_then(|last| self.entries.get(last)) {
            if tag.to_bits() == TAG | tissue {
                return;
            }
            sum_np = sum + rate * (start_mm - start);
        }
        let rate = scene.rates_np_mm[(tissue & 255) as usize];
        match self.entries.get_mut(self.count) {
            Some(entry) => {
                *entry = [start_mm, sum_np, rate, f32::from_bits(TAG | tissue)];
                self.count += 1;
            }
            None => self.lost += 1,
        }
    }
}

/// Tissue of the highest surface the point is inside; else the background, or air beyond the film of gel.
fn medium(params: &Params, scene: &Scene<'_>, depth_mm: f32, inside: &Inside) -> u32 {
    medium_word(scene.surface_words, params.outside(depth_mm), inside) & TISSUE_MASK
}

widened! {
    /// Writes the runs' words at every depth.
    fn rasterise(params: &Params, runs: &[[f32; 4]], raster: &mut [u32]) = rasterise_body
}

#[inline(always)]
fn rasterise_body(params: &Params, runs: &[[f32; 4]], raster: &mut [u32]) {
    let step_mm = params.map_step_mm;
    let mut from = 0;
    for (i, &[start_mm, sum_np, rate_np_mm, tag]) in runs.iter().enumerate() {
        let end_mm = runs.get(i + 1).map_or(2.0 * params.depth_mm + 1.0, |next| next[0]);
        let tissue = tag.to_bits() & 255;
        // An estimate of the end, corrected below.
        let mut to = (((end_mm / step_mm) as usize).saturating_sub(1)).clamp(from, raster.len());
        while to < raster.len() && (to as f32) * step_mm < end_mm {
            // A turn or two: unrolled to vectors, the loop takes longer.
            to = black_box(to + 1);
        }
        for (depth, word) in raster[from..to].iter_mut().enumerate() {
            let at_mm = real((from as u32).wrapping_add(depth as u32)) * step_mm;
            let sum = at_least(sum_np + rate_np_mm * (at_mm - start_mm), 0.0);
            let whole = if at_mm + step_mm < end_mm { WHOLE } else { 0 };
            *word = sum.to_bits() << 1 & 0xffff_fe00 | whole | tissue;
        }
        from = to;
    }
}
