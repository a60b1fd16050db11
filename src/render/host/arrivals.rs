//! Paths that have come to interfaces, a packet at once: what `shaders/trace.wgsl` does where the medium changes.

use super::interface::{
    Interface, Vector, acceptance, dot, interface_between, ln, microfacet, normalised, pick, plus, returning, scaled,
};
use super::packet::{Lanes, RAYS};
use super::path::{LN_SILENT, Scene};
use super::wide::{at_least, at_most, exp, floor, pcg3d, real, widened};
use super::{Effects, TraceConstants};
use crate::render::tables::CELL_MM;
use crate::render::twin::hash::generators;

/// A whole number of each path.
type Words = [u32; RAYS];

/// What a path's interface needs to know.
#[derive(Debug, Clone, Copy)]
pub(super) struct Arrival {
    pub(super) origin: Vector,
    pub(super) direction: Vector,
    /// Out of the surface, of any length.
    pub(super) outward: Vector,
    pub(super) range_mm: f32,
    pub(super) path_per_range: f32,
    pub(super) ln_amplitude: f32,
    pub(super) in_phase: f32,
    pub(super) in_power: f32,
    pub(super) roughness: f32,
    pub(super) thickness_mm: f32,
    pub(super) coherence: f32,
    /// Impedance before and beyond.
    pub(super) impedances_mrayl: [f32; 2],
    /// Of the speeds that bend, before and beyond.
    pub(super) bending: [f32; 2],
    pub(super) surface: u32,
    pub(super) line_ray: u32,
    pub(super) layer: u32,
    pub(super) guide: bool,
    pub(super) bounce: u32,
}

/// What becomes of a path at its interface.
#[derive(Debug, Clone, Copy)]
pub(super) struct Departure {
    pub(super) direction: Vector,
    pub(super) reflected: bool,
    /// Added to the path's ln of amplitude, and to that of its scatterers' alone.
    pub(super) ln_amplitude: f32,
    pub(super) ln_scatter: f32,
    pub(super) echo: f32,
    /// From the interface's range to its echo's, mm.
    pub(super) echo_offset_mm: f32,
}

/// Up to [`RAYS`] arrivals, and what becomes of them.
#[derive(Debug)]
pub(super) struct Arrivals {
    count: usize,
    come: Come,
    gone: Gone,
}

/// Arrivals, a number of each side by side.
#[derive(Debug)]
struct Come {
    origin: [Lanes; 3],
    direction: [Lanes; 3],
    outward: [Lanes; 3],
    range_mm: Lanes,
    path_per_range: Lanes,
    ln_amplitude: Lanes,
    in_phase: Lanes,
    in_power: Lanes,
    roughness: Lanes,
    thickness_mm: Lanes,
    coherence: Lanes,
    impedances_mrayl: [Lanes; 2],
    bending: [Lanes; 2],
    surface: Words,
    line_ray: Words,
    layer: Words,
    /// Not 0 for a guide.
    guide: Words,
    bounce: Words,
    /// Generators of the first interfaces' low-discrepancy numbers; later ones have none, and here 0.
    generators: [Words; DIMENSIONS],
}

/// Departures, a number of each side by side.
#[derive(Debug)]
struct Gone {
    direction: [Lanes; 3],
    /// Not 0 where it is reflected.
    reflected: Words,
    ln_amplitude: Lanes,
    ln_scatter: Lanes,
    echo: Lanes,
    echo_offset_mm: Lanes,
}

/// What holds for all paths.
#[derive(Debug, Clone, Copy)]
struct Rules {
    effects: Effects,
    constants: TraceConstants,
    seed: u32,
    aperture_mm: f32,
}

/// Random numbers of an interface: whether it reflects, and the facet's slope and azimuth.
const DIMENSIONS: usize = 3;
/// Those of a guide: the likelier way, off a facet that is not tilted, so that where scatterers lie is no matter of chance.
const OF_GUIDE: [f32; DIMENSIONS] = [0.5, 0.0, 0.0];

#[inline(always)]
fn vector(of: &[Lanes; 3], i: usize) -> Vector {
    [of[0][i], of[1][i], of[2][i]]
}

#[inline(always)]
fn set(of: &mut [Lanes; 3], i: usize, to: Vector) {
    for axis in 0..3 {
        of[axis][i] = to[axis];
    }
}

