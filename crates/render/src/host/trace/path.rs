//! One path through the scene in f32: `shaders/locate.wgsl` and `shaders/trace.wgsl`, step by step.

use glam::{Vec3, Vec4, Vec4Swizzles};

use super::interface::ln;
use super::interface_batch::{Arrival, Departure};
use super::interface_response::Rules;
use super::line_crossings::LineCrossings;
use super::membership::{Inside, coupling, cross, cross_until, film_reach_mm, highest, medium_word};
use super::path_record::PathRecord;
use super::path_state::PathState;
use super::search::Covered;
use super::traverse::{Crossing, Nearest, Ray, Stack, Tree, by_distance, collect};
use crate::constants::{
    self as shared, CROSSINGS_AT_A_PLACE, HAS_REFLECTED, MOVES, PLACES_MAX, SEGMENTS, TAG, TISSUE_MASK,
};
use crate::host::constants::{BEYOND_MM, LN_GIVEN_UP, LN_SILENT, LN_UNCOUPLED, TOUCH_MM, TraceConstants};
use crate::host::effects::PathEffects;
use crate::params::Params;
use crate::segment::Segment;
use crate::tables::PackedTissue;

/// Capacity per path for crossings near its start: behind the face, and in front of it within reach of the gel film.
pub(super) const CROSSINGS_BEHIND: usize = shared::CROSSINGS_BEHIND as usize;

/// Inputs of path tracing.
#[derive(Debug, Clone, Copy)]
pub(in crate::host) struct Scene<'a> {
    pub(in crate::host) tree: Tree<'a>,
    /// Displacement of each triangle from its rest position; empty for static scenes.
    pub(in crate::host) displacements: &'a [[f32; 4]],
    /// Tissue of each surface, with [`MOVES`] if it moves.
    pub(in crate::host) surface_words: &'a [u32],
    /// Uniforms of the batch.
    pub(in crate::host) params: &'a Params,
    pub(in crate::host) rays: &'a [[f32; 4]],
    /// Elevational offset, slope and stretch of each path of a scanline [layers × rays].
    pub(in crate::host) elevations: &'a [[f32; 4]],
    pub(in crate::host) tissues: &'a [PackedTissue],
    pub(in crate::host) effects: PathEffects,
    pub(in crate::host) constants: TraceConstants,
}

/// Change of medium along a path.
#[derive(Debug, Clone, Copy, Default)]
pub(super) struct MediumChange {
    /// Surfaces that the path was inside before the interface.
    before: Inside,
    /// Tissue beyond, and whether its surface moves.
    there: u32,
    moves: bool,
    /// Triangle of the interface, in leaf order.
    triangle: u32,
}

/// The next interface of a path, as far as the crossings of its straight line tell.
#[derive(Debug, Clone, Copy)]
pub(super) enum NextInterface {
    At(MediumChange),
    /// Unknown until the tree is searched: the path has left its straight line, or crossings are missing.
    Unknown,
    /// The path ends before another interface.
    None,
}

/// Working memory for coincident crossings.
#[derive(Debug)]
pub(super) struct Coincident {
    stack: Stack,
    crossings: [Crossing; CROSSINGS_AT_A_PLACE as usize],
}

impl Coincident {
    pub(super) fn new() -> Self {
        Self { stack: Stack::new(), crossings: [Crossing::default(); CROSSINGS_AT_A_PLACE as usize] }
    }
}

