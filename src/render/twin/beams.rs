//! Echo power of the beams at each plane, over that without obstacles.

use glam::DVec2;
use rayon::prelude::*;

use super::aperture::Aperture;

/// Echo power of the beam at each node [planes × cells], the first nodes of each row, from the fields of the modes.
pub fn beams(aperture: &Aperture, fields: &[DVec2]) -> Vec<f64> {
    let plane = |plane: usize| -> Vec<f64> {
        let nodes = aperture.nodes(plane);
        let power = |axis: usize| {
            let reach = aperture.reach_nodes[plane];
            let returned = |node: usize| {
                let inside = (reach + 0.5 - axis.abs_diff(node) as f64).clamp(0.0, 1.0);
                if inside > 0.0 { inside * echo(aperture, fields, plane, axis, node) } else { 0.0 }
            };
            (0..nodes).map(returned).sum::<f64>() / aperture.unobstructed[plane * aperture.cells + axis].max(1.0e-30)
        };
        let mut row: Vec<f64> = (0..nodes).map(power).collect();
        row.resize(aperture.cells, 0.0);
        row
    };
    (0..aperture.planes).into_par_iter().flat_map_iter(plane).collect()
}

/// Power that scatterers at a node return to the beam whose axis is at another.
fn echo(aperture: &Aperture, fields: &[DVec2], plane: usize, axis: usize, node: usize) -> f64 {
    // x = 0 is in the middle of the nodes.
    let beam = ((axis + aperture.nodes(plane) / 2) % aperture.beams) as f64;
    let receive = &aperture.receive[plane * aperture.modes.len()..][..aperture.modes.len()];
    let (mut sent, mut heard) = (DVec2::ZERO, DVec2::ZERO);
    for slot in 0..aperture.mode_count[plane] {
        let Some(mode) = aperture.modes[slot] else { continue };
        let turns = f64::from(mode / aperture.mode_stride[plane]) * beam / aperture.beams as f64;
        let field = fields[(slot * aperture.planes + plane) * aperture.cells + node];
        let turned = field.rotate(DVec2::from_angle(-std::f64::consts::TAU * turns));
        sent += turned.rotate(aperture.transmit[slot]);
        heard += turned.rotate(receive[slot]);
    }
    sent.length_squared() * heard.length_squared()
}
