//! Echoes of the scatterers at a block of samples.

use insonify_core::simd::{at_least, floor, floored, pcg3d, phasor, real};

use crate::constants::{CELL_MM, CELL_QUARTERS, SHEET_FAMILIES, SHEETS};
use crate::host::constants::{DENSITY_ONE, DEVIATE_SCALE, ImageConstants, LEAST_POWER};
use crate::host::paths::{BLOCK, Lanes, Paths, range_mm, seek};
use crate::params::{Params, SheetFamily};
use crate::segment::Segment;

/// Number of values of [`View::of`], which tell where a sample's scatterers lie.
const VIEW_NUMBERS: usize = 8;

/// Amplitude and density of the scatterers at a block of samples, averaged over the paths.
#[derive(Debug, Clone, Copy)]
pub(in crate::host) struct Strength {
    /// Mean and deviation of a scatterer's amplitude.
    amplitude: [Lanes; 2],
    /// Fraction of the cells that contain a scatterer, in 1/131072.
    density: Lanes,
}

impl Strength {
    /// The strength of scatterers with a squared mean, a squared deviation, and their sum times the density. `gains`
    /// are factors of their amplitude.
    #[inline(always)]
    pub(in crate::host) fn new([mean2, deviation2, dense]: &[Lanes; 3], gains: &Lanes) -> Self {
        let (mut amplitude, mut density) = ([[0.0; BLOCK]; 2], [0.0; BLOCK]);
        // Plain loops: `map` of an array is a call, compiled without vector instructions.
        for i in 0..BLOCK {
            amplitude[0][i] = gains[i] * mean2[i].sqrt();
            amplitude[1][i] = gains[i] * deviation2[i].sqrt();
            density[i] = DENSITY_ONE * dense[i] / at_least(mean2[i] + deviation2[i], LEAST_POWER);
        }
        Self { amplitude, density }
    }
}

/// Axes of the scatterers' cells. For sheets, coordinates count sheets along the normal and cells within a sheet; for
/// the lattice, they are mm.
#[derive(Debug, Clone, Copy, Default)]
struct View {
    axes: [[f32; 3]; 3],
    /// Squared side of a cell, mm²: it makes [`View::of`] give ranges per cell.
    range: f32,
}

impl View {
    /// Origin and step of a segment along each axis, then the change of range per cell along the last two axes, mm.
    #[inline(always)]
    fn of(&self, segment: &Segment) -> [f32; VIEW_NUMBERS] {
        let along = |axis: &[f32; 3], [x, y, z]: [f32; 3]| axis[0] * x + axis[1] * y + axis[2] * z;
        let (origin, step @ [dx, dy, dz]) = (segment.origin_mm, segment.step);
        let per_step = self.range / at_least(dx * dx + dy * dy + dz * dz, 1.0e-12);
        let [a, b, c] = &self.axes;
        let [first, second] = [along(b, step), along(c, step)];
        [
            along(a, origin),
            along(a, step),
            along(b, origin),
            first,
            along(c, origin),
            second,
            first * per_step,
            second * per_step,
        ]
    }
}

/// The samples of a block on a path.
#[derive(Debug, Clone, Copy)]
pub(in crate::host) struct BlockOfPath<'a> {
    pub(in crate::host) params: &'a Params,
    pub(in crate::host) paths: &'a Paths<'a>,
    pub(in crate::host) path: u32,
    /// First sample.
    pub(in crate::host) first: u32,
}

impl BlockOfPath<'_> {
    /// [`View::of`] of each sample's segment. Two samples share a segment.
    #[inline(always)]
    fn in_view(&self, view: &View) -> [Lanes; VIEW_NUMBERS] {
        let Self { params, paths, path, first } = *self;
        let (end_mm, segment) = seek(params, paths, path, first);
        let mut lanes = [[0.0; BLOCK]; VIEW_NUMBERS];
        if range_mm(params, first.wrapping_add(BLOCK as u32 - 2)) < end_mm {
            for (lane, position) in lanes.iter_mut().zip(view.of(segment)) {
                *lane = [position; BLOCK];
            }
            return lanes;
        }
        for pair in 0..BLOCK / 2 {
            let segment = seek(params, paths, path, first.wrapping_add(2 * pair as u32)).1;
            for (lane, position) in lanes.iter_mut().zip(view.of(segment)) {
                lane[2 * pair] = position;
                lane[2 * pair + 1] = position;
            }
        }
        lanes
    }
}

