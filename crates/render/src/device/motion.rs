//! Motion of the scene on the device. Per frame, only the fields' amounts are uploaded.

use bytemuck::{Pod, Zeroable};
use glam::{DVec3, Vec3};
use insonify_core::anatomy::bvh::MotionTables;
use insonify_core::anatomy::motion::Shape;

use super::buffers::SceneBuffers;
use super::gpu::{Gpu, UNIFORM};
use super::passes::{Pass, Pipelines, Specialised};
use super::shaders::Shader;
use crate::constants::{FIELDS_MAX, MOTION_GROUP};
use crate::error::BackendError;

/// Distance between the uniforms of two [`Step`]s in their buffer, bytes: the largest alignment of any device.
const STEP_STRIDE: u64 = 256;

/// A displacement field: `Field` of `shaders/shared/motion.wgsl`.
#[derive(Debug, Clone, Copy, Default, Pod, Zeroable)]
#[repr(C)]
struct Field {
    origin: [f32; 3],
    kind: u32,
    axis: [f32; 3],
    radius_mm: f32,
    form: [f32; 3],
    turns: f32,
    amounts: [f32; 2],
    unused: [f32; 2],
}

/// Displacement fields, and a bit set of the fields whose amounts have changed.
#[derive(Debug, Clone, Copy, Default, Pod, Zeroable)]
#[repr(C)]
struct Uniforms {
    fields: [Field; FIELDS_MAX as usize],
    changed: u32,
    unused: [u32; 3],
}

/// Part of the motion tables that one dispatch works on: index of the first element, and count.
#[derive(Debug, Clone, Copy, Pod, Zeroable)]
#[repr(C)]
struct Step {
    first: u32,
    count: u32,
    unused: [u32; 2],
}

/// Buffers of the moving parts of the scene, and the passes that move them.
#[derive(Debug)]
pub(super) struct Motion {
    uniforms: Uniforms,
    uniform_buffer: wgpu::Buffer,
    /// Amounts of each displacement field for the next frame; `None` before the first motion.
    wanted: Option<Vec<[f32; 2]>>,
    /// Amounts that are on the device; `None` before the first motion.
    present: Option<Vec<[f32; 2]>>,
    pub(super) moved: wgpu::Buffer,
    displace: Pass,
    assemble: Pass,
    /// Passes that refit the tree's nodes, one per level.
    refit: Vec<Pass>,
}

impl Motion {
    /// Number of passes that move the scene.
    pub(super) const PASSES: usize = 3;

