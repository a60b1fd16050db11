//! Response of interfaces to a packet of paths: echoes, the choice of reflection, and new directions, as in
//! `shaders/trace.wgsl`.

use insonify_core::simd::{at_least, at_most, exp, floor, pcg3d, real, widened};

use super::interface::{
    Interface, Vector, acceptance, dot, interface_between, ln, microfacet, normalised, pick, plus, returning, scaled,
};
use super::interface_batch::{Arrivals, DIMENSIONS, Departures, set, vector};
use crate::constants::{CELL_MM, SURFACE_SALT};
use crate::host::constants::{FACET_COS_MIN, LN_SILENT, TraceConstants};
use crate::host::effects::PathEffects;
use crate::host::lanes::{Lanes, RAYS};

/// Parameters that all paths of a frame share.
#[derive(Debug, Clone, Copy)]
pub(super) struct Rules {
    pub(super) effects: PathEffects,
    pub(super) constants: TraceConstants,
    pub(super) seed: u32,
    /// Whether each scanline has one path in addition to its axial path.
    pub(super) single: bool,
    pub(super) aperture_mm: f32,
}

/// Fixed numbers that an axial path uses instead of random ones. It takes the likelier way at an untilted facet, so
/// chance doesn't move scatterers. A scanline's only path shares its facets with its axial path.
const AXIAL_NUMBERS: [f32; DIMENSIONS] = [0.5, 0.0, 0.0];

widened! {
    /// Fills `departures` for the paths of `arrivals`.
    pub(super) fn depart(arrivals: &Arrivals, departures: &mut Departures, rules: Rules) = depart_body
}

#[inline(always)]
fn depart_body(arrivals: &Arrivals, departures: &mut Departures, rules: Rules) {
    let (mut normals, mut facets) = ([[0.0; RAYS]; 3], [[0.0; RAYS]; 3]);
    let mut random = [[0.0; RAYS]; DIMENSIONS];
    draw(arrivals, &mut random, rules);
    tilt(arrivals, &random, &mut normals, &mut facets, rules.effects.roughness);
    transmit_or_reflect(arrivals, &random[0], &normals, &facets, departures, rules);
    if rules.effects.interface_echoes {
        return_echoes(arrivals, &facets, departures, rules);
    }
}

/// Draws the random numbers: `twin::hash::sample_unit`.
#[inline(always)]
fn draw(arrivals: &Arrivals, random: &mut [Lanes; DIMENSIONS], rules: Rules) {
    for (dim, random) in random.iter_mut().enumerate() {
        let generators = &arrivals.generators[dim];
        for i in 0..RAYS {
            let line_ray = arrivals.line_ray[i];
            let rotation =
                pcg3d([rules.seed, arrivals.layer[i], arrivals.bounce[i].wrapping_mul(4).wrapping_add(dim as u32)]);
            let low = line_ray.wrapping_mul(generators[i]).wrapping_add(rotation[0]);
            let plain = pcg3d([line_ray, rotation[0], rotation[1]])[0];
            let random_unit = unit(if generators[i] == 0 { plain } else { low });
            let is_fixed = (arrivals.is_axial[i] != 0) & ((dim == 0) | !rules.single);
            random[i] = if is_fixed { AXIAL_NUMBERS[dim] } else { random_unit };
        }
    }
}

/// Computes normals that face the paths, and the microfacets that the paths meet.
#[inline(always)]
#[allow(clippy::needless_range_loop, reason = "several arrays go together")]
fn tilt(
    arrivals: &Arrivals,
    random: &[Lanes; DIMENSIONS],
    normals: &mut [Lanes; 3],
    facets: &mut [Lanes; 3],
    rough: bool,
) {
    for i in 0..RAYS {
        let (outward, direction) = (vector(&arrivals.outward, i), vector(&arrivals.direction, i));
        let unit = scaled(outward, 1.0 / at_least(dot(outward, outward).sqrt(), 1.0e-30));
        let normal = pick(dot(unit, direction) > 0.0, scaled(unit, -1.0), unit);
        // Half of the roughness tilts the facet, half widens the lobe about it.
        let variance = 0.5 * arrivals.roughness[i] * arrivals.roughness[i];
        let facet = microfacet(normal, variance, random[1][i], random[2][i]);
        let tilts = rough & (variance > 0.0) & (dot(facet, direction) <= -FACET_COS_MIN);
        set(normals, i, normal);
        set(facets, i, pick(tilts, facet, normal));
    }
}

/// Ratio of the speeds beyond and before the interface. Exactly 1 for equal speeds: a GPU may round x/x.
#[inline(always)]
fn speed_ratio(bending: &[Lanes; 2], i: usize) -> f32 {
    let (here, beyond) = (bending[0][i], bending[1][i]);
    if beyond == here { 1.0 } else { beyond / here }
}

#[inline(always)]
fn between(arrivals: &Arrivals, i: usize, cos_incident: f32) -> Interface {
    let [z1, z2] = &arrivals.impedances_mrayl;
    interface_between(z1[i], z2[i], speed_ratio(&arrivals.bending, i), cos_incident)
}

/// Cosine of the angle between a path's reversed direction and a normal; 0 if it is obtuse.
#[inline(always)]
fn cos(normal: Vector, direction: Vector) -> f32 {
    at_most(at_least(-dot(normal, direction), 0.0), 1.0)
}

