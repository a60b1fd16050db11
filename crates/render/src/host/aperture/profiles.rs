//! Weights of a scanline's neighbours at each depth plane, from the amplitude of its beam at their positions.
//!
//! A beam that nothing bends or hides keeps the lateral kernel of its depth. Otherwise the beam's own amplitude gives
//! the weights, so that a scanline shows the tissue that its beam reaches.

use insonify_core::simd::{at_least, at_most, floor, widened_to_eight};
use rayon::prelude::*;

use crate::aperture::{ApertureTables, OFFSETS_MAX};
use crate::constants::{LATERAL_HALF_MAX, PROFILE_CUT, UNLIKE};
use crate::kernels::Kernels;
use crate::params::Params;

/// Most weights of a scanline's neighbours at a plane.
pub(in crate::host) const TAPS_MAX: usize = 2 * LATERAL_HALF_MAX as usize + 1;
/// Number of cells beyond a profile's ends that interpolation reads.
const OUTSIDE_CELLS: usize = 2;
/// Index of the beam axis in a two-sided profile.
const MIDDLE: usize = OFFSETS_MAX + OUTSIDE_CELLS;
/// Length of a two-sided profile.
const AROUND: usize = 2 * MIDDLE + 1;
/// Number of partial sums; fixed, so that every instruction set adds in the same order.
const SUMS: usize = 8;

/// Weights of one scanline at one plane: factor of the depth's kernel, first tap and end of the extra weights. First
/// tap and end are 0 without extra weights.
pub(in crate::host) type Blend = [f32; 3];

/// Outputs of the pass.
#[derive(Debug)]
pub(in crate::host) struct Profiles<'a> {
    /// Extra weights, added to the kernel times the blend's factor [planes × scanlines × (2·lateral_half + 1)]. They
    /// are zero outside of the blend's taps, and undefined if it has none.
    pub(in crate::host) weights: &'a mut [f32],
    /// Blend of each scanline at each plane [planes × scanlines].
    pub(in crate::host) blends: &'a mut [Blend],
}

/// Fills the outputs from the beams' `amplitudes`, an output of `beams`. Planes before `first` keep their kernels.
pub(in crate::host) fn profiles(
    params: &Params,
    tables: &ApertureTables,
    kernels: &Kernels,
    first: usize,
    amplitudes: &[f32],
    into: Profiles<'_>,
) {
    let taps = 2 * params.lateral_half as usize + 1;
    let lines = params.scanlines as usize;
    let of_plane = tables.sampling.beams * tables.sampling.cells;
    let positions = Positions::new(tables.line_spacing_cells, params.lateral_half as usize);
    let rows = into.weights.par_chunks_exact_mut(lines * taps).zip(into.blends.par_chunks_exact_mut(lines));
    rows.zip(amplitudes.par_chunks_exact(of_plane)).enumerate().for_each(|(plane, ((weights, blends), amplitudes))| {
        if plane < first {
            blends.fill([1.0, 0.0, 0.0]);
            return;
        }
        let kernel_power = kernels.power[tables.block_of(plane, params.samples)];
        weigh_plane(&PlaneBeams { tables, positions: &positions, plane, amplitudes }, kernel_power, weights, blends);
    });
}

widened_to_eight! {
    /// Makes the profiles of one plane.
    fn weigh_plane(
        beams: &PlaneBeams<'_>, kernel_power: f32, weights: &mut [f32], blends: &mut [Blend],
    ) = weigh_plane_body
}

#[inline(always)]
fn weigh_plane_body(beams: &PlaneBeams<'_>, kernel_power: f32, weights: &mut [f32], blends: &mut [Blend]) {
    let mut around = [0.0; AROUND];
    let plain = beams.unobstructed(kernel_power, &mut around);
    let taps = 2 * beams.positions.half + 1;
    for (line, (weights, blend)) in weights.chunks_exact_mut(taps).zip(blends).enumerate() {
        *blend = beams.weigh(line, &plain, &mut around, weights);
    }
}

