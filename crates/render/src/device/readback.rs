//! One slot of the read-back ring: staging buffer and timestamps of one frame in flight.

use std::sync::mpsc;

use super::attenuation::unpad_levels;
use super::buffers::Buffers;
use super::gpu::Gpu;
use super::motion::Motion;
use crate::error::BackendError;
use crate::frame::{Contents, Frame, unpad};
use crate::params::Params;

/// Staging memory of one frame in flight.
#[derive(Debug)]
pub(crate) struct Slot {
    /// Staging buffer [B-mode | segmentation | attenuation | percentile, overflows of paths, overflows of maps | lines
    /// | timestamps].
    staging: wgpu::Buffer,
    layout: Layout,
    queries: Option<Queries>,
    shape: Shape,
}

/// Sizes that determine a slot's memory.
#[derive(Debug, Clone, PartialEq, Eq)]
pub(crate) struct Shape {
    /// Size of the image, pixels.
    pub(crate) width: u32,
    pub(crate) height: u32,
    /// Words of four pixels per row.
    pub(crate) row_words: u32,
    /// Number of scanlines whose complex samples the frame carries; 0 if it carries none.
    pub(crate) lines: u32,
    /// Samples per scanline, without and with padding.
    pub(crate) samples: u32,
    pub(crate) row_samples: u32,
    /// Largest number of dispatches of a frame.
    pub(crate) dispatches: usize,
}

impl Shape {
    /// Sizes for a configuration whose frames have at most `dispatches` dispatches. `lines` says whether frames carry
    /// complex samples.
    pub(super) fn of(params: &Params, lines: bool, dispatches: usize) -> Self {
        Self {
            width: params.image.width,
            height: params.image.height,
            row_words: params.row_words,
            lines: if lines { params.scanlines } else { 0 },
            samples: params.samples,
            row_samples: params.row_samples,
            dispatches,
        }
    }
}

/// Parts and timed passes of a frame in flight.
#[derive(Debug, Clone)]
pub(super) struct Recorded {
    pub(super) contents: Contents,
    /// Names of the timed passes, in order. If several frames share dispatches, only the first has the names.
    pub(super) timed: Vec<&'static str>,
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
        4 * self.pixels
    }
    fn lines(&self) -> u64 {
        self.scalars() + 48
    }
    fn times(&self) -> u64 {
        self.lines() + self.lines
    }
    fn size(&self) -> u64 {
        self.times() + self.queries * 8
    }
}

impl Slot {
    pub(crate) fn new(gpu: &Gpu, shape: &Shape) -> Result<Self, BackendError> {
        let count = 2 * (Motion::PASSES + shape.dispatches) as u32;
        let queries = if gpu.timestamps && count <= wgpu::QUERY_SET_MAX_QUERIES {
            let usage = wgpu::BufferUsages::QUERY_RESOLVE | wgpu::BufferUsages::COPY_SRC;
            Some(Queries {
                set: gpu.device.create_query_set(&wgpu::QuerySetDescriptor {
                    label: Some("pass times"),
                    ty: wgpu::QueryType::Timestamp,
                    count,
                }),
                resolved: gpu.buffer("pass times", u64::from(count) * 8, usage)?,
                period_ns: f64::from(gpu.queue.get_timestamp_period()),
            })
        } else {
            None
        };
        let layout = Layout {
            pixels: u64::from(shape.row_words * 4) * u64::from(shape.height),
            lines: u64::from(shape.lines) * u64::from(shape.row_samples) * 8,
            queries: if queries.is_some() { count.into() } else { 0 },
        };
        let usage = wgpu::BufferUsages::MAP_READ | wgpu::BufferUsages::COPY_DST;
        let staging = gpu.buffer("read-back", layout.size(), usage)?;
        Ok(Self { staging, layout, queries, shape: shape.clone() })
    }

    /// Sizes that the slot was made for.
    pub(crate) fn shape(&self) -> &Shape {
        &self.shape
    }

