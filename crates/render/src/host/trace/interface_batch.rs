//! A batch of paths at interfaces: arrivals and departures, as structures of arrays.

use super::interface::Vector;
use crate::constants::KRONECKER;
use crate::host::lanes::{Lanes, RAYS, Words};

/// Number of random numbers per interface: for the reflection, and for the facet's slope and azimuth.
pub(super) const DIMENSIONS: usize = 3;

/// State of a path that arrives at an interface, and the media on both sides.
#[derive(Debug, Clone, Copy)]
pub(super) struct Arrival {
    pub(super) origin: Vector,
    pub(super) direction: Vector,
    /// Outward normal of the surface, of any length.
    pub(super) outward: Vector,
    pub(super) range_mm: f32,
    pub(super) path_per_range: f32,
    pub(super) ln_amplitude: f32,
    pub(super) in_phase: f32,
    pub(super) in_power: f32,
    pub(super) roughness: f32,
    pub(super) thickness_mm: f32,
    pub(super) coherence: f32,
    /// Impedances before and beyond the interface.
    pub(super) impedances_mrayl: [f32; 2],
    /// c/c₀ in Snell's and Fresnel's laws, before and beyond the interface.
    pub(super) bending: [f32; 2],
    /// c/c₀ for the transmitted direction, before and beyond. Both are 1 until the path has reflected: beams bend by
    /// the delays over the aperture, not at a facet.
    pub(super) path_bending: [f32; 2],
    pub(super) surface: u32,
    pub(super) line_ray: u32,
    pub(super) layer: u32,
    pub(super) is_axial: bool,
    pub(super) follows_reflections: bool,
    pub(super) bounce: u32,
}

/// Changes of a path at an interface.
#[derive(Debug, Clone, Copy)]
pub(super) struct Departure {
    pub(super) direction: Vector,
    pub(super) reflected: bool,
    /// Changes of ln amplitude: of the whole path, and of its scatterers alone.
    pub(super) ln_amplitude: f32,
    pub(super) ln_scatter: f32,
    /// ln of the two-way amplitude that passes the interface.
    pub(super) ln_passed: f32,
    pub(super) echo: f32,
    /// Range of the echo minus range of the interface, mm.
    pub(super) echo_offset_mm: f32,
}

/// Paths that arrive at interfaces: each [`Arrival`] as a lane of a structure of arrays.
#[derive(Debug, Default)]
pub(super) struct Arrivals {
    pub(super) origin: [Lanes; 3],
    pub(super) direction: [Lanes; 3],
    pub(super) outward: [Lanes; 3],
    pub(super) range_mm: Lanes,
    pub(super) path_per_range: Lanes,
    pub(super) ln_amplitude: Lanes,
    pub(super) in_phase: Lanes,
    pub(super) in_power: Lanes,
    pub(super) roughness: Lanes,
    pub(super) thickness_mm: Lanes,
    pub(super) coherence: Lanes,
    pub(super) impedances_mrayl: [Lanes; 2],
    pub(super) bending: [Lanes; 2],
    pub(super) path_bending: [Lanes; 2],
    pub(super) surface: Words,
    pub(super) line_ray: Words,
    pub(super) layer: Words,
    /// 1 for an axial path, else 0.
    pub(super) is_axial: Words,
    /// 1 for a path that follows reflections, else 0.
    pub(super) follows_reflections: Words,
    pub(super) bounce: Words,
    /// Generators of the low-discrepancy numbers at the first interfaces; 0 at later interfaces (plain hashes).
    pub(super) generators: [Words; DIMENSIONS],
}

/// Paths that leave interfaces: each [`Departure`] as a lane of a structure of arrays.
#[derive(Debug, Default)]
pub(super) struct Departures {
    pub(super) direction: [Lanes; 3],
    /// 1 for a reflected path, else 0.
    pub(super) reflected: Words,
    pub(super) ln_amplitude: Lanes,
    pub(super) ln_scatter: Lanes,
    pub(super) ln_passed: Lanes,
    pub(super) echo: Lanes,
    pub(super) echo_offset_mm: Lanes,
}

