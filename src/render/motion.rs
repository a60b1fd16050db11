//! A scene that moves, on the device.

use std::sync::Arc;

use super::plan::Effect;
use super::renderer::Renderer;
use crate::anatomy::bvh::PackedTriangle;

impl Renderer {
    /// Moves what moves in the scene to where it is at `time_s`, for the frames that are submitted from now on.
    ///
    /// Only corners and boxes that changed are uploaded; a scene that does not move costs nothing. A new renderer shows
    /// time 0, at which everything rests.
    pub fn set_time_s(&mut self, time_s: f64) {
        if self.bvh.moves() && self.now.effects.has(Effect::Motion) {
            self.move_to(time_s);
        }
    }

    /// Moves the scene to where it is at `time_s`, whatever the plan says.
    pub(super) fn move_to(&mut self, time_s: f64) {
        // Several renderers may start from one tree; each moves its own.
        let bvh = Arc::make_mut(&mut self.bvh);
        bvh.set_time_s(time_s);
        for changed in bvh.changed() {
            if let Some(host) = &mut self.host {
                host.take(bvh, changed);
            }
            if self.now.host_frame.is_some() {
                continue;
            }
            let nodes = &bvh.nodes[changed.nodes.clone()];
            let triangles = &bvh.triangles[changed.triangles.clone()];
            // Writes are in order with submissions: a frame in flight keeps what it was submitted with.
            self.gpu.queue.write_buffer(
                &self.scene.nodes,
                (changed.nodes.start * size_of::<[u32; 20]>()) as u64,
                bytemuck::cast_slice(nodes),
            );
            if !triangles.is_empty() {
                self.gpu.queue.write_buffer(
                    &self.scene.triangles,
                    (changed.triangles.start * size_of::<PackedTriangle>()) as u64,
                    bytemuck::cast_slice(triangles),
                );
                self.gpu.queue.write_buffer(
                    &self.scene.displacements,
                    (changed.triangles.start * size_of::<[f32; 4]>()) as u64,
                    bytemuck::cast_slice(&bvh.displacements()[changed.triangles.clone()]),
                );
            }
        }
    }
}