    /// Timestamps around the `index`-th recorded pass; `None` on a device without timestamps.
    pub(crate) fn timestamps(&self, index: usize) -> Option<wgpu::ComputePassTimestampWrites<'_>> {
        self.queries.as_ref().map(|queries| wgpu::ComputePassTimestampWrites {
            query_set: &queries.set,
            beginning_of_pass_write_index: Some(2 * index as u32),
            end_of_pass_write_index: Some(2 * index as u32 + 1),
        })
    }

    /// Records the copies of one frame: the `frame`-th part of each working buffer.
    pub(crate) fn record(
        &self,
        encoder: &mut wgpu::CommandEncoder,
        buffers: &Buffers,
        frame: u32,
        recorded: &Recorded,
    ) {
        let (l, contents) = (&self.layout, recorded.contents);
        let mut copy = |buffer: &wgpu::Buffer, to: u64, size: u64| {
            let part = buffer.size() / u64::from(buffers.frames) * u64::from(frame);
            encoder.copy_buffer_to_buffer(buffer, part, &self.staging, to, Some(size));
        };
        if contents.image {
            copy(&buffers.bmode, 0, l.pixels);
        }
        if contents.maps {
            copy(&buffers.segmentation, l.segmentation(), l.pixels);
            copy(&buffers.attenuation, l.attenuation(), 2 * l.pixels);
            copy(&buffers.percentile, l.scalars(), 16);
        }
        copy(&buffers.overflows, l.scalars() + 16, 16);
        copy(&buffers.map_overflows, l.scalars() + 32, 16);
        if l.lines > 0 {
            copy(&buffers.lines, l.lines(), l.lines);
        }
        if let Some(queries) = self.queries.as_ref().filter(|_| !recorded.timed.is_empty()) {
            let count = 2 * recorded.timed.len() as u32;
            encoder.resolve_query_set(&queries.set, 0..count, &queries.resolved, 0);
            encoder.copy_buffer_to_buffer(&queries.resolved, 0, &self.staging, l.times(), Some(u64::from(count) * 8));
        }
    }

    /// Requests the mapping of the staging buffer. The result arrives in `done`; [`Slot::read`] must wait for it.
    pub(crate) fn map(&self, done: &mpsc::SyncSender<Result<(), wgpu::BufferAsyncError>>) {
        let done = done.clone();
        self.staging.slice(..).map_async(wgpu::MapMode::Read, move |result| {
            // The receiver lives as long as the renderer, and the channel holds a message per frame in flight.
            let _ = done.try_send(result);
        });
    }

    /// Copies the frame out of the mapped staging buffer, and unmaps it.
    pub(crate) fn read(&self, frame: &mut Frame, recorded: &Recorded) -> Result<(), BackendError> {
        let contents = recorded.contents;
        let lost = |e: wgpu::MapRangeError| BackendError::Lost { reason: e.to_string() };
        {
            let view = self.staging.slice(..).get_mapped_range().map_err(lost)?;
            let bytes: &[u8] = &view;
            let l = &self.layout;
            let at = |offset: u64, size: u64| &bytes[offset as usize..(offset + size) as usize];
            (frame.width, frame.height) = (self.shape.width, self.shape.height);
            let (width, stride) = (self.shape.width as usize, 4 * self.shape.row_words as usize);
            // A frame without image or maps must not keep an earlier frame's.
            frame.bmode.clear();
            if contents.image {
                unpad(&mut frame.bmode, at(0, l.pixels), width, stride);
            }
            let scalars: &[u32] = bytemuck::cast_slice(at(l.scalars(), 48));
            frame.segmentation.clear();
            frame.attenuation.clear();
            frame.attenuation_p98 = 0.0;
            if contents.maps {
                unpad(&mut frame.segmentation, at(l.segmentation(), l.pixels), width, stride);
                let roots: &[u16] = bytemuck::cast_slice(at(l.attenuation(), 2 * l.pixels));
                unpad_levels(&mut frame.attenuation, roots, width, stride);
                frame.attenuation_p98 = (-f32::from_bits(scalars[0])).exp();
            }
            frame.overflows = scalars[4].saturating_add(scalars[8]);
            frame.lines.clear();
            if l.lines > 0 {
                let lines: &[[f32; 2]] = bytemuck::cast_slice(at(l.lines(), l.lines));
                unpad(&mut frame.lines, lines, self.shape.samples as usize, self.shape.row_samples as usize);
            }
            frame.times.passes.clear();
            if let Some(queries) = &self.queries {
                let ticks: &[u64] = bytemuck::cast_slice(at(l.times(), l.queries * 8));
                for (name, pair) in recorded.timed.iter().zip(ticks.chunks_exact(2)) {
                    frame.times.add(name, pair[1].saturating_sub(pair[0]) as f64 * queries.period_ns * 1e-6);
                }
            }
        }
        self.staging.unmap();
        Ok(())
    }
}
