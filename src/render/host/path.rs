//! One path through the scene in f32: `shaders/locate.wgsl` and `shaders/trace.wgsl`, step by step.

use glam::{Vec3, Vec4, Vec4Swizzles};

use super::arrivals::{Arrival, Departure};
use super::membership::{Inside, cross, cross_until, highest, medium_word};
use super::search::Covered;
use super::traverse::{Crossing, Nearest, Ray, Stack, TOUCH_MM, Tree, by_distance, collect};
use super::walk::Walk;
use super::{Effects, TraceConstants};
use crate::render::configuration::MOVES;
use crate::render::params::Params;
use crate::render::tables::{GpuTissue, HINT_BLOCK, SAMPLES_MAX, SEGMENTS, STARTS};

/// ln of the two-way amplitude at which a path ends: 10⁻¹³.
const LN_GIVEN_UP: f32 = -30.0;
/// ln of an amplitude that no display shows: 10⁻³⁴.
pub(super) const LN_SILENT: f32 = -80.0;
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

/// Where the medium changes on a path's way.
#[derive(Debug, Clone, Copy, Default)]
pub(super) struct Boundary {
    /// Surfaces that the path was inside.
    before: Inside,
    /// Tissue beyond, and whether its surface moves.
    there: u32,
    moves: bool,
    /// In leaf order.
    triangle: u32,
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

    /// Origin and direction of a path's first ray: the table's, moved to its elevational layer.
    fn launch(&self, ray: usize, [offset, slope]: [f32; 2]) -> (Vec3, Vec3) {
        let p = self.params;
        let origin = Vec4::from(self.rays[2 * ray]).xyz() + Vec3::new(0.0, offset, 0.0);
        let direction = Vec4::from(self.rays[2 * ray + 1]).xyz() + Vec3::new(0.0, slope, 0.0);
        let face = Vec3::new(p.lateral[3], p.elevational[3], p.axial[3]);
        (face + self.scene_vector(origin), self.scene_vector(direction).normalize())
    }

    fn medium_word(&self, inside: &Inside) -> u32 {
        medium_word(self.surface_words, self.params.background, inside)
    }

    /// The triangle at a place that is the interface: of the highest surface, and of its triangles the first of the scene.
    fn interface_of(&self, place: &[Crossing]) -> u32 {
        let order = |c: &&Crossing| {
            let triangle = &self.tree.triangles[c.triangle as usize];
            (triangle.surface, std::cmp::Reverse(triangle.triangle))
        };
        place.iter().max_by_key(order).map_or(0, |c| c.triangle)
    }