/// Positions of a scanline's neighbours in a beam profile, the same for all scanlines.
struct Positions {
    /// Number of neighbours to either side.
    half: usize,
    /// Index, in a two-sided profile, of the first of the four values around each position.
    starts: [u16; TAPS_MAX],
    /// Weights of the four values by the Catmull-Rom spline.
    splines: [[f32; 4]; TAPS_MAX],
    /// Distance between neighbouring scanlines, in cells.
    spacing: f32,
}

impl Positions {
    fn new(spacing: f32, half: usize) -> Self {
        let mut positions = Self { half, starts: [0; TAPS_MAX], splines: [[0.0; 4]; TAPS_MAX], spacing };
        for (tap, (start, spline)) in
            positions.starts.iter_mut().zip(&mut positions.splines).enumerate().take(2 * half + 1)
        {
            let offset = (tap as f32 - half as f32) * spacing;
            let low = floor(offset);
            // Positions outside the profile lie outside the beam's reach.
            *start = (low + MIDDLE as i32 - 1).clamp(0, AROUND as i32 - 4) as u16;
            *spline = catmull_rom(offset - low as f32);
        }
        positions
    }

    /// Number of neighbours to either side within a distance in cells.
    fn within(&self, reach: f32) -> usize {
        (floor(reach / at_least(self.spacing, 1.0e-6)).max(0) as usize).min(self.half)
    }
}

/// Beams at one depth plane.
struct PlaneBeams<'a> {
    tables: &'a ApertureTables,
    positions: &'a Positions,
    plane: usize,
    /// Two-way amplitude of each beam of a period at each cell [beams × cells].
    amplitudes: &'a [f32],
}

/// Weights of a beam without obstacles, and the sum of their squares.
struct Plain {
    weights: [f32; TAPS_MAX],
    power: f32,
    /// Sum of squares of the depth's kernel.
    kernel_power: f32,
}

