//! Echo power of every beam in a scan plane without obstacles: what `propagate` and `beams` give if nothing absorbs.

use rayon::prelude::*;
use rustfft::num_complex::Complex64;
use rustfft::{FftDirection, FftPlanner};

use super::beams::Beams;
use super::grid::Grid;

/// Echo power [planes × cells]; a row's first nodes are filled. `steps` and `face` are the grid's.
pub(super) fn echo_power(grid: &Grid, beams: &Beams, steps: &[Complex64], face: &[f64]) -> Vec<f64> {
    let mut planner = FftPlanner::new();
    let forward = planner.plan_fft(grid.cells, FftDirection::Forward);
    let inverse = planner.plan_fft(grid.cells, FftDirection::Inverse);
    let of_beams = planner.plan_fft(grid.beams, FftDirection::Forward);

    let start = |mode: &Option<i32>| {
        let q = mode.map(|mode| grid.mode_wave_number(mode));
        let mut field: Vec<Complex64> = (0..grid.cells)
            .map(|cell| {
                let across = (cell as f64 - 0.5 * grid.cells as f64) * grid.cell_mm;
                q.map_or(Complex64::ZERO, |q| Complex64::from_polar(face[cell], q * across))
            })
            .collect();
        forward.process(&mut field);
        field
    };
    let mut spectra: Vec<Vec<Complex64>> = grid.modes.par_iter().map(start).collect();

    let mut powers = Vec::with_capacity(grid.planes * grid.cells);
    for plane in 0..grid.planes {
        let steps = &steps[plane * grid.cells..][..grid.cells];
        let scale = 1.0 / grid.cells as f64;
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

        let node_cells = grid.node_cells_at(plane);
        let nodes = grid.cells / node_cells;
        let stride = if grid.whole(plane) || grid.node_cells == 1 { 1 } else { 2 };
        let lasting = if grid.whole(plane) { grid.modes.len() } else { grid.lasting_modes };
        let receive = &beams.receive[plane * grid.modes.len()..][..grid.modes.len()];
        let sum = |parts: &[Complex64], cell: usize| {
            let mut bins = vec![Complex64::ZERO; grid.beams];
            for (slot, mode) in grid.modes.iter().enumerate().take(lasting) {
                let Some(mode) = mode else { continue };
                bins[(mode / stride).rem_euclid(grid.beams as i32) as usize] += parts[slot] * fields[slot][cell];
            }
            of_beams.process(&mut bins);
            bins
        };
        let reach = grid.reach_nodes(plane);
        let furthest = (reach + 0.5) as isize;
        let mut row = vec![0.0; grid.cells];
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
                row[axis] += inside * products[beam_of(grid, nodes, axis)];
            }
        }
        powers.extend(row);
    }
    powers
}

/// The beam, within a period, whose axis is at a node: x = 0 is in the middle of the nodes.
fn beam_of(grid: &Grid, nodes: usize, axis: usize) -> usize {
    (axis + nodes / 2) % grid.beams
}
