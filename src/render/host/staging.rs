//! Memory that the host writes paths into and the device copies from.

use std::sync::Arc;
use std::sync::atomic::{AtomicU8, Ordering};

use wgpu::WriteOnly;

use super::path::PathRecord;
use crate::render::device::buffers::Buffers;
use crate::render::device::gpu::{Gpu, GpuError};
use crate::render::renderer::FRAMES_IN_FLIGHT;
use crate::render::tables::{SEGMENTS, STARTS};

const SEGMENT_BYTES: usize = 48 * SEGMENTS as usize;
const START_BYTES: usize = 4 * STARTS as usize;
const ECHO_BYTES: usize = 8 * SEGMENTS as usize;
const INSIDE_BYTES: usize = 32;
const COUNT_BYTES: usize = 4;
/// The words of the buffer of overflows.
const OVERFLOW_BYTES: usize = 16;

/// Where the mapping of a staging buffer stands.
const AWAITED: u8 = 0;
const MAPPED: u8 = 1;
const FAILED: u8 = 2;

/// What a staging buffer is made for.
#[derive(Debug, Clone, Copy, PartialEq, Eq)]
pub(crate) struct StagingSize {
    /// Paths of a batch.
    pub(crate) paths: u32,
    /// Words of hints a path.
    pub(crate) hint_words: u32,
}

impl StagingSize {
    /// Bytes of each part: segments, starts, echoes, surfaces, hints, counts, overflows.
    fn parts(self) -> [usize; 7] {
        let paths = self.paths as usize;
        let of = |bytes: usize| paths * bytes;
        let hints = 4 * self.hint_words as usize;
        [
            of(SEGMENT_BYTES),
            of(START_BYTES),
            of(ECHO_BYTES),
            of(INSIDE_BYTES),
            of(hints),
            of(COUNT_BYTES),
            OVERFLOW_BYTES,
        ]
    }
}

/// One buffer that the host may write while the device is at work on another frame.
#[derive(Debug)]
pub(crate) struct Staging {
    buffer: wgpu::Buffer,
    size: StagingSize,
    state: Arc<AtomicU8>,
    /// The work that reads it, if there was any.
    submission: Option<wgpu::SubmissionIndex>,
}

impl Staging {
    pub(crate) fn new(gpu: &Gpu, size: StagingSize) -> Result<Self, GpuError> {
        let bytes: usize = size.parts().iter().sum();
        let usage = wgpu::BufferUsages::MAP_WRITE | wgpu::BufferUsages::COPY_SRC;
        let buffer = gpu.buffer("paths", bytes as u64, usage)?;
        let mut staging = Self { buffer, size, state: Arc::new(AtomicU8::new(AWAITED)), submission: None };
        staging.map();
        Ok(staging)
    }

    /// Asks for the memory; `submission` may still read it.
    pub(crate) fn give_back(&mut self, submission: wgpu::SubmissionIndex) {
        self.submission = Some(submission);
        self.map();
    }

    fn map(&mut self) {
        let state = self.state.clone();
        state.store(AWAITED, Ordering::Release);
        self.buffer.slice(..).map_async(wgpu::MapMode::Write, move |result| {
            state.store(if result.is_ok() { MAPPED } else { FAILED }, Ordering::Release);
        });
    }

    /// Lets `write` fill the memory, waiting for what still reads it, and hands it to the device; `write` returns what is
    /// added to `lost`, the overflows of the frame so far.
    ///
    /// # Errors
    /// A device that fails.
    pub(crate) fn fill(
        &mut self,
        gpu: &Gpu,
        lost: &mut u32,
        write: impl FnOnce(PathOutputs<'_>) -> u32,
    ) -> Result<(), GpuError> {
        let failed = |reason: String| GpuError::Lost { reason };
        while self.state.load(Ordering::Acquire) == AWAITED {
            let wait = match &self.submission {
                Some(index) => wgpu::PollType::Wait { submission_index: Some(index.clone()), timeout: None },
                None => wgpu::PollType::Poll,
            };
            gpu.device.poll(wait).map_err(|e| failed(e.to_string()))?;
        }
        if self.state.load(Ordering::Acquire) == FAILED {
            return Err(failed("the memory of paths could not be mapped".to_owned()));
        }
        {
            let mut view = self.buffer.slice(..).get_mapped_range_mut().map_err(|e| failed(e.to_string()))?;
            let mut rest = view.slice(..);
            let mut parts = self.size.parts().into_iter();
            let mut next = || rest.split_off(..parts.next().unwrap_or(0)).unwrap_or_default();
            let outputs = PathOutputs {
                paths: self.size.paths as usize,
                segments: next(),
                starts: next(),
                echoes: next(),
                inside: next(),
                hints: next(),
                counts: next(),
            };
            let mut overflows = next();
            *lost += write(outputs);
            overflows.copy_from_slice(bytemuck::cast_slice(&[*lost, 0, 0, 0]));
        }
        self.buffer.unmap();
        Ok(())
    }

    /// Records the copies to the buffers that the passes read.
    pub(crate) fn record(&self, encoder: &mut wgpu::CommandEncoder, buffers: &Buffers) {
        let into = [
            &buffers.segments,
            &buffers.starts,
            &buffers.echoes,
            &buffers.starts_inside,
            &buffers.hints,
            &buffers.segment_counts,
            &buffers.overflows,
        ];
        let mut from = 0;
        for (buffer, bytes) in into.into_iter().zip(self.size.parts()) {
            encoder.copy_buffer_to_buffer(&self.buffer, from, buffer, 0, Some(bytes as u64));
            from += bytes as u64;
        }
    }
}

/// Staging buffers that are filled in turns: one may be read by the device while the other is written.
#[derive(Debug)]
pub(crate) struct StagingRing {
    slots: [Staging; FRAMES_IN_FLIGHT],
    /// The one filled last.
    last: usize,
}

impl StagingRing {
    pub(crate) fn new(gpu: &Gpu, size: StagingSize) -> Result<Self, GpuError> {
        Ok(Self { slots: [Staging::new(gpu, size)?, Staging::new(gpu, size)?], last: 0 })
    }