/// A family of parallel sheets, in units of their spacing and of their cells.
#[derive(Debug, Clone, Copy, Default)]
struct Family {
    view: View,
    /// Shift of an elevational line from one sheet to the next, in cells along both axes of the sheets.
    drift: [f32; 2],
    /// Distance between neighbouring sheets along an elevational line, mm.
    pitch_mm: f32,
    share: f32,
    salt: u32,
    /// Number of scatterers in a cell.
    scatterers: u32,
}

/// Cells in which the elevational lines of a block's samples meet one sheet.
#[derive(Debug, Clone, Copy, Default)]
struct Met {
    weight: Lanes,
    /// Offset from a sample's point on the sheet to the cell's corner, in cells.
    ahead: [Lanes; 2],
    /// Random words of the cell.
    bits: [[u32; BLOCK]; 3],
    /// Range of the scatterer, mm.
    range_mm: Lanes,
}

impl Met {
    /// Takes the only scatterer of each cell. The last argument is the change of range per cell along both axes, mm.
    #[inline(always)]
    #[allow(clippy::needless_range_loop, reason = "several arrays go together")]
    fn take_only(&mut self, ranges_mm: &Lanes, [first_mm, second_mm]: [&Lanes; 2]) {
        for i in 0..BLOCK {
            let position = self.bits[1][i];
            let along = [self.ahead[0][i] + offset(position, 0), self.ahead[1][i] + offset(position, 10)];
            let ahead_mm = along[0] * first_mm[i] + along[1] * second_mm[i];
            self.range_mm[i] = ranges_mm[i] + ahead_mm;
        }
    }

    /// Selects, in each cell of `SCATTERERS` (2 to 4), the scatterer whose range is nearest to the sample's. Each
    /// scatterer lies in its own quarter; two lie in opposite quarters. The last argument is the change of range per
    /// cell along both axes, mm.
    #[inline(always)]
    #[allow(clippy::needless_range_loop, reason = "several arrays go together")]
    fn choose_nearest<const SCATTERERS: usize>(
        &mut self,
        stride: u32,
        ranges_mm: &Lanes,
        [first_mm, second_mm]: [&Lanes; 2],
    ) {
        let (mut nearest, mut ahead_mm) = ([0u32; BLOCK], [0.0; BLOCK]);
        for i in 0..BLOCK {
            // Compared in pairs: a running minimum over the quarters is stored to memory lane by lane.
            let mut along_mm = [f32::MAX; CELL_QUARTERS as usize];
            for (along_mm, quarter) in along_mm.iter_mut().zip(0u32..).take(SCATTERERS) {
                let corner = [(quarter ^ quarter >> 1) & 1, quarter & 1].map(|half| 0.5 * real(half));
                let position = self.bits[1][i].wrapping_add(quarter.wrapping_mul(self.bits[0][i].wrapping_mul(stride)));
                let first = self.ahead[0][i] + (corner[0] + 0.5 * offset(position, 0));
                let second = self.ahead[1][i] + (corner[1] + 0.5 * offset(position, 10));
                *along_mm = first * first_mm[i] + second * second_mm[i];
            }
            let [a, b, c, d] = along_mm;
            let low = if b.abs() < a.abs() { (b, 1) } else { (a, 0) };
            let high = if d.abs() < c.abs() { (d, 3) } else { (c, 2) };
            (ahead_mm[i], nearest[i]) = if high.0.abs() < low.0.abs() { high } else { low };
        }
        for i in 0..BLOCK {
            self.range_mm[i] = ranges_mm[i] + ahead_mm[i];
            let [presence, position, amplitude] = [self.bits[0][i], self.bits[1][i], self.bits[2][i]];
            self.bits[0][i] = presence.wrapping_add(nearest[i].wrapping_mul(amplitude));
            self.bits[2][i] = amplitude.wrapping_add(nearest[i].wrapping_mul(position.wrapping_mul(stride)));
        }
    }
}

/// A block of samples, and its scatterers.
#[derive(Debug, Clone, Copy)]
pub(in crate::host) struct Block {
    /// Range of each sample, mm.
    pub(in crate::host) ranges_mm: Lanes,
    /// 1/Y, 1/mm: sheets within the elevational distance ±Y count.
    pub(in crate::host) per_reach_mm: f32,
    pub(in crate::host) strength: Strength,
}

