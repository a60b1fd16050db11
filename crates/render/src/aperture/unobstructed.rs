//! Beams in a scan plane without obstacles: results of the passes `propagate` and `beams` if nothing absorbs or delays.

use rayon::prelude::*;
use rustfft::num_complex::Complex64;
use rustfft::{FftDirection, FftPlanner};

use super::beams::Beams;
use super::grid::Grid;

/// Beams of a homogeneous scan plane.
pub(super) struct Unobstructed {
    /// Greatest echo power of any beam at each depth plane `[planes]`.
    pub(super) greatest: Vec<f64>,
    /// Echo power of each beam relative to `greatest` [planes × cells]: lower at the ends of the array. Each row begins
    /// with one value per beam axis (node); the rest is 0.
    pub(super) shares: Vec<f64>,
    /// Two-way amplitude of the middle beam at offsets from its axis, one cell apart [planes × offsets].
    pub(super) profiles: Vec<f64>,
}

/// Computes the beams from [`Grid::steps`] and [`Grid::face`].
pub(super) fn unobstructed(grid: &Grid, beams: &Beams, steps: &[Complex64], face: &[f64]) -> Unobstructed {
    let sampling = grid.sampling;
    let mut planner = FftPlanner::new();
    let forward = planner.plan_fft(sampling.cells, FftDirection::Forward);
    let inverse = planner.plan_fft(sampling.cells, FftDirection::Inverse);
    let of_beams = planner.plan_fft(sampling.beams, FftDirection::Forward);

    let start = |mode: &Option<i32>| {
        let q = mode.map(|mode| grid.mode_wave_number(mode));
        let mut field: Vec<Complex64> = (0..sampling.cells)
            .map(|cell| {
                let across = (cell as f64 - 0.5 * sampling.cells as f64) * grid.cell_mm;
                q.map_or(Complex64::ZERO, |q| Complex64::from_polar(face[cell], q * across))
            })
            .collect();
        forward.process(&mut field);
        field
    };
    let mut spectra: Vec<Vec<Complex64>> = grid.modes.par_iter().map(start).collect();

    let mut all = Unobstructed { greatest: Vec::new(), shares: Vec::new(), profiles: Vec::new() };
    for plane in 0..grid.planes {
        let steps = &steps[plane * sampling.cells..][..sampling.cells];
        let scale = 1.0 / sampling.cells as f64;
        let fields: Vec<Vec<Complex64>> = spectra
            .par_iter_mut()
            .map(|spectrum| {
                spectrum.iter_mut().zip(steps).for_each(|(value, step)| *value *= step);
                let mut field = spectrum.clone();
                inverse.process(&mut field);
                field.iter_mut().for_each(|value| *value *= scale);
                field
            })
            .collect();

        let receive = &beams.receive[plane * grid.modes.len()..][..grid.modes.len()];
        let sum = |parts: &[Complex64], cell: usize| {
            let mut bins = vec![Complex64::ZERO; sampling.beams];
            for (slot, mode) in grid.modes.iter().enumerate().take(sampling.modes_at(plane)) {
                let Some(mode) = mode else { continue };
                bins[sampling.bin(plane, *mode)] += parts[slot] * fields[slot][cell];
            }
            of_beams.process(&mut bins);
            bins
        };
        let of_cell = |cell: usize| -> Vec<f64> {
            let (sent, heard) = (sum(&beams.transmit, cell), sum(receive, cell));
            sent.iter().zip(&heard).map(|(t, r)| t.norm_sqr() * r.norm_sqr()).collect()
        };
        let products: Vec<Vec<f64>> = (0..sampling.cells).into_par_iter().map(of_cell).collect();

        let (node_cells, nodes) = (sampling.node_cells_at(plane), sampling.nodes_at(plane));
        let reach = grid.reach_cells(plane);
        let power = |axis: usize| {
            let (beam, middle) = (sampling.beam_of(plane, axis), axis * node_cells);
            let returned = |(cell, products): (usize, &Vec<f64>)| {
                // The grid is periodic.
                let apart = cell.abs_diff(middle).min(sampling.cells - cell.abs_diff(middle));
                (reach + 0.5 - apart as f64).clamp(0.0, 1.0) * products[beam]
            };
            products.iter().enumerate().map(returned).sum::<f64>()
        };
        let powers: Vec<f64> = (0..nodes).map(power).collect();
        let greatest = powers.iter().copied().fold(f64::MIN_POSITIVE, f64::max);
        all.greatest.push(greatest);
        all.shares.extend(powers.iter().map(|power| power / greatest));
        all.shares.resize((plane + 1) * sampling.cells, 0.0);
        let middle = sampling.beam_of(plane, nodes / 2);
        let amplitude = |offset: usize| products.get(sampling.cells / 2 + offset).map_or(0.0, |p| p[middle].sqrt());
        all.profiles.extend((0..sampling.offsets()).map(amplitude));
    }
    all
}
