//! Starts of paths: their first rays and first states.

use glam::{Vec3, Vec4, Vec4Swizzles};

use super::path::Scene;
use super::path_state::PathState;
use crate::params::Params;

/// Ray and layer of a path.
#[derive(Debug, Clone, Copy)]
struct PathNumber {
    /// Index of the ray in its layer [scanlines × rays]; for an axial path, the index of its scanline.
    line_ray: usize,
    /// Layer of the frame; `None` for an axial path.
    layer: Option<usize>,
}

impl Scene<'_> {
    /// Origin and direction of a path's first ray in the scene: ray `ray` of the table, with an elevational offset and
    /// slope.
    fn launch(&self, ray: usize, [offset, slope]: [f32; 2]) -> (Vec3, Vec3) {
        let p = self.params;
        let origin = Vec4::from(self.rays[2 * ray]).xyz() + Vec3::new(0.0, offset, 0.0);
        let direction = p.steered(Vec4::from(self.rays[2 * ray + 1]).xyz()) + Vec3::new(0.0, slope, 0.0);
        (p.face_mm() + p.scene_vector(origin), p.scene_vector(direction).normalize())
    }

    /// Ray and layer of path `path` of the batch. Axial paths come after the paths of all layers.
    fn number(&self, path: usize) -> PathNumber {
        let p = self.params;
        let line_rays = (p.scanlines * p.rays) as usize;
        let (line_ray, number) = (path % line_rays, path / line_rays);
        let layer = (number < p.layer_count as usize).then_some(p.layer_first as usize + number);
        PathNumber { line_ray, layer }
    }

    /// Elevational offset, slope and stretch of a path.
    fn elevation(&self, PathNumber { line_ray, layer }: PathNumber) -> [f32; 4] {
        let rays = self.params.rays as usize;
        layer.map_or([0.0, 0.0, 1.0, 0.0], |layer| self.elevations[layer * rays + line_ray % rays])
    }

    /// Elevational position of path `path` at half of the depth, mm.
    pub(super) fn across_mm(&self, path: usize) -> f32 {
        let [offset, slope, ..] = self.elevation(self.number(path));
        offset + 0.5 * self.params.depth_mm * slope
    }

    /// Initial state of path `path`.
    pub(super) fn begin(&self, path: usize) -> PathState {
        let p = self.params;
        let number @ PathNumber { line_ray, layer } = self.number(path);
        let is_axial = layer.is_none();
        let [offset, slope, stretch, _] = self.elevation(number);
        // Axial paths go along the axes, which follow the rays in their table.
        let before = p.scanlines * p.rays * p.layer_count.saturating_sub(1);
        let ray = if is_axial { path - before as usize } else { line_ray };
        let (origin, direction) = self.launch(ray, [offset, slope]);
        // An axial path's echoes replace those that reflected paths miss.
        let [in_phase, in_power] = if is_axial { [1.0; 2] } else { Params::echo_weights(p.path_weight()) };
        PathState {
            line_ray: line_ray as u32,
            // Axial paths are the same in all batches.
            layer: layer.unwrap_or(0) as u32,
            is_axial,
            follows_reflections: is_axial || p.follows_reflections(line_ray as u32, layer.unwrap_or(0) as u32),
            stretch,
            face_depth_mm: self.rays[2 * ray][2],
            origin,
            direction,
            start: origin,
            on_line: true,
            in_phase,
            in_power,
            open: true,
            ..PathState::default()
        }
    }
}