impl PlaneBeams<'_> {
    /// Weights of the unobstructed beam in the middle of the array. `around` is working memory.
    #[inline(always)]
    fn unobstructed(&self, kernel_power: f32, around: &mut [f32; AROUND]) -> Plain {
        let offsets = self.tables.sampling.offsets();
        let profile = &self.tables.profiles[self.plane * offsets..][..offsets];
        for (i, value) in around.iter_mut().enumerate() {
            *value = profile.get(i.abs_diff(MIDDLE)).copied().unwrap_or(0.0);
        }
        let mut weights = [0.0; TAPS_MAX];
        self.interpolate(around, &mut weights[..2 * self.positions.half + 1]);
        Plain { power: Similarity::of(&weights, &weights).power, weights, kernel_power }
    }

    /// Weights of the neighbouring scanlines: interpolates a beam profile, which `around` holds for each cell on both
    /// sides of the beam's axis. Weights beyond the beam's reach are 0.
    #[inline(always)]
    fn interpolate(&self, around: &[f32; AROUND], weights: &mut [f32]) {
        let Positions { half, starts, splines, .. } = self.positions;
        let within = self.positions.within(self.tables.reach_cells[self.plane]);
        let (from, to) = (half - within, half + within + 1);
        weights.fill(0.0);
        for ((weight, &start), spline) in weights[from..to].iter_mut().zip(&starts[from..to]).zip(&splines[from..to]) {
            let Some(near) = around.get(usize::from(start)..).and_then(|rest| rest.first_chunk::<4>()) else {
                continue;
            };
            let value = near[0] * spline[0] + near[1] * spline[1] + near[2] * spline[2] + near[3] * spline[3];
            *weight = at_least(value, 0.0);
        }
    }

    /// Fills in the extra weights of a scanline, and returns its blend.
    #[inline(always)]
    fn weigh(&self, line: usize, plain: &Plain, around: &mut [f32; AROUND], weights: &mut [f32]) -> Blend {
        let Self { tables, plane, amplitudes, .. } = *self;
        let sampling = &tables.sampling;
        let (cells, node_cells) = (sampling.cells, sampling.node_cells_at(plane));
        let node = at_most(
            at_least(tables.line_cells[line] / node_cells as f32, 0.0),
            sampling.nodes_at(plane) as f32 - 1.001,
        );
        let low = node as usize;
        let part = node - low as f32;
        let reach = (tables.reach_cells[plane] as usize + 1 + OUTSIDE_CELLS).min(MIDDLE);
        around[MIDDLE - reach..=MIDDLE + reach].fill(0.0);
        for (axis, share) in [(low, 1.0 - part), (low + 1, part)] {
            let row = &amplitudes[sampling.beam_of(plane, axis) * cells..][..cells];
            let middle = axis * node_cells;
            // The grid is periodic.
            let (before, to) = (reach.min(middle), (middle + reach + 1).min(cells));
            let pieces = [
                (MIDDLE - before, &row[middle - before..to]),
                (MIDDLE - reach, &row[cells - (reach - before)..]),
                (MIDDLE + cells - middle, &row[..middle + reach + 1 - to]),
            ];
            for (at, piece) in pieces {
                for (value, amplitude) in around[at.min(AROUND)..].iter_mut().zip(piece) {
                    *value += share * amplitude;
                }
            }
        }
        self.interpolate(around, weights);
        let Similarity { power, shared, greatest } = Similarity::of(weights, &plain.weights);
        let alike = shared * shared / at_least(power * plain.power, f32::MIN_POSITIVE);
        let kept =
            if power > 0.0 { at_least(1.0 - at_least(1.0 - alike, 0.0) * (1.0 / UNLIKE as f32), 0.0) } else { 1.0 };
        if kept >= 1.0 {
            return [1.0, 0.0, 0.0];
        }
        let scale = (1.0 - kept) * (plain.kernel_power / at_least(power, 1.0e-38)).sqrt();
        let least = PROFILE_CUT as f32 * greatest;
        let first = weights.iter().position(|&weight| weight >= least).unwrap_or(0);
        let end = weights.iter().rposition(|&weight| weight >= least).map_or(0, |last| last + 1);
        for (tap, weight) in weights.iter_mut().enumerate() {
            *weight = if tap >= first && tap < end { *weight * scale } else { 0.0 };
        }
        [kept, first as f32, end as f32]
    }
}

/// Comparison of two sets of weights, `weights` and `others`.
struct Similarity {
    /// Sum of squares of `weights`.
    power: f32,
    /// Sum of the products of `weights` and `others`.
    shared: f32,
    greatest: f32,
}

impl Similarity {
    #[inline(always)]
    fn of(weights: &[f32], others: &[f32]) -> Self {
        let (mut power, mut shared, mut greatest) = ([0.0_f32; SUMS], [0.0_f32; SUMS], [0.0_f32; SUMS]);
        let mut add = |lane: usize, weight: f32, other: f32| {
            power[lane] += weight * weight;
            shared[lane] += weight * other;
            greatest[lane] = at_least(greatest[lane], weight);
        };
        let (chunks, rest) = weights.as_chunks::<SUMS>();
        let (other_chunks, other_rest) = others.split_at(chunks.len() * SUMS);
        for (chunk, other) in chunks.iter().zip(other_chunks.as_chunks::<SUMS>().0) {
            for lane in 0..SUMS {
                add(lane, chunk[lane], other[lane]);
            }
        }
        for (lane, (&weight, &other)) in rest.iter().zip(other_rest).enumerate() {
            add(lane, weight, other);
        }
        Self {
            power: power.iter().sum(),
            shared: shared.iter().sum(),
            greatest: greatest.iter().copied().fold(0.0, f32::max),
        }
    }
}

/// Weights of four values for the Catmull-Rom spline, at the fraction `part` of the way from the second to the third.
fn catmull_rom(part: f32) -> [f32; 4] {
    let (square, cube) = (part * part, part * part * part);
    [
        0.5 * (2.0 * square - cube - part),
        0.5 * (3.0 * cube - 5.0 * square + 2.0),
        0.5 * (4.0 * square - 3.0 * cube + part),
        0.5 * (cube - square),
    ]
}