impl Arrivals {
    pub(super) fn new() -> Self {
        let (lanes, lanes3, words) = ([0.0; RAYS], [[0.0; RAYS]; 3], [0; RAYS]);
        // Those that never come are computed with the others.
        let come = Come {
            origin: lanes3,
            direction: lanes3,
            outward: lanes3,
            range_mm: lanes,
            path_per_range: [1.0; RAYS],
            ln_amplitude: lanes,
            in_phase: lanes,
            in_power: lanes,
            roughness: lanes,
            thickness_mm: lanes,
            coherence: lanes,
            impedances_mrayl: [[1.0; RAYS]; 2],
            bending: [[1.0; RAYS]; 2],
            surface: words,
            line_ray: words,
            layer: words,
            guide: words,
            bounce: words,
            generators: [words; DIMENSIONS],
        };
        let gone = Gone {
            direction: lanes3,
            reflected: words,
            ln_amplitude: lanes,
            ln_scatter: lanes,
            echo: lanes,
            echo_offset_mm: lanes,
        };
        Self { count: 0, come, gone }
    }

    pub(super) fn clear(&mut self) {
        self.count = 0;
    }

    pub(super) fn len(&self) -> usize {
        self.count
    }

    /// Takes one more, of at most [`RAYS`].
    #[inline(always)]
    pub(super) fn push(&mut self, arrival: &Arrival) {
        debug_assert!(self.count < RAYS, "a path arrives once");
        let i = self.count % RAYS;
        self.count = i + 1;
        let come = &mut self.come;
        set(&mut come.origin, i, arrival.origin);
        set(&mut come.direction, i, arrival.direction);
        set(&mut come.outward, i, arrival.outward);
        come.range_mm[i] = arrival.range_mm;
        come.path_per_range[i] = arrival.path_per_range;
        come.ln_amplitude[i] = arrival.ln_amplitude;
        (come.in_phase[i], come.in_power[i]) = (arrival.in_phase, arrival.in_power);
        come.roughness[i] = arrival.roughness;
        come.thickness_mm[i] = arrival.thickness_mm;
        come.coherence[i] = arrival.coherence;
        for side in 0..2 {
            come.impedances_mrayl[side][i] = arrival.impedances_mrayl[side];
            come.bending[side][i] = arrival.bending[side];
        }
        come.surface[i] = arrival.surface;
        (come.line_ray[i], come.layer[i], come.bounce[i]) = (arrival.line_ray, arrival.layer, arrival.bounce);
        come.guide[i] = u32::from(arrival.guide);
        let generators = generators(arrival.bounce).unwrap_or_default();
        for (dim, words) in come.generators.iter_mut().enumerate() {
            words[i] = generators[dim];
        }
    }

    /// What becomes of the `i`-th.
    #[inline(always)]
    pub(super) fn departure(&self, i: usize) -> Departure {
        let gone = &self.gone;
        Departure {
            direction: vector(&gone.direction, i),
            reflected: gone.reflected[i] != 0,
            ln_amplitude: gone.ln_amplitude[i],
            ln_scatter: gone.ln_scatter[i],
            echo: gone.echo[i],
            echo_offset_mm: gone.echo_offset_mm[i],
        }
    }

    /// Finds what becomes of all.
    pub(super) fn depart(&mut self, scene: &Scene<'_>) {
        let Scene { effects, constants, params, .. } = *scene;
        let rules = Rules { effects, constants: *constants, seed: params.seed, aperture_mm: params.aperture_mm };
        depart(&self.come, &mut self.gone, rules);
    }
}

widened! {
    /// What becomes of paths at their interfaces.
    fn depart(come: &Come, gone: &mut Gone, rules: Rules) = depart_body
}

#[inline(always)]
fn depart_body(come: &Come, gone: &mut Gone, rules: Rules) {
    let (mut normals, mut facets) = ([[0.0; RAYS]; 3], [[0.0; RAYS]; 3]);
    let mut random = [[0.0; RAYS]; DIMENSIONS];
    draw(come, &mut random, rules.seed);
    tilt(come, &random, &mut normals, &mut facets, rules.effects.roughness);
    go_on(come, &random[0], &normals, &facets, gone, rules);
    if rules.effects.interface_echoes {
        return_echoes(come, &facets, gone, rules);
    }
}

/// The random numbers: `twin::hash::sample_unit`.
#[inline(always)]
fn draw(come: &Come, random: &mut [Lanes; DIMENSIONS], seed: u32) {
    for (dim, random) in random.iter_mut().enumerate() {
        let generators = &come.generators[dim];
        for i in 0..RAYS {
            let line_ray = come.line_ray[i];
            let rotation = pcg3d([seed, come.layer[i], come.bounce[i].wrapping_mul(4).wrapping_add(dim as u32)]);
            let low = line_ray.wrapping_mul(generators[i]).wrapping_add(rotation[0]);
            let plain = pcg3d([line_ray, rotation[0], rotation[1]])[0];
            let random_unit = unit(if generators[i] == 0 { plain } else { low });
            random[i] = if come.guide[i] == 0 { random_unit } else { OF_GUIDE[dim] };
        }
    }
}

