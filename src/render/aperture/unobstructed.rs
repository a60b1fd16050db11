//! Echo power of every beam in a scan plane without obstacles: what `propagate` and `beams` give if nothing absorbs.

use rayon::prelude::*;
use rustfft::num_complex::Complex64;
use rustfft::{FftDirection, FftPlanner};

use super::beams::Beams;
use super::grid::Grid;
use super::sampling::Sampling;

/// Echo power [planes × cells]; a row's first nodes are filled. `steps` and `face` are the grid's.
pub(super) fn echo_power(grid: &Grid, beams: &Beams, steps: &[Complex64], face: &[f64]) -> Vec<f64> {
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

    let mut powers = Vec::with_capacity(grid.planes * sampling.cells);
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

        let (node_cells, nodes) = (sampling.node_cells_at(plane), sampling.nodes_at(plane));
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
        let reach = grid.reach_nodes(plane);
        let furthest = (reach + 0.5) as isize;
        let mut row = vec![0.0; sampling.cells];
        let products: Vec<Vec<f64>> = (0..nodes)
            .into_par_iter()
            .map(|node| {
                let (sent, heard) = (sum(&beams.transmit, node * node_cells), sum(receive, node * node_cells));
                sent.iter().zip(&heard).map(|(t, r)| t.norm_sqr() * r.norm_sqr()).collect()
            })
            .collect();
        for (node, products) in products.iter().enumerate() {
            for away in -furthest..=furthest {
                let Some(axis) = node.checked_add_signed(away).filter(|&axis| axis < nodes) else { continue };
                let inside = (reach + 0.5 - away.unsigned_abs() as f64).clamp(0.0, 1.0);
                row[axis] += inside * products[beam_of(sampling, nodes, axis)];
            }
        }
        powers.extend(row);
    }
    powers
}

/// The beam, within a period, whose axis is at a node: x = 0 is in the middle of the nodes.
fn beam_of(sampling: Sampling, nodes: usize, axis: usize) -> usize {
    (axis + nodes / 2) % sampling.beams
}
