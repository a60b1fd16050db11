//! Buffers of the aperture's passes. If the effect `aperture` is off, each has only a few bytes.

use super::gpu::{Gpu, UNIFORM};
use crate::aperture::{ApertureShape, CellRays, MODE_NONE};
use crate::batch_plan::BatchPlan;
use crate::constants::DEPTH_BLOCK;
use crate::error::BackendError;
use crate::params::Params;
use crate::tables::Tables;

/// Tables and outputs of the passes from `transmission` to `visibility`. Clones share the memory.
#[derive(Debug, Clone)]
pub(crate) struct ApertureBuffers {
    pub(super) shape: wgpu::Buffer,
    pub(super) cell_rays: wgpu::Buffer,
    pub(super) line_cells: wgpu::Buffer,
    pub(super) modes: wgpu::Buffer,
    pub(super) face: wgpu::Buffer,
    pub(super) steps: wgpu::Buffer,
    pub(super) beam_parts: wgpu::Buffer,
    pub(super) reaches: wgpu::Buffer,
    pub(super) unobstructed: wgpu::Buffer,
    pub(super) mask: wgpu::Buffer,
    pub(super) row_np: wgpu::Buffer,
    /// Sums over rays in `transmission`, kept between batches of one layer.
    pub(super) partial_sums: wgpu::Buffer,
    pub(super) fields: wgpu::Buffer,
    pub(super) amplitudes: wgpu::Buffer,
    pub(super) beam_powers: wgpu::Buffer,
    pub(super) profiles: wgpu::Buffer,
    pub(super) blends: wgpu::Buffer,
    pub(super) line_gains: wgpu::Buffer,
    pub(super) block_gains: wgpu::Buffer,
    pub(super) reflected: wgpu::Buffer,
    /// The buffers above that passes write, in a fixed order.
    pub(super) written: Vec<wgpu::Buffer>,
}

impl ApertureBuffers {
    /// Makes buffers for dispatches of `frames` frames. Buffers of `previous` that have the right size are reused.
    pub(super) fn new(
        gpu: &Gpu,
        tables: &Tables,
        params: &Params,
        plan: &BatchPlan,
        previous: Option<&Self>,
        frames: u32,
    ) -> Result<Self, BackendError> {
        type Of = fn(&ApertureBuffers) -> &wgpu::Buffer;
        let taken = |of: Of, size: u64| previous.map(of).filter(|b| b.size() == size).cloned();
        let aperture = tables.aperture.as_ref();
        let (cells, planes, modes) =
            aperture.map_or((0, 0, 0), |a| (a.sampling.cells as u64, a.planes as u64, a.modes.len() as u64));
        let (beams, offsets) = aperture.map_or((0, 0), |a| (a.sampling.beams as u64, a.sampling.offsets() as u64));
        let lines = u64::from(params.scanlines);
        let blocks = lines * u64::from(params.row_samples / DEPTH_BLOCK);
        let work = |label: &'static str, size: u64, of: Of| match taken(of, size.max(16)) {
            Some(buffer) => Ok(buffer),
            None => gpu.storage(label, size),
        };
        let mut written = Vec::new();
        let mut part = |label: &'static str, size: u64, of: Of| {
            let buffer = work(label, size.max(16) * u64::from(frames), of)?;
            written.push(buffer.clone());
            Ok::<_, BackendError>(buffer)
        };
        let shape = size_of::<ApertureShape>() as u64;
        Ok(Self {
            shape: match taken(|b| &b.shape, shape) {
                Some(buffer) => buffer,
                None => gpu.buffer("aperture", shape, UNIFORM)?,
            },
            cell_rays: work("cell rays", 16 * cells, |b| &b.cell_rays)?,
            line_cells: work("line cells", if aperture.is_some() { 4 * lines } else { 0 }, |b| &b.line_cells)?,
            modes: work("modes", 4 * modes, |b| &b.modes)?,
            face: work("face", 4 * cells, |b| &b.face)?,
            steps: work("propagation steps", 8 * planes * cells, |b| &b.steps)?,
            beam_parts: work("beam parts", 8 * (planes + 1) * modes, |b| &b.beam_parts)?,
            reaches: work("beam reach", 8 * planes, |b| &b.reaches)?,
            unobstructed: work("unobstructed beams", 4 * planes * offsets, |b| &b.unobstructed)?,
            mask: part("transmission", 8 * planes * cells, |b| &b.mask)?,
            partial_sums: part("partial sums", if plan.splits_layers() { 8 * planes * cells } else { 0 }, |b| {
                &b.partial_sums
            })?,
            row_np: part("row losses", 4 * planes, |b| &b.row_np)?,
            fields: part("mode fields", 8 * modes * planes * cells, |b| &b.fields)?,
            amplitudes: part("beam amplitudes", 4 * planes * beams * cells, |b| &b.amplitudes)?,
            beam_powers: part("beam powers", 4 * planes * cells, |b| &b.beam_powers)?,
            profiles: part("profiles", 4 * planes * lines * u64::from(2 * params.lateral_half + 1), |b| &b.profiles)?,
            blends: part("profile blends", 12 * planes * lines, |b| &b.blends)?,
            line_gains: part("line gains", if aperture.is_some() { 16 * lines * (planes + 1) } else { 0 }, |b| {
                &b.line_gains
            })?,
            block_gains: part("block gains", if aperture.is_some() { 8 * blocks } else { 0 }, |b| &b.block_gains)?,
            reflected: part("reflected amplitudes", if aperture.is_some() { 4 * blocks } else { 0 }, |b| &b.reflected)?,
            written,
        })
    }

    /// Uploads the tables.
    pub(super) fn fill(&self, gpu: &Gpu, tables: &Tables, refraction: bool) {
        let Some(tables) = &tables.aperture else { return };
        let write = |buffer: &wgpu::Buffer, bytes: &[u8]| gpu.queue.write_buffer(buffer, 0, bytes);
        write(&self.shape, bytemuck::bytes_of(&ApertureShape::new(tables, refraction)));
        let packed = |rays: &CellRays| {
            let [first, last] = rays.parts.map(u32::from);
            [rays.first, rays.step, rays.count, first | last << 16]
        };
        let cell_rays: Vec<[u32; 4]> = tables.cell_rays.iter().map(packed).collect();
        write(&self.cell_rays, bytemuck::cast_slice(&cell_rays));
        write(&self.line_cells, bytemuck::cast_slice(&tables.line_cells));
        let modes: Vec<i32> = tables.modes.iter().map(|mode| mode.unwrap_or(MODE_NONE)).collect();
        write(&self.modes, bytemuck::cast_slice(&modes));
        write(&self.face, bytemuck::cast_slice(&tables.face));
        write(&self.steps, bytemuck::cast_slice(&tables.steps));
        write(&self.beam_parts, bytemuck::cast_slice(&[&tables.transmit[..], &tables.receive].concat()));
        let reaches = tables.reach_cells.iter().zip(&tables.greatest);
        let reaches: Vec<[f32; 2]> = reaches.map(|(&reach, &greatest)| [reach, greatest]).collect();
        write(&self.reaches, bytemuck::cast_slice(&reaches));
        write(&self.unobstructed, bytemuck::cast_slice(&tables.profiles));
    }
}
