//! Buffers of the needle's table. If the effect `needle` is off, each has only a few bytes.

use super::gpu::{Gpu, UNIFORM};
use crate::error::BackendError;
use crate::needle::{NEEDLE_ECHOES_MAX, NeedleEcho, NeedleFrame, Outline, Shadow};
use crate::tables::Tables;

/// Index that marks unused entries of the list of shadows.
const NO_CELL: u32 = u32::MAX;

/// The table of a frame's needle on the device. Clones share the memory.
#[derive(Debug, Clone)]
pub(crate) struct NeedleBuffers {
    pub(super) starts: wgpu::Buffer,
    pub(super) echoes: wgpu::Buffer,
    pub(super) shadows: wgpu::Buffer,
    pub(super) outline: wgpu::Buffer,
}

impl NeedleBuffers {
    pub(super) fn new(gpu: &Gpu, tables: &Tables, scanlines: u32) -> Result<Self, BackendError> {
        let on = u64::from(tables.needle.is_some());
        let cells = tables.aperture.as_ref().map_or(0, |aperture| aperture.sampling.cells as u64);
        Ok(Self {
            starts: gpu.storage("needle starts", on * 4 * u64::from(scanlines + 1))?,
            echoes: gpu.storage("needle echoes", on * (NEEDLE_ECHOES_MAX * size_of::<NeedleEcho>()) as u64)?,
            // Two depth planes share the shadow of each cell.
            shadows: gpu.storage("needle shadows", on * 2 * size_of::<Shadow>() as u64 * cells)?,
            outline: gpu.buffer("needle outline", size_of::<Outline>() as u64, UNIFORM)?,
        })
    }

    /// Uploads the needle of a frame. `padded` is reused memory.
    pub(super) fn upload(&self, gpu: &Gpu, frame: &NeedleFrame, padded: &mut Vec<u8>) {
        let write = |buffer: &wgpu::Buffer, bytes: &[u8]| gpu.queue.write_buffer(buffer, 0, bytes);
        write(&self.starts, bytemuck::cast_slice(&frame.starts));
        write(&self.echoes, bytemuck::cast_slice(&frame.echoes));
        padded.clear();
        padded.extend_from_slice(bytemuck::cast_slice(&frame.shadows));
        padded.resize(self.shadows.size() as usize, 0);
        let used = size_of_val(&frame.shadows[..]);
        let unused = Shadow { cell: NO_CELL, passes: 1.0 };
        padded[used..].chunks_exact_mut(size_of::<Shadow>()).for_each(|entry| {
            entry.copy_from_slice(bytemuck::bytes_of(&unused));
        });
        write(&self.shadows, padded);
        write(&self.outline, bytemuck::bytes_of(&frame.outline));
    }
}
