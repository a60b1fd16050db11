//! Where paths start, and their first states.

use glam::{Vec3, Vec4, Vec4Swizzles};

use super::path::Scene;
use super::path_state::PathState;

impl Scene<'_> {
    /// Origin and direction of a path's first ray: the table's, moved across the slice.
    fn launch(&self, ray: usize, [offset, slope]: [f32; 2]) -> (Vec3, Vec3) {
        let p = self.params;
        let origin = Vec4::from(self.rays[2 * ray]).xyz() + Vec3::new(0.0, offset, 0.0);
        let direction = p.steered(Vec4::from(self.rays[2 * ray + 1]).xyz()) + Vec3::new(0.0, slope, 0.0);
        (p.face_mm() + p.scene_vector(origin), p.scene_vector(direction).normalize())
    }

    /// Elevational offset, slope and stretch of path `path`.
    fn elevation(&self, path: usize) -> [f32; 4] {
        let p = self.params;
        let line_rays = (p.scanlines * p.rays) as usize;
        let (line_ray, number) = (path % line_rays, path / line_rays);
        if number >= p.layer_count as usize {
            return [0.0, 0.0, 1.0, 0.0];
        }
        let layer = p.layer_first as usize + number;
        self.elevations[layer * p.rays as usize + line_ray % p.rays as usize]
    }

    /// Elevational place of path `path` at half of the depth, mm.
    pub(super) fn across_mm(&self, path: usize) -> f32 {
        let [offset, slope, ..] = self.elevation(path);
        offset + 0.5 * self.params.depth_mm * slope
    }

    /// Initial state of path `path`.
    pub(super) fn begin(&self, path: usize) -> PathState {
        let p = self.params;
        let line_rays = (p.scanlines * p.rays) as usize;
        let (line_ray, number) = (path % line_rays, path / line_rays);
        // Guides come after the paths of all layers, along the axes, which follow the rays in their table.
        let guide = number >= p.layer_count as usize;
        let layer = p.layer_first as usize + number;
        let [offset, slope, stretch, _] = self.elevation(path);
        let ray = if guide { path - line_rays * p.layer_count as usize + line_rays } else { line_ray };
        let (origin, direction) = self.launch(ray, [offset, slope]);
        // A guide's echoes stand for those of diverted paths, in their place.
        let (in_phase, in_power) = if guide { (1.0, 1.0) } else { (p.path_weight(), p.power_weight()) };
        PathState {
            line_ray: line_ray as u32,
            // Guides are the same in all batches.
            layer: if guide { 0 } else { layer as u32 },
            guide,
            stretch,
            face_depth_mm: self.rays[2 * ray][2],
            origin,
            direction,
            in_phase,
            in_power,
            open: true,
            ..PathState::default()
        }
    }
}
