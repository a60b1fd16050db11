//! Beams at each depth plane: their two-way amplitude at every cell, and their echo power relative to unobstructed
//! beams.

use glam::DVec2;
use rayon::prelude::*;

use super::aperture::Aperture;

/// Two-way amplitude of each beam of a period at each cell [planes × beams × cells], from the modes' fields [modes ×
/// planes × cells].
pub fn amplitudes(aperture: &Aperture, fields: &[DVec2]) -> Vec<f64> {
    let of_plane = |plane: usize| {
        let of_beam =
            move |beam: usize| (0..aperture.cells).map(move |cell| amplitude(aperture, fields, plane, beam, cell));
        (0..aperture.beams).flat_map(of_beam)
    };
    (0..aperture.planes).into_par_iter().flat_map_iter(of_plane).collect()
}

/// Echo power of each beam relative to the greatest one without obstacles [planes × cells]. Each row begins with one
/// value per beam axis (node); the rest is 0.
pub fn powers(aperture: &Aperture, amplitudes: &[f64]) -> Vec<f64> {
    let power = |plane: usize, axis: usize| {
        if axis >= aperture.nodes(plane) {
            return 0.0;
        }
        let row = &amplitudes[(plane * aperture.beams + aperture.beam_of(plane, axis)) * aperture.cells..];
        let middle = axis * aperture.node_cells[plane];
        let returned = |(cell, amplitude): (usize, &f64)| {
            // The grid is periodic.
            let apart = cell.abs_diff(middle).min(aperture.cells - cell.abs_diff(middle));
            let inside = (aperture.reach_cells[plane] + 0.5 - apart as f64).clamp(0.0, 1.0);
            inside * amplitude * amplitude
        };
        row.iter().take(aperture.cells).enumerate().map(returned).sum::<f64>() / aperture.greatest[plane].max(1.0e-30)
    };
    (0..aperture.planes).flat_map(|plane| (0..aperture.cells).map(move |axis| power(plane, axis))).collect()
}

/// Two-way amplitude of a beam at a cell.
fn amplitude(aperture: &Aperture, fields: &[DVec2], plane: usize, beam: usize, cell: usize) -> f64 {
    let receive = &aperture.receive[plane * aperture.modes.len()..][..aperture.modes.len()];
    let (mut sent, mut heard) = (DVec2::ZERO, DVec2::ZERO);
    for slot in 0..aperture.mode_count[plane] {
        let Some(mode) = aperture.modes[slot] else { continue };
        let turns = f64::from(mode / aperture.mode_stride[plane]) * beam as f64 / aperture.beams as f64;
        let field = fields[(slot * aperture.planes + plane) * aperture.cells + cell];
        let turned = field.rotate(DVec2::from_angle(-std::f64::consts::TAU * turns));
        sent += turned.rotate(aperture.transmit[slot]);
        heard += turned.rotate(receive[slot]);
    }
    sent.length() * heard.length()
}