    /// Makes the buffers and passes; the scene is at rest.
    ///
    /// # Errors
    /// Sizes beyond the device's limits or memory, or a pass that the device refuses.
    pub(super) fn new(
        gpu: &Gpu,
        scene: &SceneBuffers,
        pipelines: &mut Pipelines,
        tables: &MotionTables,
    ) -> Result<Self, BackendError> {
        let filled = |label: &'static str, bytes: &[u8]| {
            let buffer = gpu.storage(label, bytes.len() as u64)?;
            gpu.queue.write_buffer(&buffer, 0, bytes);
            Ok::<_, BackendError>(buffer)
        };
        let vertices = filled("moving vertices", bytemuck::cast_slice(&tables.vertices))?;
        let corners = filled("corners of moving triangles", bytemuck::cast_slice(&tables.corners))?;
        let order = filled("nodes to refit", bytemuck::cast_slice(&tables.nodes))?;
        let extents = filled("boxes of nodes", bytemuck::cast_slice(&tables.extents))?;
        let moved = gpu.storage("displaced vertices", 16 * tables.vertices.len() as u64)?;
        let uniform_buffer = gpu.buffer("motion", size_of::<Uniforms>() as u64, UNIFORM)?;
        let all = [(0, tables.vertices.len() as u32), (tables.first_triangle, tables.corners.len() as u32)];
        let levels = tables.levels.iter().map(|level| (level.start, level.end - level.start));
        let steps: Vec<(u32, u32)> = all.into_iter().chain(levels).collect();
        let step_buffer = gpu.buffer("steps of motion", STEP_STRIDE * steps.len() as u64, UNIFORM)?;
        for (&(first, count), at) in steps.iter().zip(0u64..) {
            let step = Step { first, count, unused: [0; 2] };
            gpu.queue.write_buffer(&step_buffer, at * STEP_STRIDE, bytemuck::bytes_of(&step));
        }
        let mut pass = |shader, step: usize, bound: &[&wgpu::Buffer]| {
            let groups = [steps[step].1.div_ceil(MOTION_GROUP), 1, 1];
            let specialised = Specialised { shader, constants: &[], frames: 1, parts: Vec::new() };
            Pass::bound(gpu, pipelines, (&step_buffer, size_of::<Step>()), &specialised, groups, bound)
        };
        let (u, triangles) = (&uniform_buffer, &scene.triangles);
        let displace = pass(Shader::Displace, 0, &[u, &vertices, &moved])?;
        let assemble = [u, &vertices, &moved, &corners, triangles, &scene.displacements];
        let assemble = pass(Shader::Assemble, 1, &assemble)?;
        let refit = [u, &order, triangles, &extents, &scene.nodes];
        let refit = (2..steps.len()).map(|step| pass(Shader::Refit, step, &refit)).collect::<Result<_, _>>()?;
        Ok(Self {
            displace,
            assemble,
            refit,
            uniforms: uniforms(tables),
            uniform_buffer,
            wanted: None,
            present: None,
            moved,
        })
    }

    /// Sets the amounts of each displacement field for frames submitted from now on.
    pub(super) fn set_amounts(&mut self, amounts: Vec<[f32; 2]>) {
        self.wanted = Some(amounts);
    }

    /// Amounts of each displacement field in the last frame.
    pub(super) fn amounts(&self) -> Vec<[f32; 2]> {
        self.uniforms.fields.iter().map(|field| field.amounts).collect()
    }

    /// Moves the scene for the next frame. Uploads the amounts, and hands each pass to `run`: its name, and a function
    /// that records its dispatches. Does nothing if no amount has changed.
    pub(super) fn run(&mut self, gpu: &Gpu, mut run: impl FnMut(&'static str, &dyn Fn(&mut wgpu::ComputePass<'_>))) {
        if !self.upload(gpu) {
            return;
        }
        let offset = |step: u32| step * STEP_STRIDE as u32;
        run(Shader::Displace.pass(), &|compute| self.displace.record_at(compute, offset(0)));
        run(Shader::Assemble.pass(), &|compute| self.assemble.record_at(compute, offset(1)));
        run(Shader::Refit.pass(), &|compute| {
            self.refit.iter().zip(2..).for_each(|(level, step)| level.record_at(compute, offset(step)));
        });
    }

    /// Uploads the amounts for the next frame. Returns whether any has changed.
    fn upload(&mut self, gpu: &Gpu) -> bool {
        let Some(wanted) = &self.wanted else { return false };
        let changed = |i: usize| self.present.as_ref().is_none_or(|present| present[i] != wanted[i]);
        self.uniforms.changed = (0..wanted.len()).filter(|&i| changed(i)).fold(0, |all, i| all | 1 << i);
        if self.uniforms.changed == 0 {
            return false;
        }
        for (field, amounts) in self.uniforms.fields.iter_mut().zip(wanted) {
            field.amounts = *amounts;
        }
        gpu.queue.write_buffer(&self.uniform_buffer, 0, bytemuck::bytes_of(&self.uniforms));
        match &mut self.present {
            Some(present) => present.clone_from(wanted),
            None => self.present = Some(wanted.clone()),
        }
        true
    }
}

/// Uniforms of the displacement fields, with amounts 0.
fn uniforms(tables: &MotionTables) -> Uniforms {
    let mut uniforms = Uniforms::default();
    for (field, shape) in uniforms.fields.iter_mut().zip(&tables.shapes) {
        *field = field_of(shape, tables.centre_mm);
    }
    uniforms
}

fn field_of(shape: &Shape, centre_mm: DVec3) -> Field {
    let local = |position: Vec3| (position.as_dvec3() - centre_mm).as_vec3().to_array();
    match *shape {
        Shape::Beat { centre_mm, axis, radius_mm, squeeze, shorten } => Field {
            origin: local(centre_mm),
            kind: 0,
            axis: axis.normalize_or_zero().to_array(),
            radius_mm,
            form: [squeeze, shorten, 0.0],
            ..Field::default()
        },
        Shape::Breath { centre_mm, axis, half_length_mm, radius_mm, widen, shift_mm } => Field {
            origin: local(centre_mm),
            kind: 1,
            axis: axis.normalize_or_zero().to_array(),
            radius_mm,
            form: [half_length_mm, widen, shift_mm],
            ..Field::default()
        },
        Shape::Swing { joint_mm, end_mm, axis, radius_mm, angle_deg } => Field {
            origin: local(joint_mm),
            kind: 2,
            axis: axis.normalize_or(Vec3::X).to_array(),
            radius_mm,
            form: (end_mm - joint_mm).to_array(),
            turns: angle_deg / 360.0,
            ..Field::default()
        },
    }
}