/// Decides which paths reflect, and their new directions. Echoes depend on the facet; paths follow the mean surface.
#[inline(always)]
#[allow(clippy::needless_range_loop, reason = "several arrays go together")]
fn transmit_or_reflect(
    arrivals: &Arrivals,
    random: &Lanes,
    normals: &[Lanes; 3],
    facets: &[Lanes; 3],
    departures: &mut Departures,
    rules: Rules,
) {
    let Rules { effects, constants, aperture_mm, .. } = rules;
    for i in 0..RAYS {
        let (direction, normal, facet) = (vector(&arrivals.direction, i), vector(normals, i), vector(facets, i));
        let cos_incident = cos(normal, direction);
        let split = between(arrivals, i, cos_incident);
        // Reflects with probability R, else transmits; reflections that hardly return are not followed.
        let roughness = arrivals.roughness[i];
        let accepted = acceptance(roughness * roughness, arrivals.range_mm[i], aperture_mm);
        let energy = split.energy_reflection;
        let follow = effects.reflections
            & (arrivals.follows_reflections[i] != 0)
            & (energy * accepted >= constants.reflection_followed());
        // With the aperture, an axial path passes every interface, since the aperture reaches the scatterers behind it.
        let passes = effects.aperture & (arrivals.is_axial[i] != 0);
        let reflected = effects.reflections & !passes & ((energy >= 1.0) | (follow & (random[i] < energy)));
        // A rough surface spreads part of the beam beyond the aperture, on the way out and back.
        let ln_passed = ln(at_least(1.0 - energy, 1.0e-30));
        let ln_kept = if reflected { ln(accepted) } else { ln_passed };
        let ln_reflected = 0.5 * ln(at_least(energy, 1.0e-30));
        let by_chance = follow & !reflected;
        let of_scatter = if by_chance { 0.5 * ln_kept } else { 0.0 };
        departures.ln_amplitude[i] = if by_chance { 0.0 } else { ln_kept };
        departures.ln_scatter[i] = if reflected { ln_reflected } else { of_scatter };
        departures.ln_passed[i] = ln_passed;
        departures.reflected[i] = u32::from(reflected);

        let turned = plus(direction, facet, 2.0 * cos(facet, direction));
        let mirrored = plus(direction, normal, -2.0 * dot(direction, normal));
        let turned = pick(dot(turned, normal) <= 0.0, mirrored, turned);
        let ratio = speed_ratio(&arrivals.path_bending, i);
        let cos_beyond = interface_between(1.0, 1.0, ratio, cos_incident).cos_transmitted;
        let bent = plus(scaled(direction, ratio), normal, ratio * cos_incident - cos_beyond);
        let bends = effects.refraction & (cos_beyond > 0.0) & (dot(bent, normal) < 0.0);
        let departs = normalised(pick(reflected, turned, bent));
        set(&mut departures.direction, i, pick(reflected | bends, departs, direction));
    }
}

/// Computes the echoes. Their ranges are shifted within the interface's thickness by a hash of the position.
#[inline(always)]
fn return_echoes(arrivals: &Arrivals, facets: &[Lanes; 3], departures: &mut Departures, rules: Rules) {
    let Rules { constants, aperture_mm, .. } = rules;
    for i in 0..RAYS {
        let salt = arrivals.surface[i].wrapping_add(1).wrapping_mul(SURFACE_SALT);
        let position = vector(&arrivals.origin, i);
        let cell = position.map(|x| floor((x + constants.off_the_grid_mm()) * (1.0 / CELL_MM as f32)) as u32 ^ salt);
        let offset = unit(pcg3d(cell)[0]) - 0.5;
        departures.echo_offset_mm[i] = offset * arrivals.thickness_mm[i] / arrivals.path_per_range[i];
    }
    for i in 0..RAYS {
        let cos_facet = cos(vector(facets, i), vector(&arrivals.direction, i));
        let at_facet = between(arrivals, i, cos_facet);
        let coherence = arrivals.coherence[i];
        let weight = arrivals.in_power[i] * (1.0 - coherence) + arrivals.in_phase[i] * coherence;
        let ln_amplitude = arrivals.ln_amplitude[i];
        let arriving = if ln_amplitude > LN_SILENT { exp(at_least(ln_amplitude, LN_SILENT)) } else { 0.0 };
        let returned =
            returning(cos_facet, arrivals.roughness[i], arrivals.range_mm[i], aperture_mm, constants.diffuse());
        departures.echo[i] = at_facet.pressure_reflection * returned * weight * arriving;
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
    use crate::host::trace::interface_batch::{Arrival, InterfaceBatch};
    use crate::twin::hash::sample_unit;

    /// Arrival at a random interface, at any angle. In some trials the speeds are equal, the interface is smooth, or the
    /// path has lost nothing.
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
            path_bending: [1.0, speed],
            surface: (100.0 * number(23)) as u32,
            line_ray: (8000.0 * number(24)) as u32,
            layer: (3.0 * number(25)) as u32,
            is_axial: number(27) < 0.1,
            follows_reflections: number(28) < 0.7,
            bounce: (9.0 * number(26)) as u32,
        }
    }

    #[test]
    fn every_instruction_set_gives_the_same_departures() {
        let on = PathEffects {
            moving: true,
            refraction: true,
            interface_echoes: true,
            roughness: true,
            reflections: true,
            aperture: false,
        };
        let rules = Rules { effects: on, constants: Default::default(), seed: 5, single: false, aperture_mm: 20.0 };
        let (mut batch, mut plain) = (InterfaceBatch::new(), InterfaceBatch::new());
        let (mut reflected, mut bent) = (0, 0);
        for trial in 0..500 {
            for of in [&mut batch, &mut plain] {
                of.clear();
                (0..RAYS as u32).for_each(|lane| of.push(&arrival(trial, lane)));
            }
            depart(&batch.arrivals, &mut batch.departures, rules);
            depart_body(&plain.arrivals, &mut plain.departures, rules);
            for i in 0..RAYS {
                let (one, other) = (batch.departure(i), plain.departure(i));
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
