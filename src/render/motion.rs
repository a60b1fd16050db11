//! A scene that moves, on the device.

use super::renderer::Renderer;
use crate::anatomy::bvh::PackedTriangle;

impl Renderer {
    /// Moves what moves in the scene to where it is at `time_s`, for the frames that are submitted from now on.
    ///
    /// Only corners and boxes that changed are uploaded; a scene that does not move costs nothing. A new renderer shows
    /// time 0, at which everything rests.
    pub fn set_time_s(&mut self, time_s: f64) {
        self.bvh.set_time_s(time_s);
        for changed in self.bvh.changed() {
            let nodes = &self.bvh.nodes[changed.nodes.clone()];
            let triangles = &self.bvh.triangles[changed.triangles.clone()];
            // Writes are in order with submissions: a frame in flight keeps what it was submitted with.
            self.gpu.queue.write_buffer(
                &self.buffers.nodes,
                (changed.nodes.start * size_of::<[u32; 20]>()) as u64,
                bytemuck::cast_slice(nodes),
            );
            if !triangles.is_empty() {
                self.gpu.queue.write_buffer(
                    &self.buffers.triangles,
                    (changed.triangles.start * size_of::<PackedTriangle>()) as u64,
                    bytemuck::cast_slice(triangles),
                );
            }
        }
    }
}