/// Up to [`RAYS`] paths that are at interfaces at once.
#[derive(Debug)]
pub(super) struct InterfaceBatch {
    count: usize,
    pub(super) arrivals: Arrivals,
    pub(super) departures: Departures,
}

#[inline(always)]
pub(super) fn vector(of: &[Lanes; 3], i: usize) -> Vector {
    [of[0][i], of[1][i], of[2][i]]
}

#[inline(always)]
pub(super) fn set(of: &mut [Lanes; 3], i: usize, to: Vector) {
    for axis in 0..3 {
        of[axis][i] = to[axis];
    }
}

impl InterfaceBatch {
    pub(super) fn new() -> Self {
        // Lanes without a path are computed, too: their values must not divide by zero.
        let arrivals = Arrivals {
            path_per_range: [1.0; RAYS],
            impedances_mrayl: [[1.0; RAYS]; 2],
            bending: [[1.0; RAYS]; 2],
            path_bending: [[1.0; RAYS]; 2],
            ..Arrivals::default()
        };
        Self { count: 0, arrivals, departures: Departures::default() }
    }

    pub(super) fn clear(&mut self) {
        self.count = 0;
    }

    pub(super) fn len(&self) -> usize {
        self.count
    }

    /// Adds a path; at most [`RAYS`] fit.
    #[inline(always)]
    pub(super) fn push(&mut self, arrival: &Arrival) {
        debug_assert!(self.count < RAYS, "a path arrives once");
        let i = self.count % RAYS;
        self.count = i + 1;
        let arrivals = &mut self.arrivals;
        set(&mut arrivals.origin, i, arrival.origin);
        set(&mut arrivals.direction, i, arrival.direction);
        set(&mut arrivals.outward, i, arrival.outward);
        arrivals.range_mm[i] = arrival.range_mm;
        arrivals.path_per_range[i] = arrival.path_per_range;
        arrivals.ln_amplitude[i] = arrival.ln_amplitude;
        (arrivals.in_phase[i], arrivals.in_power[i]) = (arrival.in_phase, arrival.in_power);
        arrivals.roughness[i] = arrival.roughness;
        arrivals.thickness_mm[i] = arrival.thickness_mm;
        arrivals.coherence[i] = arrival.coherence;
        for side in 0..2 {
            arrivals.impedances_mrayl[side][i] = arrival.impedances_mrayl[side];
            arrivals.bending[side][i] = arrival.bending[side];
            arrivals.path_bending[side][i] = arrival.path_bending[side];
        }
        arrivals.surface[i] = arrival.surface;
        (arrivals.line_ray[i], arrivals.layer[i], arrivals.bounce[i]) =
            (arrival.line_ray, arrival.layer, arrival.bounce);
        arrivals.is_axial[i] = u32::from(arrival.is_axial);
        arrivals.follows_reflections[i] = u32::from(arrival.follows_reflections);
        let generators: [u32; 4] = KRONECKER.as_chunks().0.get(arrival.bounce as usize).copied().unwrap_or_default();
        for (dim, words) in arrivals.generators.iter_mut().enumerate() {
            words[i] = generators[dim];
        }
    }

    /// Departure of the `i`-th path.
    #[inline(always)]
    pub(super) fn departure(&self, i: usize) -> Departure {
        let departures = &self.departures;
        Departure {
            direction: vector(&departures.direction, i),
            reflected: departures.reflected[i] != 0,
            ln_amplitude: departures.ln_amplitude[i],
            ln_scatter: departures.ln_scatter[i],
            ln_passed: departures.ln_passed[i],
            echo: departures.echo[i],
            echo_offset_mm: departures.echo_offset_mm[i],
        }
    }
}