/// Scatterers of a frame: sheets of them, or one per cell of the lattice.
#[derive(Debug, Clone, Copy)]
pub(in crate::host) struct Speckle {
    phase_turns_per_mm: f32,
    families: [Family; SHEET_FAMILIES as usize],
    /// Number of `families` in use; 0 for the lattice.
    count: usize,
    /// Number of sheets looked up to one side of a sample.
    to_a_side: f32,
    /// See [`SCATTERER_STRIDE`](crate::constants::SCATTERER_STRIDE).
    stride: u32,
}

impl Speckle {
    /// The scatterers of a frame.
    #[inline(always)]
    pub(in crate::host) fn new(params: &Params, constants: ImageConstants) -> Self {
        let spacing_mm = params.sheet_spacing_mm;
        let per_sheet = 1.0 / at_least(spacing_mm, f32::MIN_POSITIVE);
        let family = |f: &SheetFamily| {
            let per_cell = 1.0 / at_least(f.cell_mm, f32::MIN_POSITIVE);
            Family {
                view: View {
                    axes: [scaled(f.normal, per_sheet), scaled(f.first, per_cell), scaled(f.second, per_cell)],
                    range: f.cell_mm * f.cell_mm,
                },
                drift: [f.first[3], f.second[3]].map(|way| way * (spacing_mm * per_cell)),
                pitch_mm: spacing_mm * f.normal[3],
                share: f.share,
                salt: f.salt,
                scatterers: f.cell_scatterers,
            }
        };
        Self {
            phase_turns_per_mm: params.phase_turns_per_mm,
            families: params.sheets.each_ref().map(family),
            count: params.sheet_families as usize,
            to_a_side: constants.sheets_to_a_side(),
            stride: constants.scatterer_stride(),
        }
    }

    /// Adds the echoes of a block to `sums`. `axial_path` sets where the block's samples lie.
    #[inline(always)]
    pub(in crate::host) fn echo(&self, block: &Block, axial_path: &BlockOfPath<'_>, sums: &mut [Lanes; 2]) {
        if self.count == 0 {
            const MM: View = View { axes: [[1.0, 0.0, 0.0], [0.0, 1.0, 0.0], [0.0, 0.0, 1.0]], range: 1.0 };
            self.lattice(block, &axial_path.in_view(&MM), sums);
        }
        for family in self.families.iter().take(self.count) {
            self.sheets(family, block, &axial_path.in_view(&family.view), sums);
        }
    }

    /// Adds the echo of the scatterer in each sample's cell of the lattice.
    #[inline(always)]
    fn lattice(&self, block: &Block, positions: &[Lanes; VIEW_NUMBERS], sums: &mut [Lanes; 2]) {
        let [x0, dx, y0, dy, z0, dz, ..] = positions;
        const CELL: f32 = CELL_MM as f32;
        let per_mm = 1.0 / CELL;
        for i in 0..BLOCK {
            let range_mm = block.ranges_mm[i];
            let here = [x0[i] + dx[i] * range_mm, y0[i] + dy[i] * range_mm, z0[i] + dz[i] * range_mm];
            let cell = here.map(|x| floor(x * per_mm));
            let bits = pcg3d(cell.map(|c| c as u32));
            // Position of the scatterer in its cell: three times ten bits.
            let ahead = |axis: usize| (cell[axis] as f32 + offset(bits[1], 10 * axis as u32)) * CELL - here[axis];
            let along = ahead(0) * dx[i] + ahead(1) * dy[i] + ahead(2) * dz[i];
            let ahead_mm = along / at_least(dx[i] * dx[i] + dy[i] * dy[i] + dz[i] * dz[i], 1.0e-12);
            let echo = self.scatterer(bits, range_mm + ahead_mm, &block.strength, i);
            sums[0][i] += echo[0];
            sums[1][i] += echo[1];
        }
    }

