//! The lattice of scatterers, fixed in the scene. A hash of a cell gives its scatterer: none is stored, and nothing
//! repeats.

use glam::{DVec2, DVec3};

use super::hash::pcg3d;
use crate::constants::CELL_MM;

/// Side of a cell as the device rounds it, mm.
const CELL_F32_MM: f32 = CELL_MM as f32;

/// Cell of the lattice that holds a point.
pub fn cell(point_mm: DVec3) -> [i32; 3] {
    // The device multiplies by this rounded number.
    let cells_per_mm = f64::from(1.0 / CELL_F32_MM);
    (point_mm * cells_per_mm).floor().as_ivec3().to_array()
}

/// Three random words of a cell: its scatterer's presence, position and amplitude.
pub fn hash(cell: [i32; 3]) -> [u32; 3] {
    pcg3d(cell.map(|c| c as u32))
}

/// Position of the scatterer in cell `cell`, mm; `bits` holds three ten-bit offsets within the cell.
pub fn scatterer_mm(cell: [i32; 3], bits: u32) -> DVec3 {
    let offset = |shift: u32| (f64::from((bits >> shift) & 1023) + 0.5) / 1024.0;
    let corner = DVec3::new(cell[0].into(), cell[1].into(), cell[2].into());
    (corner + DVec3::new(offset(0), offset(10), offset(20))) * f64::from(CELL_F32_MM)
}

/// A complex number of mean 0 and mean square 1, nearly Gaussian: its real and imaginary parts are sums of four nibbles
/// each (Irwin–Hall).
///
/// It stands for the many scatterers of a real cell: speckle is fully developed even if a pulse covers few cells.
pub fn scatterer_deviate(bits: u32) -> DVec2 {
    let sum = |from: u32| (0..4).map(|i| f64::from((bits >> (from + 4 * i)) & 15)).sum::<f64>();
    // Four times the variance of a nibble, (16² − 1)/12, in each of two parts.
    (DVec2::new(sum(0), sum(16)) - 30.0) / (2.0f64 * 4.0 * 255.0 / 12.0).sqrt()
}

#[cfg(test)]
mod tests {
    use super::*;

    #[test]
    fn amplitudes_have_no_mean_and_a_deviation_of_one() {
        let all = || (0..1 << 16).map(|i: u32| scatterer_deviate(i | (i.reverse_bits())));
        let mean = all().sum::<DVec2>() / 65536.0;
        let square = all().map(|v| v * v).sum::<DVec2>() / 65536.0;
        assert!(mean.length() < 1e-9 && (square - 0.5).length() < 1e-9, "{mean} {square}");
    }

    #[test]
    fn scatterers_lie_in_their_cells() {
        for point in [DVec3::new(0.01, -0.01, 12.34), DVec3::new(-77.7, 3.2, 0.0)] {
            let cell = cell(point);
            for bits in [0, u32::MAX, 0x1234_5678] {
                let offset = scatterer_mm(cell, bits) - point;
                assert!(offset.abs().max_element() < CELL_MM, "{offset}");
            }
        }
    }
}
