//! Outputs of every pass, read back from the device.

use bytemuck::Pod;
use insonify_core::anatomy::bvh::Moved;

use super::attenuation::level;
use super::buffers::SceneBuffers;
use super::configuration::DeviceConfiguration;
use super::dispatches::Dispatch;
use super::gpu::Gpu;
use super::motion::Motion;
use super::shaders::Shader;
use crate::error::BackendError;
use crate::frame::{Contents, unpad};
use crate::params::Params;
use crate::snapshot::PassBuffers;

/// Reads a buffer back, after all earlier submissions.
pub(super) fn read<T: Pod>(gpu: &Gpu, buffer: &wgpu::Buffer) -> Result<Vec<T>, BackendError> {
    let copy = gpu.device.create_buffer(&wgpu::BufferDescriptor {
        label: Some("snapshot"),
        size: buffer.size(),
        usage: wgpu::BufferUsages::MAP_READ | wgpu::BufferUsages::COPY_DST,
        mapped_at_creation: false,
    });
    let mut encoder = gpu.device.create_command_encoder(&wgpu::CommandEncoderDescriptor::default());
    encoder.copy_buffer_to_buffer(buffer, 0, &copy, 0, Some(buffer.size()));
    let submission = gpu.queue.submit([encoder.finish()]);
    // If the mapping fails, `get_mapped_range` reports it.
    copy.slice(..).map_async(wgpu::MapMode::Read, |_| {});
    gpu.wait(submission, true)?;
    let view = copy.slice(..).get_mapped_range().map_err(|e| BackendError::Lost { reason: e.to_string() })?;
    Ok(bytemuck::pod_collect_to_vec(&view[..]))
}

/// Reads an image back, without the padding of its rows.
fn image<T: Pod>(gpu: &Gpu, buffer: &wgpu::Buffer, params: &Params) -> Result<Vec<T>, BackendError> {
    let mut rows = Vec::new();
    unpad(&mut rows, &read(gpu, buffer)?, params.image.width as usize, 4 * params.row_words as usize);
    Ok(rows)
}

/// Reads the moved parts of the device's scene back.
///
/// # Errors
/// A device that fails.
pub(super) fn moved(gpu: &Gpu, scene: &SceneBuffers, motion: &Motion) -> Result<Moved, BackendError> {
    Ok(Moved {
        amounts: motion.amounts(),
        vertices: read(gpu, &motion.moved)?,
        triangles: read(gpu, &scene.triangles)?,
        displacements: read(gpu, &scene.displacements)?,
        nodes: read(gpu, &scene.nodes)?,
    })
}

/// Runs every pass after the commands of `encoder`, and reads all outputs back.
///
/// # Errors
/// A device that fails.
pub(super) fn pass_buffers(
    gpu: &Gpu,
    encoder: wgpu::CommandEncoder,
    active: &DeviceConfiguration,
    params: &Params,
) -> Result<PassBuffers, BackendError> {
    let buffers = &active.buffers;
    let dispatches = active.frames.of(Contents { image: true, maps: true });
    let before = |shaders: &[Shader]| {
        let at = dispatches.iter().position(|dispatch| shaders.contains(&dispatch.pass.shader()));
        at.unwrap_or(dispatches.len())
    };
    let submit = |mut encoder: wgpu::CommandEncoder, dispatches: &[Dispatch]| {
        for Dispatch { pass, batch } in dispatches {
            let label = Some(pass.shader().pass());
            let descriptor = wgpu::ComputePassDescriptor { label, timestamp_writes: None };
            pass.record(&mut encoder.begin_compute_pass(&descriptor), *batch);
        }
        gpu.queue.submit([encoder.finish()]);
    };
    let encoder_after = || gpu.device.create_command_encoder(&wgpu::CommandEncoderDescriptor::default());
    // `needle_shadow`, `echo`, `needle_echo`, `multiples` and `receive` change their input in place, so it is read back
    // before they run.
    let shades = before(&[Shader::NeedleShadow, Shader::Propagate, Shader::March]);
    let scatters = before(&[Shader::Echo, Shader::EchoByLine, Shader::Lateral]);
    let focuses = before(&[Shader::NeedleEcho, Shader::Multiples, Shader::Receive, Shader::Detect]);
    let reflects = before(&[Shader::Multiples, Shader::Receive, Shader::Detect]);
    let receives = before(&[Shader::Receive, Shader::Detect]);
    let shades = shades.min(scatters);
    submit(encoder, &dispatches[..shades]);
    let mask = read(gpu, &buffers.aperture.mask)?;
    submit(encoder_after(), &dispatches[shades..scatters]);
    let scattered = read(gpu, &buffers.baseband)?;
    submit(encoder_after(), &dispatches[scatters..focuses]);
    let focused = read(gpu, &buffers.focused)?;
    submit(encoder_after(), &dispatches[focuses..reflects]);
    let with_needle = read(gpu, &buffers.focused)?;
    submit(encoder_after(), &dispatches[reflects..receives]);
    let with_multiples = read(gpu, &buffers.focused)?;
    submit(encoder_after(), &dispatches[receives..]);
    let first = |counts: Vec<u32>| counts.first().copied().unwrap_or_default();
    Ok(PassBuffers {
        scattered,
        starts_inside: read(gpu, &buffers.starts_inside)?,
        starts: read(gpu, &buffers.starts)?,
        segments: read(gpu, &buffers.segments)?,
        echoes: read(gpu, &buffers.echoes)?,
        segment_counts: read(gpu, &buffers.segment_counts)?,
        hints: read(gpu, &buffers.hints)?,
        baseband: read(gpu, &buffers.baseband)?,
        focused,
        with_needle,
        with_multiples,
        received: read(gpu, &buffers.focused)?,
        couplings: read(gpu, &buffers.couplings)?,
        lines: read(gpu, &buffers.lines)?,
        polar: read(gpu, &buffers.polar)?,
        entries: read(gpu, &buffers.entries)?,
        entry_counts: read(gpu, &buffers.entry_counts)?,
        raster: read(gpu, &buffers.raster)?,
        percentile_np: read(gpu, &buffers.percentile)?.first().copied().unwrap_or_default(),
        bmode: image(gpu, &buffers.bmode, params)?,
        segmentation: image(gpu, &buffers.segmentation, params)?,
        attenuation: image(gpu, &buffers.attenuation, params)?.into_iter().map(level).collect(),
        overflows: first(read(gpu, &buffers.overflows)?) + first(read(gpu, &buffers.map_overflows)?),
        mask,
        shaded_mask: read(gpu, &buffers.aperture.mask)?,
        row_np: read(gpu, &buffers.aperture.row_np)?,
        fields: read(gpu, &buffers.aperture.fields)?,
        first_plane: 0,
        amplitudes: read(gpu, &buffers.aperture.amplitudes)?,
        beam_powers: read(gpu, &buffers.aperture.beam_powers)?,
        profiles: read(gpu, &buffers.aperture.profiles)?,
        blends: read(gpu, &buffers.aperture.blends)?,
        line_gains: read(gpu, &buffers.aperture.line_gains)?,
        block_gains: read(gpu, &buffers.aperture.block_gains)?,
        reflected: read(gpu, &buffers.aperture.reflected)?,
        moved: None,
    })
}