impl Scene<'_> {
    /// Tissue at the state's position, with [`MOVES`] if its surface moves. Outside of all surfaces it is the
    /// background, or air beyond the film of gel.
    #[inline(always)]
    fn medium_word(&self, state: &PathState) -> u32 {
        let depth_mm = (state.origin - self.params.face_mm()).dot(self.params.scene_vector(Vec3::Z));
        medium_word(self.surface_words, self.params.outside(depth_mm), &state.inside)
    }

    /// Parameters of the interfaces' response.
    pub(super) fn rules(&self) -> Rules {
        let Self { effects, constants, params, .. } = *self;
        Rules { effects, constants, seed: params.seed, single: params.single(), aperture_mm: params.aperture_mm }
    }

    /// Index of the interface's triangle among coincident crossings: the first, in the scene's order, of the highest
    /// surface.
    fn interface_of(&self, coincident: &[Crossing]) -> u32 {
        let order = |c: &&Crossing| {
            let triangle = &self.tree.triangles[c.triangle as usize];
            (triangle.surface, std::cmp::Reverse(triangle.triangle))
        };
        coincident.iter().max_by_key(order).map_or(0, |c| c.triangle)
    }

    /// Search distance behind a path's start for the surfaces that contain the start, mm.
    #[inline(always)]
    pub(super) fn back_mm(&self) -> f32 {
        self.params.reach_mm * self.constants.reach()
    }

    /// Distance ahead of a path's start that is searched for skin, mm.
    #[inline(always)]
    pub(super) fn film_reach_mm(&self, state: &PathState) -> f32 {
        film_reach_mm(self.params.film_mm, state.face_depth_mm, self.down(state))
    }

    /// Depth that a path gains per mm of its length.
    #[inline(always)]
    fn down(&self, state: &PathState) -> f32 {
        state.direction.dot(self.params.scene_vector(Vec3::Z))
    }

    /// Finds the surfaces that the path starts inside, and its coupling, from the crossings `near` its start. Writes
    /// the path's first segment.
    #[inline(always)]
    pub(super) fn locate(&self, state: &mut PathState, near: &mut [Crossing], record: &mut PathRecord) {
        near.sort_unstable_by(by_distance);
        let (behind, ahead) = near.split_at(near.partition_point(|crossing| crossing.t <= 0.0));
        cross_until(self.tree.triangles, behind, f32::INFINITY, &mut state.inside);
        record.starts_inside = state.inside;
        record.coupling = coupling(self.params.film_mm, state.face_depth_mm, self.down(state), &state.inside, ahead);
        record.count = 0;
        state.here = self.medium_word(state) & TISSUE_MASK;
        if record.coupling < 1.0 {
            let coupled = record.coupling > 0.0;
            // Without coupling the path ends, unless the aperture's other parts may reach the tissue below.
            state.open = coupled || self.effects.aperture;
            state.ln_amplitude = 2.0 * if coupled { ln(record.coupling).max(LN_UNCOUPLED) } else { LN_UNCOUPLED };
            state.ln_passed = state.ln_amplitude;
        }
        self.segment(state, record);
    }

    /// Whether the aperture's gain replaces the path's own loss.
    #[inline(always)]
    fn by_aperture(&self, state: &PathState) -> bool {
        self.effects.aperture && !state.has_reflected
    }

    /// Length of path per mm of range in the current medium. Range counts depth: the lens delays its middle, so echoes
    /// of oblique layers come no later.
    #[inline(always)]
    fn path_per_range(&self, state: &PathState) -> f32 {
        let tissue = &self.tissues[state.here as usize];
        // For the aperture, slow hard media delay nothing behind them.
        let past_it = self.by_aperture(state) && tissue.aperture_speed_ratio > tissue.speed_ratio;
        state.stretch * if past_it { tissue.aperture_speed_ratio } else { tissue.speed_ratio }
    }

    /// [`Self::path_per_range`] of the aperture's sound, which goes around hard bodies.
    #[inline(always)]
    fn aperture_path_per_range(&self, state: &PathState) -> f32 {
        let aperture_speed_ratio = self.tissues[state.here as usize].aperture_speed_ratio;
        if self.by_aperture(state) { state.stretch * aperture_speed_ratio } else { self.path_per_range(state) }
    }

    /// Length of path left to the image's depth if the medium does not change, mm; zero or less if the path has ended.
    #[inline(always)]
    pub(super) fn left_mm(&self, state: &PathState) -> f32 {
        if state.open { (self.params.depth_mm - state.range_mm) * self.path_per_range(state) } else { 0.0 }
    }

    /// Writes the segment that begins at the path's position. Beyond the capacity it replaces the last segment, whose
    /// range then counts as the medium before it.
    #[inline(always)]
    fn segment(&self, state: &mut PathState, record: &mut PathRecord) {
        let tissue = &self.tissues[state.here as usize];
        let step = state.direction * self.path_per_range(state);
        // The loss of a fast body is spread over the range that it has for the aperture.
        let fall = tissue.attenuation_np_mm * self.aperture_path_per_range(state);
        let from = state.origin - state.carried_mm - step * state.range_mm;
        let (passed_mm, flag) = if state.has_reflected { (0.0, HAS_REFLECTED) } else { (state.range_mm, 0) };
        let count = record.count.min(SEGMENTS - 1) as usize;
        record.starts[count] = state.range_mm;
        record.segments[count] = Segment {
            origin_mm: from.to_array(),
            ln_amplitude_at_zero: state.ln_amplitude + state.ln_scatter + state.ln_share + fall * state.range_mm,
            step: step.to_array(),
            fall_np_mm: fall,
            scatterer_mean: tissue.scatterer_mean,
            scatterer_deviation: tissue.scatterer_deviation,
            scatterers: TAG | flag | tissue.scatterers,
            ln_passed_at_zero: state.ln_passed + fall * passed_mm,
        };
        record.echoes[count] = [state.echo, state.echo_range_mm];
        record.count = count as u32 + 1;
    }

    /// Index of the highest surface that the path is inside; 0 if none, since no surface is below surface 0.
    #[inline(always)]
    pub(super) fn highest(state: &PathState) -> u32 {
        highest(&state.inside).unwrap_or(0)
    }

    /// Advances the path to `found`, its nearest crossing within [`Self::left_mm`], and applies the `covered` crossings
    /// before it. Returns the change of medium there; `None` if the medium stays the same, or if the path ends after
    /// too many crossings.
    #[inline(always)]
    pub(super) fn advance(
        &self,
        state: &mut PathState,
        found: Nearest,
        covered: &mut Covered,
        coincident: &mut Coincident,
    ) -> Option<MediumChange> {
        let covered = covered.up_to(found.crossing.t + TOUCH_MM);
        let (passed, end, touching) = cross_until(self.tree.triangles, covered, found.crossing.t, &mut state.inside);
        state.crossed += 1 + passed;
        if state.crossed > PLACES_MAX {
            state.lost += 1;
            state.open = false;
            return None;
        }
        // Coincident crossings: `found` or a covered one that touches it, and all others within TOUCH_MM.
        let t = touching.first().map_or(found.crossing.t, |c| c.t.min(found.crossing.t));
        coincident.crossings[0] = found.crossing;
        let mut crossings = 1;
        if found.crowded || !touching.is_empty() {
            let least = state.t_min.max(t - TOUCH_MM).max(end);
            let most = (t + TOUCH_MM).min(self.left_mm(state));
            let ray = Ray::new(state.origin, state.direction);
            let Coincident { stack, crossings: into } = coincident;
            let (all, missed) = collect(&self.tree, &ray, least, most, stack, into);
            state.lost += missed;
            into[..all].sort_unstable_by(by_distance);
            crossings = all.max(1);
        }
        let here = &coincident.crossings[..crossings];
        let here = &here[..here.partition_point(|c| c.t <= here[0].t + TOUCH_MM)];
        self.cross(state, here, t, state.origin + state.direction * t)
    }

    /// Advances the path by `t` mm to coincident crossings at a position. Returns the change of medium there; `None` if
    /// the medium stays the same.
    #[inline(always)]
    fn cross(&self, state: &mut PathState, here: &[Crossing], t: f32, position: Vec3) -> Option<MediumChange> {
        let tissue = &self.tissues[state.here as usize];
        let before = state.inside;
        cross(self.tree.triangles, here, &mut state.inside);
        state.origin = position;
        let there = self.medium_word(state);
        let passed_mm = t / self.path_per_range(state);
        state.range_mm += passed_mm;
        state.behind_mm += t / self.aperture_path_per_range(state) - passed_mm;
        state.ln_amplitude -= tissue.attenuation_np_mm * t;
        state.ln_passed -= tissue.attenuation_np_mm * t;
        state.t_min = TOUCH_MM;
        let changes = there & TISSUE_MASK != state.here;
        changes.then(|| MediumChange {
            before,
            there: there & TISSUE_MASK,
            moves: there & MOVES != 0,
            triangle: self.interface_of(here),
        })
    }

    /// Advances a path on its straight line to its next interface.
    #[inline(always)]
    pub(super) fn go_straight(&self, state: &mut PathState, line: &LineCrossings) -> NextInterface {
        loop {
            let left_mm = self.left_mm(state);
            if left_mm <= 0.0 {
                return NextInterface::None;
            }
            let found = if state.on_line { line.next(&state.progress, left_mm) } else { None };
            let Some(here) = found else {
                state.on_line = false;
                return NextInterface::Unknown;
            };
            state.crossed += 1;
            let Some(first) = here.first().filter(|_| state.crossed <= PLACES_MAX) else {
                state.lost += here.len().min(1) as u32;
                state.open = false;
                return NextInterface::None;
            };
            let t = first.t - state.progress.travelled_mm;
            LineCrossings::pass(&mut state.progress, here);
            let position = state.start + state.direction * first.t;
            if let Some(change) = self.cross(state, here, t, position) {
                return NextInterface::At(change);
            }
        }
    }

    /// Distance up to which the crossings of a path's straight line are collected, mm.
    #[inline(always)]
    pub(super) fn line_mm(&self, state: &PathState) -> f32 {
        shared::FAST_MEDIA as f32 * state.stretch * self.params.depth_mm
    }

    /// State of a path on arrival at the interface `at`.
    #[inline(always)]
    pub(super) fn arrival(&self, state: &PathState, at: &MediumChange) -> Arrival {
        let (tissue, beyond) = (&self.tissues[state.here as usize], &self.tissues[at.there as usize]);
        let triangle = &self.tree.triangles[at.triangle as usize];
        let outward = Vec3::from(triangle.edge1).cross(Vec3::from(triangle.edge2));
        Arrival {
            origin: state.origin.to_array(),
            direction: state.direction.to_array(),
            outward: outward.to_array(),
            range_mm: state.range_mm,
            path_per_range: self.path_per_range(state),
            // The aperture's gain replaces the path's loss, in `echo`.
            ln_amplitude: if self.by_aperture(state) { 0.0 } else { state.ln_amplitude },
            in_phase: state.in_phase,
            in_power: state.in_power,
            // An interface has the larger roughness and thickness, and the smaller coherence, of its two sides.
            roughness: tissue.roughness.max(beyond.roughness),
            thickness_mm: tissue.thickness_mm.max(beyond.thickness_mm),
            coherence: tissue.coherence.min(beyond.coherence),
            impedances_mrayl: [tissue.impedance_mrayl, beyond.impedance_mrayl],
            bending: [tissue.bending, beyond.bending],
            path_bending: if state.has_reflected { [tissue.bending, beyond.bending] } else { [1.0; 2] },
            surface: triangle.surface,
            line_ray: state.line_ray,
            layer: state.layer,
            is_axial: state.is_axial,
            follows_reflections: state.follows_reflections,
            bounce: state.bounce,
        }
    }

    /// Continues a path from the interface `at` by reflection or transmission, and writes its next segment.
    #[inline(always)]
    pub(super) fn depart(
        &self,
        state: &mut PathState,
        at: &MediumChange,
        departure: &Departure,
        record: &mut PathRecord,
    ) {
        state.echo_range_mm = state.range_mm;
        if self.effects.interface_echoes {
            state.echo_range_mm += departure.echo_offset_mm;
            state.echo = departure.echo;
        }
        if !state.has_reflected {
            state.ln_passed += departure.ln_passed;
            if departure.reflected && !state.is_axial {
                [state.in_phase, state.in_power] = Params::echo_weights(self.params.reflected_weight());
                // Powers of scatterers add over the paths.
                state.ln_share = 0.5 * ln(self.params.reflected_weight() / self.params.path_weight());
            }
        }
        state.has_reflected |= departure.reflected;
        state.ln_amplitude += departure.ln_amplitude;
        state.ln_scatter += departure.ln_scatter;
        state.direction = Vec3::from(departure.direction);
        if departure.reflected {
            state.inside = at.before;
            state.on_line = false;
            state.reflections += 1;
            // Total reflection turns back every path; only those that follow reflections go on.
            state.open = state.follows_reflections && state.reflections <= self.params.reflections_max;
        } else {
            state.here = at.there;
            let beyond = &self.tissues[at.there as usize];
            if self.by_aperture(state) && beyond.speed_ratio <= beyond.aperture_speed_ratio {
                // Echoes from behind a fast body go around it, so the range that the path saved in it is added again.
                state.range_mm += state.behind_mm;
                state.behind_mm = 0.0;
            }
            if self.effects.moving {
                let displaced = || Vec4::from(self.displacements[at.triangle as usize]).xyz();
                state.carried_mm = if at.moves { displaced() } else { Vec3::ZERO };
            }
        }
        // Ends paths below −260 dB, which no display shows.
        state.open = state.open && (self.by_aperture(state) || state.ln_amplitude > LN_GIVEN_UP);
        if !state.open {
            state.ln_amplitude = 2.0 * LN_SILENT;
        }
        state.bounce += 1;
        self.segment(state, record);
    }

    /// Completes the record of a path that has ended.
    #[inline(always)]
    pub(super) fn end(&self, record: &mut PathRecord) {
        record.starts[record.count as usize] = BEYOND_MM;
        record.hint(self.params);
    }
}
