//! One path through the scene in f32: `shaders/locate.wgsl` and `shaders/trace.wgsl`, step by step.

use glam::{Vec3, Vec4, Vec4Swizzles};

use super::interface::{acceptance, interface_between, microfacet, returning};
use super::membership::{Inside, cross, medium_word};
use super::traverse::{Crossing, Nearest, Ray, Stack, TOUCH_MM, Tree, collect};
use super::walk::Walk;
use super::{Effects, TraceConstants};
use crate::render::configuration::MOVES;
use crate::render::params::Params;
use crate::render::tables::{CELL_MM, GpuTissue, HINT_BLOCK, LAYER_SHIFT_MM, SAMPLES_MAX, SEGMENTS, STARTS};
use crate::render::twin::hash::{pcg3d, sample_unit, unit};

/// ln of the two-way amplitude at which a path ends: 10⁻¹³.
const LN_GIVEN_UP: f32 = -30.0;
/// ln of an amplitude that no display shows: 10⁻³⁴.
const LN_SILENT: f32 = -80.0;
/// Crossings at one place, and on the way back from the face.
const CROSSINGS: usize = 16;
pub(super) const CROSSINGS_BEHIND: usize = 64;
/// Surfaces that one path may cross, most of them without a change of medium.
const PLACES_MAX: u32 = 192;
/// Set beside a density: small integers travel as the low bits of a normal float.
const TAG: u32 = 0x4000_0000;
/// A range that none reaches.
const BEYOND_MM: f32 = 3.0e38;
/// Words of hints of the most samples.
const HINT_WORDS: usize = (SAMPLES_MAX / (4 * HINT_BLOCK) + 1) as usize;

/// What paths read.
#[derive(Debug, Clone, Copy)]
pub(super) struct Scene<'a> {
    pub(super) tree: Tree<'a>,
    /// How far each triangle is from its rest; empty where nothing moves.
    pub(super) displacements: &'a [[f32; 4]],
    /// Tissue of each surface, with [`MOVES`] where it moves.
    pub(super) surface_words: &'a [u32],
    /// With the batch's layers.
    pub(super) params: &'a Params,
    pub(super) rays: &'a [[f32; 4]],
    pub(super) layers: &'a [[f32; 4]],
    pub(super) tissues: &'a [GpuTissue],
    pub(super) effects: Effects,
    pub(super) constants: &'a TraceConstants,
}

/// What is written of a path, as the device has it.
#[derive(Debug)]
pub(super) struct PathRecord {
    /// Surfaces that it starts inside.
    pub(super) starts_inside: [u32; 8],
    pub(super) starts: [f32; STARTS as usize],
    pub(super) segments: [[f32; 12]; SEGMENTS as usize],
    pub(super) echoes: [[f32; 2]; SEGMENTS as usize],
    pub(super) count: u32,
    pub(super) hints: [u32; HINT_WORDS],
}

impl PathRecord {
    pub(super) fn new() -> Self {
        Self {
            starts_inside: [0; 8],
            starts: [0.0; STARTS as usize],
            segments: [[0.0; 12]; SEGMENTS as usize],
            echoes: [[0.0; 2]; SEGMENTS as usize],
            count: 0,
            hints: [0; HINT_WORDS],
        }
    }
}

/// Memory for the crossings of one place.
#[derive(Debug)]
pub(super) struct Place {
    stack: Stack,
    crossings: [Crossing; CROSSINGS],
}

impl Place {
    pub(super) fn new() -> Self {
        Self { stack: Stack::new(), crossings: [Crossing::default(); CROSSINGS] }
    }
}

