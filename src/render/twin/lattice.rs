//! The scatterer lattice, fixed in the scene: a pure hash of a cell, so that nothing repeats and nothing is stored.

use glam::DVec3;

use super::hash::pcg3d;
use crate::render::tables::CELL_MM;

/// Side of a cell as the device rounds it, mm.
const CELL_F32_MM: f32 = CELL_MM as f32;

/// The cell that a point lies in.
pub fn cell(point_mm: DVec3) -> [i32; 3] {
    // The device multiplies by this rounded number.
    let cells_per_mm = f64::from(1.0 / CELL_F32_MM);
    (point_mm * cells_per_mm).floor().as_ivec3().to_array()
}

/// Three random words of a cell: its scatterer's presence, place and amplitude.
pub fn hash(cell: [i32; 3]) -> [u32; 3] {
    pcg3d(cell.map(|c| c as u32))
}

/// Where in its cell the scatterer lies, mm: three times ten bits.
pub fn scatterer_mm(cell: [i32; 3], bits: u32) -> DVec3 {
    let offset = |shift: u32| (f64::from((bits >> shift) & 1023) + 0.5) / 1024.0;
    let corner = DVec3::new(cell[0].into(), cell[1].into(), cell[2].into());
    (corner + DVec3::new(offset(0), offset(10), offset(20))) * f64::from(CELL_F32_MM)
}

/// A nearly normal number of mean 0 and deviation 1: the sum of four bytes (Irwin–Hall).
pub fn normal(bits: u32) -> f64 {
    let sum: i32 = bits.to_le_bytes().into_iter().map(i32::from).sum();
    // Four times the variance of a byte, (256² − 1)/12.
    f64::from(sum - 510) / (4.0f64 * 65535.0 / 12.0).sqrt()
}

#[cfg(test)]
mod tests {
    use super::*;

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
