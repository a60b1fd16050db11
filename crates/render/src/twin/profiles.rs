//! Weights of a scanline's neighbours at each depth plane, from the amplitude of its beam at their positions.

use rayon::prelude::*;

use super::aperture::Aperture;
use super::inputs::Inputs;
use crate::constants::{PROFILE_CUT, UNLIKE};

/// Weights of a scanline's neighbours at one plane: the depth's kernel times `kept`, plus `weights`.
#[derive(Debug, Clone, PartialEq)]
pub struct Profile {
    /// Factor of the depth's kernel, 0..=1.
    pub kept: f64,
    /// Weights of the neighbours from −half to +half scanlines; zero where the beam hardly reaches.
    pub weights: Vec<f64>,
}

/// Profiles [planes × scanlines], from the beams' `amplitudes` [planes × beams × cells]. Planes before `first` are
/// unobstructed and keep their kernels.
pub fn profiles(inputs: &Inputs, aperture: &Aperture, first: usize, amplitudes: &[f64]) -> Vec<Profile> {
    let of_plane = |plane: usize| -> Vec<Profile> {
        let taps = inputs.lateral_kernels[0].len();
        if plane < first {
            return vec![Profile { kept: 1.0, weights: vec![0.0; taps] }; inputs.scanlines];
        }
        let beams = &amplitudes[plane * aperture.beams * aperture.cells..][..aperture.beams * aperture.cells];
        let profile = &aperture.profiles[plane * aperture.offsets..][..aperture.offsets];
        let at = |offset: isize| profile.get(offset.unsigned_abs()).copied().unwrap_or(0.0);
        let plain = weights(aperture, plane, taps, at);
        let kernel = &inputs.lateral_kernels[aperture.plane_blocks[plane]];
        (0..inputs.scanlines).map(|line| of_line(aperture, plane, line, beams, &plain, power(kernel))).collect()
    };
    (0..aperture.planes).into_par_iter().flat_map_iter(of_plane).collect()
}

fn of_line(aperture: &Aperture, plane: usize, line: usize, beams: &[f64], plain: &[f64], kernel_power: f64) -> Profile {
    let node_cells = aperture.node_cells[plane];
    let node = (aperture.line_cells[line] / node_cells as f64).clamp(0.0, aperture.nodes(plane) as f64 - 1.001);
    let low = node as usize;
    let of_axis = |axis: usize, offset: isize| {
        let row = &beams[aperture.beam_of(plane, axis) * aperture.cells..][..aperture.cells];
        // The grid is periodic.
        row[((axis * node_cells) as isize + offset).rem_euclid(aperture.cells as isize) as usize]
    };
    let part = node - low as f64;
    let at = |offset: isize| (1.0 - part) * of_axis(low, offset) + part * of_axis(low + 1, offset);
    let mut weights = weights(aperture, plane, plain.len(), at);
    let own = power(&weights);
    let shared: f64 = weights.iter().zip(plain).map(|(a, b)| a * b).sum();
    let unlike = 1.0 - shared * shared / (own * power(plain)).max(f64::MIN_POSITIVE);
    let kept = if own > 0.0 { (1.0 - unlike.max(0.0) / UNLIKE).max(0.0) } else { 1.0 };
    if kept >= 1.0 {
        return Profile { kept, weights: vec![0.0; plain.len()] };
    }
    let least = PROFILE_CUT * weights.iter().copied().fold(0.0, f64::max);
    let reaches = |weight: &f64| *weight >= least;
    let first = weights.iter().position(reaches).unwrap_or(0);
    let end = weights.iter().rposition(reaches).map_or(0, |last| last + 1);
    let scale = (1.0 - kept) * (kernel_power / own).sqrt();
    for (tap, weight) in weights.iter_mut().enumerate() {
        *weight *= if (first..end).contains(&tap) { scale } else { 0.0 };
    }
    Profile { kept, weights }
}

/// Resamples a beam profile at the neighbours' positions; zero beyond its reach. `at` gives the profile at whole cells
/// from the axis.
fn weights(aperture: &Aperture, plane: usize, taps: usize, at: impl Fn(isize) -> f64) -> Vec<f64> {
    let weight = |tap: usize| {
        let offset = (tap as f64 - (taps / 2) as f64) * aperture.line_spacing_cells;
        if offset.abs() > aperture.reach_cells[plane] {
            return 0.0;
        }
        let low = offset.floor();
        let [a, b, c, d] = [-1, 0, 1, 2].map(|offset| at(low as isize + offset));
        catmull_rom([a, b, c, d], offset - low).max(0.0)
    };
    (0..taps).map(weight).collect()
}

/// The Catmull-Rom spline through four values, at the fraction `part` of the way from the second to the third.
fn catmull_rom([a, b, c, d]: [f64; 4], part: f64) -> f64 {
    let bend = a - 2.5 * b + 2.0 * c - 0.5 * d;
    let twist = 0.5 * (d - a) + 1.5 * (b - c);
    b + part * (0.5 * (c - a) + part * (bend + part * twist))
}

/// Sum of squares.
fn power(weights: &[f64]) -> f64 {
    weights.iter().map(|weight| weight * weight).sum()
}
