//! Shadow of the shaft: for each cell of the scan plane, the share of the slice's intensity that the shaft covers.

use std::ops::Range;

use super::scanline::{Line, Scanline, clipped};
use super::{NeedleTables, Placed, View};
use crate::aperture::ApertureTables;

/// Number of positions within a cell at which the covered share is computed.
const POSITIONS: u32 = 4;
/// Smallest share that casts a shadow.
const LEAST: f64 = 1e-3;
/// Largest share, which keeps the transmission above 0.
const MOST: f64 = 0.999;

/// A cell of the scan plane behind the needle.
#[derive(Debug, Clone, Copy, PartialEq, bytemuck::Pod, bytemuck::Zeroable)]
#[repr(C)]
pub(crate) struct Shadow {
    /// Index of the cell [planes × cells].
    pub(crate) cell: u32,
    /// Amplitude that passes.
    pub(crate) passes: f32,
}

impl NeedleTables {
    /// Adds the shadows of `cells` of the face, each cell of the scan plane once. The shadow grows over the two depth planes
    /// behind the shaft. Its middle is one and a half planes behind it, so the needle's own echo stays as it is.
    pub(super) fn add_shadow(
        &self,
        placed: &Placed,
        view: View<'_>,
        aperture: &ApertureTables,
        cells: Range<usize>,
        into: &mut Vec<Shadow>,
    ) {
        let row_cells = aperture.sampling.cells;
        let spacing = f64::from(aperture.line_spacing_cells);
        let first = f64::from(aperture.line_cells.first().copied().unwrap_or_default());
        let fraction = |cell: f64| ((cell - first) / spacing + 0.5) / f64::from(view.probe.scanlines);
        for cell in cells {
            let (mut share, mut depth_mm) = (0.0, 0.0);
            for i in 0..POSITIONS {
                let position = cell as f64 + (f64::from(i) + 0.5) / f64::from(POSITIONS) - 0.5;
                let scanline = Scanline::at(view.probe, fraction(position), view.steer_rad);
                if let Some((covered, at_mm)) = self.covered_at(placed, &scanline, view.probe.depth_mm) {
                    share += covered / f64::from(POSITIONS);
                    depth_mm = at_mm;
                }
            }
            if share <= LEAST {
                continue;
            }
            // One-way amplitude: sound passes the shaft on its way out and on its way back. Two planes share its
            // logarithm, so that its middle has the same distance from every point of an oblique shaft.
            let passes = (1.0 - share.min(MOST)).sqrt();
            let position = (depth_mm / f64::from(aperture.plane_mm) - 0.5).max(-0.5);
            let plane = (position.floor() + 1.0) as usize;
            let deeper = position - position.floor();
            for (plane, part) in [(plane, 1.0 - deeper), (plane + 1, deeper)] {
                if plane < aperture.planes {
                    let passes = passes.powf(part) as f32;
                    into.push(Shadow { cell: (plane * row_cells + cell) as u32, passes });
                }
            }
        }
    }

    /// Share of the slice's intensity on a ray that the shaft covers, and the depth of the shaft there, mm; `None` if it
    /// covers nothing.
    fn covered_at(&self, placed: &Placed, scanline: &Scanline, depth_mm: f64) -> Option<(f64, f64)> {
        let direction = -scanline.vector(placed.direction);
        let line = Line { start_mm: scanline.point_mm(placed.axis_mm), direction };
        let across = direction.truncate();
        let slope = across.length();
        if slope < 1e-6 {
            return None;
        }
        // On the ray, x = 0. The shaft's projection on the lateral and elevational axes is a strip of half width a:
        // y within a of the axis, and between both ends.
        let (radius_mm, unit) = (self.settings.radius_mm(), across / slope);
        let start = line.start_mm.truncate();
        let slice = [-self.slice.reach_mm(), self.slice.reach_mm()];
        // Signed distance from the axis, and position along it, are linear in y.
        let near = clipped(slice, start.y * unit.x - start.x * unit.y, -unit.x, [-radius_mm, radius_mm])?;
        let along_at_zero = (-start).dot(unit);
        let covered = clipped(near, along_at_zero, unit.y, [0.0, self.settings.length_mm * slope])?;
        let middle_y = 0.0_f64.clamp(covered[0], covered[1]);
        let at_mm = line.at((along_at_zero + middle_y * unit.y) / slope).z;
        if !(0.0..=depth_mm).contains(&at_mm) {
            return None;
        }
        Some((self.slice.share(at_mm, covered), at_mm))
    }
}