    /// Where path `path` begins.
    pub(super) fn begin(&self, path: usize) -> Walk {
        let p = self.params;
        let line_rays = (p.scanlines * p.rays) as usize;
        let (line_ray, number) = (path % line_rays, path / line_rays);
        // Behind the paths of all layers come the guides, along the axes, which follow the rays in their table.
        let guide = number >= p.layer_count as usize;
        let layer = p.layer_first as usize + number;
        let [offset, slope, weight, stretch] = if guide { [0.0, 0.0, 0.0, 1.0] } else { self.layers[layer] };
        let ray = if guide { path - line_rays * p.layer_count as usize + line_rays } else { line_ray };
        let (origin, direction) = self.launch(ray, [offset, slope]);
        let in_phase = weight / p.rays as f32;
        Walk {
            line_ray: line_ray as u32,
            layer: layer as u32,
            guide,
            stretch,
            origin,
            direction,
            in_phase,
            in_power: in_phase.sqrt(),
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
        cross_until(self.tree.triangles, behind, f32::INFINITY, &mut walk.inside);
        record.starts_inside = walk.inside;
        record.count = 0;
        walk.here = self.medium_word(&walk.inside) & (MOVES - 1);
        self.segment(walk, record);
    }

    /// Length of path a mm of range in the medium at hand. Ranges are depths: the lens delays its middle, so that an oblique
    /// layer's echoes come no later.
    #[inline(always)]
    fn path_per_range(&self, walk: &Walk) -> f32 {
        self.tissues[walk.here as usize].speed_ratio * walk.stretch
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
        let step = walk.direction * self.path_per_range(walk);
        let fall = tissue.attenuation_np_mm * self.path_per_range(walk);
        let from = walk.origin - walk.carried_mm - step * walk.range_mm;
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

    /// The highest surface that the path is inside; 0 where it is inside none: nothing lies below the first.
    #[inline(always)]
    pub(super) fn highest(walk: &Walk) -> u32 {
        highest(&walk.inside).unwrap_or(0)
    }

    /// Takes the path to its nearest crossing, within [`Self::left_mm`], through those that are `covered`: the interface
    /// there, if the medium changes.
    #[inline(always)]
    pub(super) fn advance(
        &self,
        walk: &mut Walk,
        found: Nearest,
        covered: &mut Covered,
        place: &mut Place,
    ) -> Option<Boundary> {
        let tissue = &self.tissues[walk.here as usize];
        let covered = covered.up_to(found.crossing.t + TOUCH_MM);
        let (passed, end, touching) = cross_until(self.tree.triangles, covered, found.crossing.t, &mut walk.inside);
        walk.crossed += 1 + passed;
        if walk.crossed > PLACES_MAX {
            walk.lost += 1;
            walk.open = false;
            return None;
        }
        // The place: that crossing, or a covered one that it touches, and where others lie within TOUCH_MM of it, all of them.
        let t = touching.first().map_or(found.crossing.t, |c| c.t.min(found.crossing.t));
        place.crossings[0] = found.crossing;
        let mut crossings = 1;
        if found.crowded || !touching.is_empty() {
            let least = walk.t_min.max(t - TOUCH_MM).max(end);
            let most = (t + TOUCH_MM).min(self.left_mm(walk));
            let ray = Ray::new(walk.origin, walk.direction);
            let (all, missed) = collect(&self.tree, &ray, least, most, &mut place.stack, &mut place.crossings);
            place.crossings[..all].sort_unstable_by(by_distance);
            crossings = all.max(1);
            walk.lost += missed;
        }
        let here = &place.crossings[..crossings];
        let here = &here[..here.partition_point(|c| c.t <= here[0].t + TOUCH_MM)];
        let before = walk.inside;
        cross(self.tree.triangles, here, &mut walk.inside);
        let there = self.medium_word(&walk.inside);
        walk.origin += walk.direction * t;
        walk.range_mm += t / self.path_per_range(walk);
        walk.ln_amplitude -= tissue.attenuation_np_mm * t;
        walk.t_min = TOUCH_MM;
        let changes = there & (MOVES - 1) != walk.here;
        changes.then(|| Boundary {
            before,
            there: there & (MOVES - 1),
            moves: there & MOVES != 0,
            triangle: self.interface_of(here),
        })
    }

    /// What a path that has come to the interface `at` must know of it.
    #[inline(always)]
    pub(super) fn arrival(&self, walk: &Walk, at: &Boundary) -> Arrival {
        let (tissue, beyond) = (&self.tissues[walk.here as usize], &self.tissues[at.there as usize]);
        let triangle = &self.tree.triangles[at.triangle as usize];
        let outward = Vec3::from(triangle.edge1).cross(Vec3::from(triangle.edge2));
        Arrival {
            origin: walk.origin.to_array(),
            direction: walk.direction.to_array(),
            outward: outward.to_array(),
            range_mm: walk.range_mm,
            path_per_range: self.path_per_range(walk),
            ln_amplitude: walk.ln_amplitude,
            in_phase: walk.in_phase,
            in_power: walk.in_power,
            // An interface is as rough and as thick as the rougher and the thicker of its two sides.
            roughness: tissue.roughness.max(beyond.roughness),
            thickness_mm: tissue.thickness_mm.max(beyond.thickness_mm),
            coherence: tissue.coherence.min(beyond.coherence),
            impedances_mrayl: [tissue.impedance_mrayl, beyond.impedance_mrayl],
            bending: [tissue.bending, beyond.bending],
            surface: triangle.surface,
            line_ray: walk.line_ray,
            layer: walk.layer,
            guide: walk.guide,
            bounce: walk.bounce,
        }
    }

    /// Sends a path on from the interface `at`, and writes the segment behind it.
    #[inline(always)]
    pub(super) fn depart(&self, walk: &mut Walk, at: &Boundary, departure: &Departure, record: &mut PathRecord) {
        walk.echo_range_mm = walk.range_mm;
        if self.effects.interface_echoes {
            walk.echo_range_mm += departure.echo_offset_mm;
            walk.echo = departure.echo;
        }
        walk.ln_amplitude += departure.ln_amplitude;
        walk.ln_scatter += departure.ln_scatter;
        walk.direction = Vec3::from(departure.direction);
        if departure.reflected {
            walk.inside = at.before;
            walk.reflections += 1;
            walk.open = walk.reflections <= self.params.reflections_max;
        } else {
            walk.here = at.there;
            if self.effects.moving {
                let displaced = || Vec4::from(self.displacements[at.triangle as usize]).xyz();
                walk.carried_mm = if at.moves { displaced() } else { Vec3::ZERO };
            }
        }
        // Nothing that far down is ever shown: −260 dB.
        walk.open = walk.open && walk.ln_amplitude > LN_GIVEN_UP;
        if !walk.open {
            walk.ln_amplitude = 2.0 * LN_SILENT;
        }
        walk.bounce += 1;
        self.segment(walk, record);
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