/// Normals against the paths, and the facets that they meet.
#[inline(always)]
#[allow(clippy::needless_range_loop, reason = "several arrays go together")]
fn tilt(come: &Come, random: &[Lanes; DIMENSIONS], normals: &mut [Lanes; 3], facets: &mut [Lanes; 3], rough: bool) {
    for i in 0..RAYS {
        let (outward, direction) = (vector(&come.outward, i), vector(&come.direction, i));
        let unit = scaled(outward, 1.0 / at_least(dot(outward, outward).sqrt(), 1.0e-30));
        let normal = pick(dot(unit, direction) > 0.0, scaled(unit, -1.0), unit);
        // Half of the roughness tilts the facet, half widens the lobe about it.
        let variance = 0.5 * come.roughness[i] * come.roughness[i];
        let facet = microfacet(normal, variance, random[1][i], random[2][i]);
        let tilts = rough & (variance > 0.0) & (dot(facet, direction) <= -0.02);
        set(normals, i, normal);
        set(facets, i, pick(tilts, facet, normal));
    }
}

/// Of the speeds beyond and before; a division may round x/x to other than 1.
#[inline(always)]
fn speed_ratio(come: &Come, i: usize) -> f32 {
    let (here, beyond) = (come.bending[0][i], come.bending[1][i]);
    if beyond == here { 1.0 } else { beyond / here }
}

#[inline(always)]
fn between(come: &Come, i: usize, cos_incident: f32) -> Interface {
    let [z1, z2] = &come.impedances_mrayl;
    interface_between(z1[i], z2[i], speed_ratio(come, i), cos_incident)
}

/// Cosine of a path's angle with a normal against it.
#[inline(always)]
fn cos(normal: Vector, direction: Vector) -> f32 {
    at_most(at_least(-dot(normal, direction), 0.0), 1.0)
}

/// Which are reflected, and where all go. What returns depends on the facet; what goes on follows the mean surface.
#[inline(always)]
#[allow(clippy::needless_range_loop, reason = "several arrays go together")]
fn go_on(come: &Come, random: &Lanes, normals: &[Lanes; 3], facets: &[Lanes; 3], gone: &mut Gone, rules: Rules) {
    let Rules { effects, constants, aperture_mm, .. } = rules;
    for i in 0..RAYS {
        let (direction, normal, facet) = (vector(&come.direction, i), vector(normals, i), vector(facets, i));
        let cos_incident = cos(normal, direction);
        let split = between(come, i, cos_incident);
        // Reflect with probability R or go on; reflections that hardly return are left to their weight.
        let roughness = come.roughness[i];
        let accepted = acceptance(roughness * roughness, come.range_mm[i], aperture_mm);
        let energy = split.energy_reflection;
        let follow = effects.reflections & (energy * accepted >= constants.reflection_followed);
        let reflected = effects.reflections & ((energy >= 1.0) | (follow & (random[i] < energy)));
        // A rough surface spreads the beam beyond what the aperture accepts, on both ways.
        let ln_kept = ln(if reflected { accepted } else { at_least(1.0 - energy, 1.0e-30) });
        let ln_reflected = 0.5 * ln(at_least(energy, 1.0e-30));
        let by_chance = follow & !reflected;
        let of_scatter = if by_chance { 0.5 * ln_kept } else { 0.0 };
        gone.ln_amplitude[i] = if by_chance { 0.0 } else { ln_kept };
        gone.ln_scatter[i] = if reflected { ln_reflected } else { of_scatter };
        gone.reflected[i] = u32::from(reflected);

        let turned = plus(direction, facet, 2.0 * cos(facet, direction));
        let mirrored = plus(direction, normal, -2.0 * dot(direction, normal));
        let turned = pick(dot(turned, normal) <= 0.0, mirrored, turned);
        let ratio = speed_ratio(come, i);
        let bent = plus(scaled(direction, ratio), normal, ratio * cos_incident - split.cos_transmitted);
        let bends = effects.refraction & (split.cos_transmitted > 0.0) & (dot(bent, normal) < 0.0);
        let departs = normalised(pick(reflected, turned, bent));
        set(&mut gone.direction, i, pick(reflected | bends, departs, direction));
    }
}

