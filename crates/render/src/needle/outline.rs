//! Cross-section of the shaft with the image plane, for the segmentation.

use std::ops::Range;

use insonify_core::transducer::Sector;

use super::{NeedleTables, Placed};

/// A cylinder in the probe's frame, and the part of the image that may show its cross-section: `Outline` of
/// `shaders/needle_map.wgsl`, field by field.
#[derive(Debug, Clone, Copy, Default, PartialEq, bytemuck::Pod, bytemuck::Zeroable)]
#[repr(C)]
pub(crate) struct Outline {
    /// End of the axis at the tip, mm.
    pub(crate) tip_mm: [f32; 3],
    /// Length of the axis, mm.
    pub(crate) length_mm: f32,
    /// Unit vector from the tip to the hub.
    pub(crate) direction: [f32; 3],
    /// Radius, mm.
    pub(crate) radius_mm: f32,
    /// Probe-frame x and z of the image's upper left corner, mm.
    pub(crate) corner_mm: [f32; 2],
    /// Side of a pixel, mm.
    pub(crate) pixel_mm: f32,
    /// Number of the needle's tissue in the segmentation.
    pub(crate) tissue: u32,
    /// First column, a multiple of four, and first row.
    pub(crate) first: [u32; 2],
    /// Number of columns, a multiple of four, and of rows; 0 if the needle isn't in the image plane.
    pub(crate) size: [u32; 2],
}

impl Outline {
    pub(super) fn new(tables: &NeedleTables, placed: &Placed, sector: &Sector) -> Self {
        let (settings, toward_hub) = (&tables.settings, -placed.direction);
        let radius_mm = settings.radius_mm();
        let mut outline = Self {
            tip_mm: placed.axis_mm.as_vec3().to_array(),
            length_mm: settings.length_mm as f32,
            direction: toward_hub.as_vec3().to_array(),
            radius_mm: radius_mm as f32,
            corner_mm: sector.corner_mm.as_vec2().to_array(),
            pixel_mm: sector.pixel_mm as f32,
            tissue: tables.tissue,
            ..Self::default()
        };
        // Positions along the axis at which the shaft may meet the image plane.
        let (start_y, slope) = (placed.axis_mm.y, toward_hub.y);
        let [mut from, mut to] = [0.0, settings.length_mm];
        if slope.abs() > 1e-9 {
            let reach = radius_mm * (1.0 - slope * slope).max(0.0).sqrt();
            let [a, b] = [-reach, reach].map(|y| (y - start_y) / slope);
            (from, to) = (a.min(b).max(from), a.max(b).min(to));
        } else if start_y.abs() > radius_mm {
            return outline;
        }
        if from > to || tables.tissue == 0 {
            return outline;
        }
        let ends = [from, to].map(|at| placed.axis_mm + toward_hub * at).map(|end| (end.x, end.z));
        let [low, high] = [f64::min as fn(f64, f64) -> f64, f64::max].map(|of| {
            let point = glam::DVec2::new(of(ends[0].0, ends[1].0), of(ends[0].1, ends[1].1));
            sector.pixel_from_probe(point)
        });
        let margin = 2.0 + radius_mm / sector.pixel_mm;
        // Conversions saturate at the image's edges.
        let first = (low - margin).floor().max(glam::DVec2::ZERO);
        let (first_column, first_row) = (first.x as u32 / 4 * 4, first.y as u32);
        let end_column = ((high.x + margin).max(0.0) as u32).min(sector.width);
        let end_row = ((high.y + margin).max(0.0) as u32).min(sector.height);
        if end_column > first_column && end_row > first_row {
            outline.first = [first_column, first_row];
            outline.size = [(end_column - first_column).next_multiple_of(4), end_row - first_row];
        }
        outline
    }

