//! Propagation of the modes (waves along the face) from plane to plane, by plain Fourier sums. The scan plane's
//! transmission and delays act at each plane.

use glam::DVec2;
use rayon::prelude::*;

use super::aperture::Aperture;

/// Field of each mode at each cell of each plane [modes × planes × cells], before the plane's interval transmits and
/// delays it.
pub fn propagate(aperture: &Aperture, mask: &[DVec2]) -> Vec<DVec2> {
    let (cells, planes) = (aperture.cells, aperture.planes);
    let roots: Vec<DVec2> =
        (0..cells).map(|k| DVec2::from_angle(std::f64::consts::TAU * k as f64 / cells as f64)).collect();
    let mode = |slot: usize| -> Vec<DVec2> {
        let mut rows = vec![DVec2::ZERO; planes * cells];
        let Some(mode) = aperture.modes[slot] else { return rows };
        let period = aperture.beams * aperture.node_cells[0];
        let wave = |cell: usize| {
            let across = cell as f64 - (cells / 2) as f64;
            aperture.face[cell] * DVec2::from_angle(std::f64::consts::TAU * f64::from(mode) * across / period as f64)
        };
        let mut field: Vec<DVec2> = (0..cells).map(wave).collect();
        for plane in 0..planes {
            if slot >= aperture.mode_count[plane] {
                break;
            }
            let spectrum: Vec<DVec2> = (0..cells)
                .map(|k| {
                    let sum: DVec2 = (0..cells).map(|n| field[n].rotate(conjugate(roots[k * n % cells]))).sum();
                    sum.rotate(aperture.steps[plane * cells + k])
                })
                .collect();
            let at = |n: usize| (0..cells).map(|k| spectrum[k].rotate(roots[k * n % cells])).sum::<DVec2>();
            field = (0..cells).map(at).collect();
            rows[plane * cells..][..cells].copy_from_slice(&field);
            for (value, passes) in field.iter_mut().zip(&mask[plane * cells..][..cells]) {
                *value = value.rotate(*passes);
            }
        }
        rows
    };
    (0..aperture.modes.len()).into_par_iter().flat_map_iter(mode).collect()
}

fn conjugate(v: DVec2) -> DVec2 {
    DVec2::new(v.x, -v.y)
}
