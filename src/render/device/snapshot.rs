//! Outputs of every pass, read back from the device.

use super::configuration::DeviceConfiguration;
use super::gpu::Gpu;
use crate::render::error::BackendError;
use crate::render::snapshot::PassBuffers;

/// Copy of a buffer that can be read once the device has run.
struct Staged(wgpu::Buffer);

impl Staged {
    fn new(gpu: &Gpu, encoder: &mut wgpu::CommandEncoder, buffer: &wgpu::Buffer) -> Self {
        let copy = gpu.device.create_buffer(&wgpu::BufferDescriptor {
            label: Some("snapshot"),
            size: buffer.size(),
            usage: wgpu::BufferUsages::MAP_READ | wgpu::BufferUsages::COPY_DST,
            mapped_at_creation: false,
        });
        encoder.copy_buffer_to_buffer(buffer, 0, &copy, 0, Some(buffer.size()));
        Self(copy)
    }

    fn words(&self) -> Result<Vec<u32>, BackendError> {
        let lost = |e: wgpu::MapRangeError| BackendError::Lost { reason: e.to_string() };
        let view = self.0.slice(..).get_mapped_range().map_err(lost)?;
        let bytes: &[u8] = &view;
        Ok(bytes.chunks_exact(4).map(|b| u32::from_le_bytes([b[0], b[1], b[2], b[3]])).collect())
    }
}

/// Runs every pass of one batch after the commands of `encoder`, and reads back what each wrote.
///
/// # Errors
/// A device that fails.
pub(super) fn pass_buffers(
    gpu: &Gpu,
    mut encoder: wgpu::CommandEncoder,
    active: &DeviceConfiguration,
) -> Result<PassBuffers, BackendError> {
    let buffers = &active.buffers;
    // Echoes are added in place: the scatterers alone are kept on the way.
    let mut scattered = None;
    for pass in active.path_passes.iter().chain(&active.image_passes) {
        if scattered.is_none() && ["echo", "lateral"].contains(&pass.name) {
            scattered = Some(Staged::new(gpu, &mut encoder, &buffers.baseband));
        }
        let mut compute =
            encoder.begin_compute_pass(&wgpu::ComputePassDescriptor { label: Some(pass.name), timestamp_writes: None });
        pass.record(&mut compute, 0);
    }
    let staged = [
        &buffers.starts_inside,
        &buffers.starts,
        &buffers.segments,
        &buffers.echoes,
        &buffers.segment_counts,
        &buffers.hints,
        &buffers.baseband,
        &buffers.focused,
        &buffers.lines,
        &buffers.polar,
        &buffers.entries,
        &buffers.entry_counts,
        &buffers.raster,
        &buffers.percentile,
        &buffers.bmode,
        &buffers.segmentation,
        &buffers.attenuation,
        &buffers.overflows,
    ]
    .map(|buffer| Staged::new(gpu, &mut encoder, buffer));
    let submission = gpu.queue.submit([encoder.finish()]);
    for one in staged.iter().chain(&scattered) {
        // A failed map shows when the range is asked for.
        one.0.slice(..).map_async(wgpu::MapMode::Read, |_| {});
    }
    let wait = wgpu::PollType::Wait { submission_index: Some(submission), timeout: None };
    gpu.device.poll(wait).map_err(|e| BackendError::Lost { reason: e.to_string() })?;
    let scattered = scattered.map_or(Ok(Vec::new()), |staged| staged.words())?;
    let mut words = staged.iter().map(Staged::words);
    let mut next = || words.next().unwrap_or_else(|| Ok(Vec::new()));
    Ok(PassBuffers {
        scattered,
        starts_inside: next()?,
        starts: next()?,
        segments: next()?,
        echoes: next()?,
        segment_counts: next()?,
        hints: next()?,
        baseband: next()?,
        focused: next()?,
        lines: next()?,
        polar: next()?,
        entries: next()?,
        entry_counts: next()?,
        raster: next()?,
        percentile: next()?,
        bmode: next()?,
        segmentation: next()?,
        attenuation: next()?,
        overflows: next()?,
    })
}