impl Scene<'_> {
    fn scene_vector(&self, v: Vec3) -> Vec3 {
        let p = self.params;
        let axis = |column: [f32; 4]| Vec4::from(column).xyz();
        axis(p.lateral) * v.x + axis(p.elevational) * v.y + axis(p.axial) * v.z
    }

    /// Origin and direction of a path's first ray: its scanline's, moved to its elevational layer.
    fn launch(&self, line_ray: usize, layer: usize) -> (Vec3, Vec3) {
        let p = self.params;
        let [offset, slope, ..] = self.layers[layer];
        let origin = Vec4::from(self.rays[2 * line_ray]).xyz() + Vec3::new(0.0, offset, 0.0);
        let direction = Vec4::from(self.rays[2 * line_ray + 1]).xyz() + Vec3::new(0.0, slope, 0.0);
        let face = Vec3::new(p.lateral[3], p.elevational[3], p.axial[3]);
        (face + self.scene_vector(origin), self.scene_vector(direction).normalize())
    }

    fn medium_word(&self, inside: &Inside) -> u32 {
        medium_word(self.surface_words, self.params.background, inside)
    }

    /// The triangle at a place that is the interface: of the highest surface, and of its triangles the first of the scene.
    fn interface_of(&self, place: &[Crossing]) -> usize {
        let order = |c: &&Crossing| {
            let triangle = &self.tree.triangles[c.triangle as usize];
            (triangle.surface, std::cmp::Reverse(triangle.triangle))
        };
        place.iter().max_by_key(order).map_or(0, |c| c.triangle as usize)
    }

    /// Where path `path` begins.
    pub(super) fn begin(&self, path: usize) -> Walk {
        let p = self.params;
        let line_rays = (p.scanlines * p.rays) as usize;
        let (line_ray, layer) = (path % line_rays, p.layer_first as usize + path / line_rays);
        let (origin, direction) = self.launch(line_ray, layer);
        let in_phase = self.layers[layer][2] / p.rays as f32;
        let axis = 2 * (line_rays + line_ray / p.rays as usize);
        // Layers have speckle of their own, also where they meet; the middle one's is that of a frame of one layer.
        let apart_mm = if self.layers[layer][0] == 0.0 { 0.0 } else { LAYER_SHIFT_MM * (layer + 1) as f32 };
        let to_axis = |i: usize| {
            self.scene_vector(Vec4::from(self.rays[axis + i]).xyz() - Vec4::from(self.rays[2 * line_ray + i]).xyz())
        };
        Walk {
            line_ray: line_ray as u32,
            layer: layer as u32,
            origin,
            direction,
            in_phase,
            in_power: in_phase.sqrt(),
            shift: to_axis(0) + Vec3::new(0.0, 0.0, apart_mm),
            shift_step: to_axis(1),
            ..Walk::default()
        }
    }

    /// How far behind its first ray a path may have entered surfaces, mm.
    #[inline(always)]
    pub(super) fn back_mm(&self) -> f32 {
        self.params.reach_mm * self.constants.reach
    }

    /// Which surfaces the path starts inside, by what lies `behind` its first ray; writes its first segment.
    #[inline(always)]
    pub(super) fn locate(&self, walk: &mut Walk, behind: &mut [Crossing], record: &mut PathRecord) {
        behind.sort_unstable_by(by_distance);
        let mut ahead = behind;
        while let Some(first) = ahead.first() {
            let limit = first.t + TOUCH_MM;
            let (place, rest) = ahead.split_at_mut(ahead.partition_point(|c| c.t <= limit));
            cross(self.tree.triangles, place, &mut walk.inside);
            ahead = rest;
        }
        record.starts_inside = walk.inside;
        record.count = 0;
        walk.here = self.medium_word(&walk.inside) & (MOVES - 1);
        self.segment(walk, record);
    }

    /// Length of path a mm of range in the medium at hand. Ranges are depths: the lens delays its middle, so that an oblique
    /// layer's echoes come no later.
    #[inline(always)]
    fn path_per_range(&self, walk: &Walk) -> f32 {
        self.tissues[walk.here as usize].speed_ratio * self.layers[walk.layer as usize][3]
    }

    /// How far the path goes on in its medium at most, mm; not above 0 where it has ended.
    #[inline(always)]
    pub(super) fn left_mm(&self, walk: &Walk) -> f32 {
        if walk.open { (self.params.depth_mm - walk.range_mm) * self.path_per_range(walk) } else { 0.0 }
    }

    /// Writes the segment that begins here.
    #[inline(always)]
    fn segment(&self, walk: &mut Walk, record: &mut PathRecord) {
        let tissue = &self.tissues[walk.here as usize];
        let step = walk.direction * self.path_per_range(walk) + walk.shift_step;
        let fall = tissue.attenuation_np_mm * self.path_per_range(walk);
        let from = walk.origin - walk.carried_mm + walk.shift + (walk.shift_step - step) * walk.range_mm;
        let count = record.count as usize;
        record.starts[count] = walk.range_mm;
        record.segments[count] = [
            from.x,
            from.y,
            from.z,
            walk.ln_amplitude + walk.ln_scatter + fall * walk.range_mm,
            step.x,
            step.y,
            step.z,
            fall,
            tissue.scatterer_mean,
            tissue.scatterer_deviation,
            f32::from_bits(TAG | tissue.scatterer_density),
            0.0,
        ];
        record.echoes[count] = [walk.echo, walk.echo_range_mm];
        record.count += 1;
        if record.count == SEGMENTS {
            walk.lost += u32::from(walk.open);
            walk.open = false;
        }
    }

    /// Takes the path to its nearest crossing, within [`Self::left_mm`], and writes the segment behind it if the medium
    /// changes there.
    #[inline(always)]
    pub(super) fn advance(&self, walk: &mut Walk, found: Nearest, place: &mut Place, record: &mut PathRecord) {
        let tissue = &self.tissues[walk.here as usize];
        walk.crossed += 1;
        if walk.crossed > PLACES_MAX {
            walk.lost += 1;
            walk.open = false;
            return;
        }
        // The place: that crossing, and where others lie within TOUCH_MM of it, all of them.
        let t = found.crossing.t;
        place.crossings[0] = found.crossing;
        let mut crossings = 1;
        if found.crowded {
            let (least, most) = (walk.t_min.max(t - TOUCH_MM), (t + TOUCH_MM).min(self.left_mm(walk)));
            let ray = Ray::new(walk.origin, walk.direction);
            let (all, missed) = collect(&self.tree, &ray, least, most, &mut place.stack, &mut place.crossings);
            place.crossings[..all].sort_unstable_by(by_distance);
            crossings = all.max(1);
            walk.lost += missed;
        }
        let here = &place.crossings[..crossings];
        let before = walk.inside;
        let limit = here[0].t + TOUCH_MM;
        cross(self.tree.triangles, &here[..here.partition_point(|c| c.t <= limit)], &mut walk.inside);
        let there = self.medium_word(&walk.inside);
        walk.origin += walk.direction * t;
        walk.range_mm += t / self.path_per_range(walk);
        walk.ln_amplitude -= tissue.attenuation_np_mm * t;
        walk.t_min = TOUCH_MM;
        if there & (MOVES - 1) != walk.here {
            self.interface(walk, &before, self.interface_of(here), there);
            self.segment(walk, record);
        }
    }

    /// What happens where the medium changes to `there` at triangle `chosen`.
    #[inline(always)]
    fn interface(&self, walk: &mut Walk, before: &Inside, chosen: usize, there: u32) {
        let (p, effects, constants) = (self.params, &self.effects, self.constants);
        let random = |bounce: u32, dim: u32| sample_unit(p.seed, walk.line_ray, walk.layer, bounce, dim) as f32;
        let tissue = &self.tissues[walk.here as usize];
        let Walk { origin, range_mm, bounce, .. } = *walk;
        let mut direction = walk.direction;
        let triangle = &self.tree.triangles[chosen];
        let outward = Vec3::from(triangle.edge1).cross(Vec3::from(triangle.edge2));
        let outward = outward / outward.length().max(1.0e-30);
        let normal = if outward.dot(direction) > 0.0 { -outward } else { outward };
        let beyond = &self.tissues[(there & (MOVES - 1)) as usize];
        // An interface is as rough and as thick as the rougher and the thicker of its two sides.
        let roughness = tissue.roughness.max(beyond.roughness);
        let thickness_mm = tissue.thickness_mm.max(beyond.thickness_mm);
        let coherence = tissue.coherence.min(beyond.coherence);
        // Half of the roughness tilts the facet, half widens the lobe about it.
        let variance = 0.5 * roughness * roughness;
        let mut facet = normal;
        if effects.roughness && variance > 0.0 {
            facet = microfacet(normal, variance, random(bounce, 1), random(bounce, 2));
            if facet.dot(direction) > -0.02 {
                facet = normal;
            }
        }
        // What returns depends on the facet; what goes on follows the mean surface.
        let cos_facet = (-facet.dot(direction)).clamp(0.0, 1.0);
        let cos_incident = (-normal.dot(direction)).clamp(0.0, 1.0);
        // A division may round x/x to other than 1.
        let speed_ratio = if beyond.bending == tissue.bending { 1.0 } else { beyond.bending / tissue.bending };
        let (z1, z2) = (tissue.impedance_mrayl, beyond.impedance_mrayl);
        let split = interface_between(z1, z2, speed_ratio, cos_incident);

        // The echo, spread over the interface's thickness at an offset that belongs to the place.
        walk.echo_range_mm = range_mm;
        if effects.interface_echoes {
            let at_facet = if effects.roughness { interface_between(z1, z2, speed_ratio, cos_facet) } else { split };
            let salt = (triangle.surface as i32 + 1).wrapping_mul(7919);
            let cell = ((origin + constants.off_the_grid_mm) * (1.0 / CELL_MM as f32)).floor().as_ivec3();
            let offset = unit(pcg3d(cell.to_array().map(|c| (c ^ salt) as u32))[0]) as f32 - 0.5;
            walk.echo_range_mm += offset * thickness_mm / self.path_per_range(walk);
            let weight = walk.in_power * (1.0 - coherence) + walk.in_phase * coherence;
            let arriving = if walk.ln_amplitude > LN_SILENT { walk.ln_amplitude.exp() } else { 0.0 };
            let returned = returning(cos_facet, roughness, range_mm, p.aperture_mm, constants.diffuse);
            walk.echo = at_facet.pressure_reflection * returned * weight * arriving;
        }

        // Reflect with probability R or go on; reflections that hardly return are left to their weight.
        let accepted = acceptance(roughness * roughness, range_mm, p.aperture_mm);
        let energy = split.energy_reflection;
        let follow = effects.reflections && energy * accepted >= constants.reflection_followed;
        if effects.reflections && (energy >= 1.0 || (follow && random(bounce, 0) < energy)) {
            walk.inside = *before;
            walk.reflections += 1;
            walk.open = walk.reflections <= p.reflections_max;
            // A rough surface spreads the beam beyond what the aperture accepts, on both ways.
            walk.ln_amplitude += accepted.ln();
            walk.ln_scatter += 0.5 * energy.max(1.0e-30).ln();
            let mut turned = direction + 2.0 * cos_facet * facet;
            if turned.dot(normal) <= 0.0 {
                turned = direction - 2.0 * direction.dot(normal) * normal;
            }
            direction = turned.normalize();
        } else {
            let ln_passed = (1.0 - energy).max(1.0e-30).ln();
            if follow {
                walk.ln_scatter += 0.5 * ln_passed;
            } else {
                walk.ln_amplitude += ln_passed;
            }
            walk.here = there & (MOVES - 1);
            if effects.moving {
                let moves = there & MOVES != 0;
                walk.carried_mm = if moves { Vec4::from(self.displacements[chosen]).xyz() } else { Vec3::ZERO };
            }
            if effects.refraction {
                let bent = speed_ratio * direction + (speed_ratio * cos_incident - split.cos_transmitted) * normal;
                if split.cos_transmitted > 0.0 && bent.dot(normal) < 0.0 {
                    direction = bent.normalize();
                }
            }
        }
        walk.direction = direction;
        // Nothing that far down is ever shown: −260 dB.
        walk.open = walk.open && walk.ln_amplitude > LN_GIVEN_UP;
        if !walk.open {
            walk.ln_amplitude = 2.0 * LN_SILENT;
        }
        walk.bounce += 1;
    }

    /// Ends the record of a path.
    #[inline(always)]
    pub(super) fn end(&self, record: &mut PathRecord) {
        record.starts[record.count as usize] = BEYOND_MM;
        self.hint(record);
    }

    /// Notes the segment that holds the first sample of each block, four blocks a word.
    fn hint(&self, record: &mut PathRecord) {
        let p = self.params;
        let mut holds = 0;
        for (i, word) in (0..p.hint_words).zip(record.hints.iter_mut()) {
            *word = u32::from_le_bytes([0, 1, 2, 3].map(|block| {
                let at_mm = (((4 * i + block) * HINT_BLOCK) as f32 + 0.5) * p.sample_spacing_mm;
                while record.starts[holds + 1] <= at_mm {
                    holds += 1;
                }
                holds as u8
            }));
        }
    }
}

/// By distance, then by triangle.
fn by_distance(a: &Crossing, b: &Crossing) -> std::cmp::Ordering {
    a.t.total_cmp(&b.t).then(a.triangle.cmp(&b.triangle)).then(a.enters.cmp(&b.enters))
}