    /// Columns of a row that the cross-section may cover, within `columns`.
    pub(crate) fn columns(&self, row: u32, columns: Range<u32>) -> Range<u32> {
        // Squared distance from the axis along the row: a·x² + 2·b·x + c, for x from the tip. In f64, because the
        // discriminant cancels.
        let [x, z] = self.corner_mm.map(f64::from);
        let ([tip_x, tip_y, tip_z], [dx, dy, dz]) = (self.tip_mm.map(f64::from), self.direction.map(f64::from));
        let (pixel_mm, radius_mm) = (f64::from(self.pixel_mm), f64::from(self.radius_mm));
        let (y, z) = (-tip_y, z + (f64::from(row) + 0.5) * pixel_mm - tip_z);
        let along = y * dy + z * dz;
        // The direction is rounded, and `covers` subtracts its part once.
        let fall = 2.0 - (dx * dx + dy * dy + dz * dz);
        let c = y * y + z * z - fall * along * along - radius_mm * radius_mm;
        let (a, b) = (1.0 - fall * dx * dx, -fall * along * dx);
        if a < 1e-6 {
            return columns;
        }
        // The test of a pixel rounds, but never moves a border by two pixels.
        let half = (b * b - a * c).max(0.0).sqrt() / a + 2.0 * pixel_mm;
        let column = |from_tip_mm: f64| (from_tip_mm + tip_x - x) / pixel_mm;
        let (from, to) = (column(-b / a - half).floor(), column(-b / a + half).ceil());
        // Conversions saturate.
        columns.start.max(from as u32)..columns.end.min(to as u32)
    }

    /// Whether the cross-section covers the centre of a pixel.
    #[inline(always)]
    pub(crate) fn covers(&self, column: u32, row: u32) -> bool {
        let x = self.corner_mm[0] + (column as f32 + 0.5) * self.pixel_mm - self.tip_mm[0];
        let z = self.corner_mm[1] + (row as f32 + 0.5) * self.pixel_mm - self.tip_mm[2];
        let y = -self.tip_mm[1];
        let [dx, dy, dz] = self.direction;
        let along = x * dx + y * dy + z * dz;
        let (ox, oy, oz) = (x - along * dx, y - along * dy, z - along * dz);
        let beside2 = ox * ox + oy * oy + oz * oz;
        (along >= 0.0) & (along <= self.length_mm) & (beside2 <= self.radius_mm * self.radius_mm)
    }
}

#[cfg(test)]
mod tests {
    use glam::Vec3;
    use insonify_core::random::SplitMix64;

    use super::*;

    #[test]
    fn pixels_outside_the_interval_are_not_covered() {
        let mut random = SplitMix64::new(3);
        let (mut covered, mut searched) = (0, 0);
        for case in 0..300 {
            // Some shafts are nearly parallel to the rows and to the image plane.
            let slant = if case % 3 == 0 { 0.01 } else { 1.0 };
            let mut within = |low: f64, high: f64| random.between(low, high) as f32;
            let outline = Outline {
                tip_mm: [within(-25.0, 25.0), within(-0.5, 0.5), within(0.0, 50.0)],
                length_mm: 40.0,
                direction: Vec3::new(within(-1.0, 1.0), within(-0.05, 0.05), slant * within(-0.5, 0.5))
                    .normalize_or(Vec3::X)
                    .to_array(),
                radius_mm: within(0.2, 0.9),
                corner_mm: [-20.0, 0.0],
                pixel_mm: 0.1,
                tissue: 1,
                ..Outline::default()
            };
            for row in (0..500).step_by(7) {
                let columns = outline.columns(row, 0..400);
                searched += columns.len();
                let outside = (0..400).filter(|column| !columns.contains(column));
                assert_eq!(outside.filter(|&column| outline.covers(column, row)).count(), 0, "{outline:?}, row {row}");
                covered += columns.filter(|&column| outline.covers(column, row)).count();
            }
        }
        assert!(covered > 10_000 && searched < 300 * 72 * 400 / 4, "{covered} {searched}");
    }
}