    /// The one that was filled longest ago.
    pub(super) fn next(&mut self) -> &mut Staging {
        self.last = (self.last + 1) % self.slots.len();
        &mut self.slots[self.last]
    }

    /// Says what reads the one that was filled last.
    pub(crate) fn submitted(&mut self, submission: &wgpu::SubmissionIndex) {
        self.slots[self.last].give_back(submission.clone());
    }
}

/// Where a run of paths is written: the device's buffers, a part each.
#[derive(Debug)]
pub(crate) struct PathOutputs<'a> {
    paths: usize,
    segments: WriteOnly<'a, [u8]>,
    starts: WriteOnly<'a, [u8]>,
    echoes: WriteOnly<'a, [u8]>,
    inside: WriteOnly<'a, [u8]>,
    hints: WriteOnly<'a, [u8]>,
    counts: WriteOnly<'a, [u8]>,
}

// SAFETY: as `&mut [u8]`, a `WriteOnly<[u8]>` is the only way to the bytes it stands for, and bytes may go to another thread.
// wgpu says so of `WriteOnly<T>` where T has a size, and leaves slices out.
unsafe impl Send for PathOutputs<'_> {}

/// Writes at the front of the `i`-th of equal parts.
fn write<T: bytemuck::NoUninit>(into: &mut WriteOnly<'_, [u8]>, stride: usize, i: usize, values: &[T]) {
    let bytes: &[u8] = bytemuck::cast_slice(values);
    into.slice(i * stride..i * stride + bytes.len()).copy_from_slice(bytes);
}

impl<'a> PathOutputs<'a> {
    /// Memory of the host, of `paths` paths: segments, starts, echoes, surfaces, hints and counts.
    pub(super) fn over(paths: usize, parts: [&'a mut [u8]; 6]) -> Self {
        let [segments, starts, echoes, inside, hints, counts] = parts.map(WriteOnly::from_mut);
        Self { paths, segments, starts, echoes, inside, hints, counts }
    }

    /// Paths that it holds.
    pub(super) fn paths(&self) -> usize {
        self.paths
    }

    /// Its first `paths` paths, and the rest.
    pub(super) fn split_at(self, paths: usize) -> (Self, Self) {
        let of = self.paths.max(1);
        let halves = |part: WriteOnly<'a, [u8]>| {
            let middle = part.len() / of * paths;
            part.split_at(middle)
        };
        let (segments, starts, echoes) = (halves(self.segments), halves(self.starts), halves(self.echoes));
        let (inside, hints, counts) = (halves(self.inside), halves(self.hints), halves(self.counts));
        let low = Self {
            paths,
            segments: segments.0,
            starts: starts.0,
            echoes: echoes.0,
            inside: inside.0,
            hints: hints.0,
            counts: counts.0,
        };
        let high = Self {
            paths: self.paths - paths,
            segments: segments.1,
            starts: starts.1,
            echoes: echoes.1,
            inside: inside.1,
            hints: hints.1,
            counts: counts.1,
        };
        (low, high)
    }

    /// Writes the `i`-th path.
    pub(super) fn write(&mut self, i: usize, record: &PathRecord) {
        let count = record.count as usize;
        write(&mut self.segments, SEGMENT_BYTES, i, &record.segments[..count]);
        write(&mut self.starts, START_BYTES, i, &record.starts[..=count]);
        write(&mut self.echoes, ECHO_BYTES, i, &record.echoes[..count]);
        write(&mut self.inside, INSIDE_BYTES, i, &record.starts_inside);
        let stride = self.hints.len() / self.paths.max(1);
        write(&mut self.hints, stride, i, &record.hints[..stride / 4]);
        write(&mut self.counts, COUNT_BYTES, i, &[record.count]);
    }
}