    /// Adds the echoes of the scatterers in the cells where the samples' elevational lines meet a family's sheets.
    ///
    /// Short loops, whose iterations overlap in the processor. One loop for the whole look-up would wait at each step.
    #[inline(always)]
    #[allow(clippy::needless_range_loop, reason = "several arrays go together")]
    fn sheets(&self, family: &Family, block: &Block, positions: &[Lanes; VIEW_NUMBERS], sums: &mut [Lanes; 2]) {
        let [across0, across_step, first0, first_step, second0, second_step, first_mm, second_mm] = positions;
        let mut at = [[0.0; BLOCK]; 3];
        for i in 0..BLOCK {
            let range_mm = block.ranges_mm[i];
            at[0][i] = across0[i] + across_step[i] * range_mm;
            at[1][i] = first0[i] + first_step[i] * range_mm;
            at[2][i] = second0[i] + second_step[i] * range_mm;
        }
        let mut met = [Met::default(); SHEETS as usize];
        for (slot, met) in (1u32..).zip(&mut met) {
            for i in 0..BLOCK {
                let (below, number) = floored(at[0][i] - self.to_a_side);
                let off = below + slot as i32 as f32 - at[0][i];
                let cells = [at[1][i] + off * family.drift[0], at[2][i] + off * family.drift[1]];
                let [first, second] = cells.map(floored);
                let sheet = number.wrapping_add(slot).wrapping_add(family.salt);
                let bits = pcg3d([first.1, second.1, sheet]);
                // Elevational distance to the sheet, over Y.
                let y = off * (family.pitch_mm * block.per_reach_mm);
                let bell = at_least(1.0 - y * y, 0.0);
                met.weight[i] = bell * bell;
                met.ahead[0][i] = first.0 - cells[0];
                met.ahead[1][i] = second.0 - cells[1];
                met.bits[0][i] = bits[0];
                met.bits[1][i] = bits[1];
                met.bits[2][i] = bits[2];
            }
        }
        for met in &mut met {
            let along = [first_mm, second_mm];
            match family.scatterers {
                0 | 1 => met.take_only(&block.ranges_mm, along),
                2 => met.choose_nearest::<2>(self.stride, &block.ranges_mm, along),
                3 => met.choose_nearest::<3>(self.stride, &block.ranges_mm, along),
                _ => met.choose_nearest::<4>(self.stride, &block.ranges_mm, along),
            }
        }
        let (mut echoes, mut squares) = ([[0.0; BLOCK]; 2], [0.0; BLOCK]);
        for met in &met {
            for i in 0..BLOCK {
                let bits = [met.bits[0][i], met.bits[1][i], met.bits[2][i]];
                let echo = self.scatterer(bits, met.range_mm[i], &block.strength, i);
                echoes[0][i] += met.weight[i] * echo[0];
                echoes[1][i] += met.weight[i] * echo[1];
                squares[i] += met.weight[i] * met.weight[i];
            }
        }
        for i in 0..BLOCK {
            let scale = family.share / at_least(squares[i], 1.0e-12).sqrt();
            sums[0][i] += scale * echoes[0][i];
            sums[1][i] += scale * echoes[1][i];
        }
    }

    /// Echo of the scatterer with the random words `bits` at a range, for sample `i` of a block.
    #[inline(always)]
    fn scatterer(&self, [presence, _, amplitude]: [u32; 3], range_mm: f32, strength: &Strength, i: usize) -> [f32; 2] {
        // The scatterer's own range sets the phase, whichever sample finds its cell.
        let turn = phasor(-self.phase_turns_per_mm * range_mm);
        let [mean, deviation] = [strength.amplitude[0][i], strength.amplitude[1][i]];
        let deviate = deviate(amplitude);
        let part = [mean + deviation * deviate[0], deviation * deviate[1]];
        let there = if real(presence >> 15) < strength.density[i] { 1.0 } else { 0.0 };
        let part = [there * part[0], there * part[1]];
        [part[0] * turn[0] - part[1] * turn[1], part[0] * turn[1] + part[1] * turn[0]]
    }
}

/// Position of a scatterer along one axis of its cell, 0..1: ten bits of its random word.
#[inline(always)]
fn offset(bits: u32, shift: u32) -> f32 {
    (real(bits >> shift & 1023) + 0.5) * (1.0 / 1024.0)
}

/// A complex number of mean 0 and mean square 1: its real and imaginary parts are sums of four nibbles each.
#[inline(always)]
pub(in crate::host) fn deviate(bits: u32) -> [f32; 2] {
    let pairs = (bits & 0x0f0f_0f0f).wrapping_add(bits >> 4 & 0x0f0f_0f0f);
    // The sum of four nibbles fits in a byte.
    let sums = pairs.wrapping_add(pairs >> 8);
    [sums, sums >> 16].map(|sum| (real(sum & 255) - 30.0) * DEVIATE_SCALE)
}

#[inline(always)]
fn scaled([x, y, z, _]: [f32; 4], by: f32) -> [f32; 3] {
    [x * by, y * by, z * by]
}
