//! One slot of the read-back ring: staging buffers and timestamps of a frame in flight.

use std::sync::mpsc;

use super::gpu::{Gpu, GpuError};
use super::resources::Buffers;
use super::{Frame, PassTime};

/// Staging memory of one frame in flight.
#[derive(Debug)]
pub(crate) struct Slot {
    /// [B-mode | segmentation | attenuation | percentile, overflows | lines | timestamps], one buffer.
    staging: wgpu::Buffer,
    layout: Layout,
    queries: Option<Queries>,
    /// Samples of a row, and with its padding.
    rows: (u32, u32),
    names: Vec<&'static str>,
}

#[derive(Debug)]
struct Queries {
    set: wgpu::QuerySet,
    resolved: wgpu::Buffer,
    period_ns: f64,
}

#[derive(Debug, Clone, Copy)]
struct Layout {
    pixels: u64,
    lines: u64,
    queries: u64,
}

impl Layout {
    fn segmentation(&self) -> u64 {
        self.pixels
    }
    fn attenuation(&self) -> u64 {
        2 * self.pixels
    }
    fn scalars(&self) -> u64 {
        6 * self.pixels
    }
    fn lines(&self) -> u64 {
        self.scalars() + 32
    }
    fn times(&self) -> u64 {
        self.lines() + self.lines
    }
    fn size(&self) -> u64 {
        self.times() + self.queries * 8
    }
}

impl Slot {
    pub(crate) fn new(gpu: &Gpu, pixels: u64, line_bytes: u64, rows: (u32, u32), names: Vec<&'static str>) -> Self {
        let queries = gpu.timestamps.then(|| {
            let count = 2 * names.len() as u32;
            Queries {
                set: gpu.device.create_query_set(&wgpu::QuerySetDescriptor {
                    label: Some("pass times"),
                    ty: wgpu::QueryType::Timestamp,
                    count,
                }),
                resolved: gpu.device.create_buffer(&wgpu::BufferDescriptor {
                    label: Some("pass times"),
                    size: u64::from(count) * 8,
                    usage: wgpu::BufferUsages::QUERY_RESOLVE | wgpu::BufferUsages::COPY_SRC,
                    mapped_at_creation: false,
                }),
                period_ns: f64::from(gpu.queue.get_timestamp_period()),
            }
        });
        let layout =
            Layout { pixels, lines: line_bytes, queries: if queries.is_some() { 2 * names.len() as u64 } else { 0 } };
        let staging = gpu.device.create_buffer(&wgpu::BufferDescriptor {
            label: Some("read-back"),
            size: layout.size(),
            usage: wgpu::BufferUsages::MAP_READ | wgpu::BufferUsages::COPY_DST,
            mapped_at_creation: false,
        });
        Self { staging, layout, queries, rows, names }
    }

    /// Timestamps around the pass that is recorded as the `index`-th.
    pub(crate) fn timestamps(&self, index: usize) -> Option<wgpu::ComputePassTimestampWrites<'_>> {
        self.queries.as_ref().map(|queries| wgpu::ComputePassTimestampWrites {
            query_set: &queries.set,
            beginning_of_pass_write_index: Some(2 * index as u32),
            end_of_pass_write_index: Some(2 * index as u32 + 1),
        })
    }

    /// Records the copies from the working buffers.
    pub(crate) fn record(&self, encoder: &mut wgpu::CommandEncoder, buffers: &Buffers) {
        let l = &self.layout;
        encoder.copy_buffer_to_buffer(&buffers.bmode, 0, &self.staging, 0, Some(l.pixels));
        encoder.copy_buffer_to_buffer(&buffers.segmentation, 0, &self.staging, l.segmentation(), Some(l.pixels));
        encoder.copy_buffer_to_buffer(&buffers.attenuation, 0, &self.staging, l.attenuation(), Some(4 * l.pixels));
        encoder.copy_buffer_to_buffer(&buffers.percentile, 0, &self.staging, l.scalars(), Some(16));
        encoder.copy_buffer_to_buffer(&buffers.overflows, 0, &self.staging, l.scalars() + 16, Some(16));
        if l.lines > 0 {
            encoder.copy_buffer_to_buffer(&buffers.lines, 0, &self.staging, l.lines(), Some(l.lines));
        }
        if let Some(queries) = &self.queries {
            encoder.resolve_query_set(&queries.set, 0..2 * self.names.len() as u32, &queries.resolved, 0);
            encoder.copy_buffer_to_buffer(&queries.resolved, 0, &self.staging, l.times(), Some(l.queries * 8));
        }
    }

    /// Asks for the staging memory; `wait` must come before it is read.
    pub(crate) fn map(&self, done: &mpsc::SyncSender<Result<(), wgpu::BufferAsyncError>>) {
        let done = done.clone();
        self.staging.slice(..).map_async(wgpu::MapMode::Read, move |result| {
            // The receiver lives as long as the renderer; a full channel can't be: one message a frame in flight.
            let _ = done.try_send(result);
        });
    }

    /// Copies the mapped frame out and gives the memory back.
    pub(crate) fn read(&self, frame: &mut Frame) -> Result<(), GpuError> {
        let lost = |e: wgpu::MapRangeError| GpuError::Lost { reason: e.to_string() };
        {
            let view = self.staging.slice(..).get_mapped_range().map_err(lost)?;
            let bytes: &[u8] = &view;
            let l = &self.layout;
            let at = |offset: u64, size: u64| &bytes[offset as usize..(offset + size) as usize];
            let (width, height) = (frame.width as usize, frame.height as usize);
            let stride = l.pixels as usize / height;
            unpad(&mut frame.bmode, at(0, l.pixels), width, stride);
            unpad(&mut frame.segmentation, at(l.segmentation(), l.pixels), width, stride);
            let levels: &[f32] = bytemuck::cast_slice(at(l.attenuation(), 4 * l.pixels));
            unpad(&mut frame.attenuation, levels, width, stride);
            let scalars: &[u32] = bytemuck::cast_slice(at(l.scalars(), 32));
            frame.attenuation_p98 = (-f32::from_bits(scalars[0])).exp();
            frame.overflows = scalars[4];
            frame.lines.clear();
            if l.lines > 0 {
                let lines: &[[f32; 2]] = bytemuck::cast_slice(at(l.lines(), l.lines));
                unpad(&mut frame.lines, lines, self.rows.0 as usize, self.rows.1 as usize);
            }
            frame.times.passes.clear();
            if let Some(queries) = &self.queries {
                let ticks: &[u64] = bytemuck::cast_slice(at(l.times(), l.queries * 8));
                for (name, pair) in self.names.iter().zip(ticks.chunks_exact(2)) {
                    let ms = pair[1].saturating_sub(pair[0]) as f64 * queries.period_ns * 1e-6;
                    match frame.times.passes.iter_mut().find(|p| p.name == *name) {
                        Some(pass) => pass.ms += ms,
                        None => frame.times.passes.push(PassTime { name, ms }),
                    }
                }
            }
        }
        self.staging.unmap();
        Ok(())
    }
}

/// Copies rows of `width` out of rows of `stride`.
fn unpad<T: Copy>(into: &mut Vec<T>, from: &[T], width: usize, stride: usize) {
    into.clear();
    for row in from.chunks_exact(stride) {
        into.extend_from_slice(&row[..width]);
    }
}
