//! Echo of the scatterers at a sample.

use glam::{DVec2, DVec3};

use super::inputs::{Inputs, SheetFamily};
use super::lattice;
use crate::constants::{SCATTERER_STRIDE, SHEETS};

/// Amplitude and density of a sample's scatterers, averaged over the paths of its scanline.
#[derive(Debug, Clone, Copy)]
pub(super) struct Strength {
    /// Mean of a scatterer's amplitude.
    pub(super) mean: f64,
    /// Standard deviation of a scatterer's amplitude.
    pub(super) deviation: f64,
    /// Fraction of the cells that contain a scatterer, in 1/131072.
    pub(super) density: f64,
}

/// A sample's position on its axial path.
#[derive(Debug, Clone, Copy)]
pub(super) struct Position {
    /// Scatterer lookup position, mm.
    pub(super) here_mm: DVec3,
    /// Change of that position per mm of range.
    pub(super) step: DVec3,
    /// Range, mm.
    pub(super) range_mm: f64,
}

/// Echo of the scatterer in the sample's lattice cell.
pub(super) fn of_lattice(inputs: &Inputs, position: Position, strength: Strength) -> DVec2 {
    let cell = lattice::cell(position.here_mm);
    let bits = lattice::hash(cell);
    let ahead = lattice::scatterer_mm(cell, bits[1]) - position.here_mm;
    scatterer(inputs, bits, ahead, position, strength)
}

/// Echo of the scatterers in the cells where the sample's elevational line meets sheets. `per_reach_mm` is 1/Y: sheets
/// within the elevational distance ±Y count.
pub(super) fn of_sheets(inputs: &Inputs, position: Position, strength: Strength, per_reach_mm: f64) -> DVec2 {
    inputs.sheets.iter().map(|family| of_family(inputs, family, position, strength, per_reach_mm)).sum()
}

fn of_family(
    inputs: &Inputs,
    family: &SheetFamily,
    position: Position,
    strength: Strength,
    per_reach_mm: f64,
) -> DVec2 {
    let [normal, first, second] = family.axes;
    let cell_mm = family.cell_mm;
    let across_mm = normal.dot(position.here_mm);
    let lowest = (across_mm / inputs.sheet_spacing_mm - 0.5 * f64::from(SHEETS)).floor() as i32 + 1;
    let (mut echo, mut squares) = (DVec2::ZERO, 0.0);
    for sheet in lowest..lowest + SHEETS as i32 {
        let off_mm = f64::from(sheet) * inputs.sheet_spacing_mm - across_mm;
        // Elevational distance to the sheet, over Y.
        let y = off_mm * family.oblique * per_reach_mm;
        let weight = (1.0 - y * y).max(0.0).powi(2);
        let met_mm = DVec2::new(first.dot(position.here_mm), second.dot(position.here_mm)) + off_mm * family.drift;
        let cell = (met_mm / cell_mm).floor();
        let bits = lattice::hash([cell.x as i32, cell.y as i32, sheet + family.salt as i32]);
        let ahead = |offset: DVec2| {
            let ahead_mm = (cell + offset) * cell_mm - met_mm;
            ahead_mm.x * first + ahead_mm.y * second
        };
        let (bits, ahead_mm) = if family.cell_scatterers > 1 {
            nearest(family.cell_scatterers, bits, ahead, position.step)
        } else {
            (bits, ahead(offset(bits[1])))
        };
        echo += weight * scatterer(inputs, bits, ahead_mm, position, strength);
        squares += weight * weight;
    }
    family.share / squares.sqrt() * echo
}

/// Position of a scatterer in its cell, in cells, from two ten-bit numbers of its random word.
fn offset(bits: u32) -> DVec2 {
    (DVec2::new((bits & 1023).into(), (bits >> 10 & 1023).into()) + 0.5) / 1024.0
}

/// Random words of the cell's scatterer nearest in range to the sample, and its offset from the sample, mm. Each
/// scatterer lies in its own quarter of the cell; two lie in opposite quarters.
fn nearest(scatterers: u32, bits: [u32; 3], ahead: impl Fn(DVec2) -> DVec3, step: DVec3) -> ([u32; 3], DVec3) {
    let [presence, position, amplitude] = bits;
    let of_quarter = |quarter: u32| {
        let after = |word: u32, stride: u32| word.wrapping_add(quarter.wrapping_mul(stride));
        let position_of = after(position, presence.wrapping_mul(SCATTERER_STRIDE));
        let corner = DVec2::new(((quarter ^ quarter >> 1) & 1).into(), (quarter & 1).into());
        let ahead_mm = ahead(0.5 * (corner + offset(position_of)));
        ([after(presence, amplitude), position_of, after(amplitude, position.wrapping_mul(SCATTERER_STRIDE))], ahead_mm)
    };
    let off = |ahead_mm: DVec3| ahead_mm.dot(step).abs();
    let first = of_quarter(0);
    (1..scatterers).map(of_quarter).fold(first, |best, other| if off(other.1) < off(best.1) { other } else { best })
}

/// Echo of a scatterer with the random words `bits`, at the offset `ahead_mm` from its sample.
fn scatterer(inputs: &Inputs, bits: [u32; 3], ahead_mm: DVec3, position: Position, strength: Strength) -> DVec2 {
    let [presence, _, amplitude] = bits;
    if f64::from(presence >> 15) >= strength.density {
        return DVec2::ZERO;
    }
    let amplitude = DVec2::new(strength.mean, 0.0) + strength.deviation * lattice::scatterer_deviate(amplitude);
    // The scatterer's own range sets the phase, whichever sample finds its cell.
    let ahead_mm = ahead_mm.dot(position.step) / position.step.length_squared();
    // `rotate` is the complex product.
    amplitude.rotate(inputs.carrier(position.range_mm + ahead_mm))
}

impl Inputs {
    /// Baseband phase factor of an echo at `range_mm`: e^(−i2k₀z) for 2k₀ = 2π·2f/c₀.
    pub fn carrier(&self, range_mm: f64) -> DVec2 {
        DVec2::from_angle(-std::f64::consts::TAU * (self.phase_turns_per_mm * range_mm).fract())
    }
}