/// Echoes, spread over their interface's thickness at an offset that belongs to the place.
#[inline(always)]
fn return_echoes(come: &Come, facets: &[Lanes; 3], gone: &mut Gone, rules: Rules) {
    let Rules { constants, aperture_mm, .. } = rules;
    for i in 0..RAYS {
        let salt = come.surface[i].wrapping_add(1).wrapping_mul(7919);
        let place = vector(&come.origin, i);
        let cell = place.map(|x| floor((x + constants.off_the_grid_mm) * (1.0 / CELL_MM as f32)) as u32 ^ salt);
        let offset = unit(pcg3d(cell)[0]) - 0.5;
        gone.echo_offset_mm[i] = offset * come.thickness_mm[i] / come.path_per_range[i];
    }
    for i in 0..RAYS {
        let cos_facet = cos(vector(facets, i), vector(&come.direction, i));
        let at_facet = between(come, i, cos_facet);
        let coherence = come.coherence[i];
        let weight = come.in_power[i] * (1.0 - coherence) + come.in_phase[i] * coherence;
        let ln_amplitude = come.ln_amplitude[i];
        let arriving = if ln_amplitude > LN_SILENT { exp(at_least(ln_amplitude, LN_SILENT)) } else { 0.0 };
        let returned = returning(cos_facet, come.roughness[i], come.range_mm[i], aperture_mm, constants.diffuse);
        gone.echo[i] = at_facet.pressure_reflection * returned * weight * arriving;
    }
}

/// The upper 24 bits as a number in 0..1.
#[inline(always)]
fn unit(bits: u32) -> f32 {
    real(bits >> 8) * (1.0 / 16_777_216.0)
}

#[cfg(test)]
mod tests {
    use super::*;
    use crate::render::twin::hash::sample_unit;

    /// An interface by chance: now and then of one speed, smooth, faint or met along the surface.
    fn arrival(trial: u32, lane: u32) -> Arrival {
        let number = |dim| sample_unit(17, trial, lane, 9, dim) as f32;
        let vector = |first: u32| [0, 1, 2].map(|i| number(first + i) - 0.5);
        let often = |dim, value: f32| if number(dim) < 0.7 { value } else { 0.0 };
        let speed = 1.0 + often(20, number(0));
        Arrival {
            origin: vector(1).map(|x| 300.0 * x),
            direction: normalised(vector(4)),
            outward: vector(7),
            range_mm: 150.0 * number(10),
            path_per_range: 0.8 + 0.4 * number(11),
            ln_amplitude: -40.0 * often(21, number(12)),
            in_phase: number(13),
            in_power: number(14),
            roughness: often(22, number(15)),
            thickness_mm: 2.0 * number(16),
            coherence: number(17),
            impedances_mrayl: [0.1 + 2.0 * number(18), 0.1 + 6.0 * number(19)],
            bending: [1.0, speed],
            surface: (100.0 * number(23)) as u32,
            line_ray: (8000.0 * number(24)) as u32,
            layer: (3.0 * number(25)) as u32,
            guide: number(27) < 0.1,
            bounce: (9.0 * number(26)) as u32,
        }
    }

    #[test]
    fn every_processor_sends_paths_on_alike() {
        let on = Effects { moving: true, refraction: true, interface_echoes: true, roughness: true, reflections: true };
        let rules = Rules { effects: on, constants: TraceConstants::default(), seed: 5, aperture_mm: 20.0 };
        let (mut arrivals, mut plain) = (Arrivals::new(), Arrivals::new());
        let (mut reflected, mut bent) = (0, 0);
        for trial in 0..500 {
            for of in [&mut arrivals, &mut plain] {
                of.clear();
                (0..RAYS as u32).for_each(|lane| of.push(&arrival(trial, lane)));
            }
            depart(&arrivals.come, &mut arrivals.gone, rules);
            depart_body(&plain.come, &mut plain.gone, rules);
            for i in 0..RAYS {
                let (one, other) = (arrivals.departure(i), plain.departure(i));
                assert_eq!(format!("{one:?}"), format!("{other:?}"), "path {i} of packet {trial}");
                let length = dot(one.direction, one.direction);
                assert!((length - 1.0).abs() < 1.0e-5 && one.echo.is_finite(), "{one:?}");
                assert!(one.ln_amplitude <= 0.0 && one.ln_scatter <= 0.0, "{one:?}");
                reflected += u32::from(one.reflected);
                bent += u32::from(!one.reflected && one.direction != arrival(trial, i as u32).direction);
            }
        }
        assert!(reflected > 500 && bent > 500, "{reflected}, {bent}");
    }
}
