//! Traced paths as the passes after `trace` read them.

use std::hint::black_box;

use insonify_core::simd::real;

use crate::constants::{DEPTH_BLOCK, HINT_BLOCK, SEGMENTS, STARTS};
use crate::params::Params;
use crate::segment::Segment;

/// Samples per block, which share a gain.
pub(super) const BLOCK: usize = DEPTH_BLOCK as usize;
/// Blocks that are handled in one pass over the paths: their sums stay in the first-level cache.
pub(super) const CHUNK: usize = 32;
/// One number per sample of a block.
pub(super) type Lanes = [f32; BLOCK];

/// Traced paths of a batch: the outputs of `trace`.
#[derive(Debug, Clone, Copy)]
pub(super) struct Paths<'a> {
    /// Start of each segment, mm of range [paths × STARTS].
    pub(super) starts: &'a [f32],
    /// Segments of each path, nearest first [paths × SEGMENTS].
    pub(super) segments: &'a [Segment],
    /// Index of the segment that holds the first sample of each hint block, four per word [paths × hint_words].
    pub(super) hints: &'a [u32],
}

impl<'a> Paths<'a> {
    /// Starts and segments of a path.
    pub(super) fn of(&self, path: usize) -> (&'a [f32], &'a [Segment]) {
        let (starts, segments) = (STARTS as usize, SEGMENTS as usize);
        (&self.starts[path * starts..][..starts], &self.segments[path * segments..][..segments])
    }

    /// Ends (mm of range) and segments of a path, and the index of a segment that contains `sample` or precedes it.
    #[inline(always)]
    fn hinted(&self, params: &Params, path: u32, sample: u32) -> (&'a [f32], &'a [Segment], usize) {
        let path = path as usize;
        let hints: &[u8] = bytemuck::cast_slice(self.hints);
        let hint = path * 4 * params.hint_words as usize + (sample / HINT_BLOCK) as usize;
        let ends = self.starts.get(path * STARTS as usize + 1..(path + 1) * STARTS as usize).unwrap_or(&[]);
        let segments = self.segments.get(path * SEGMENTS as usize..(path + 1) * SEGMENTS as usize).unwrap_or(&[]);
        (ends, segments, hints.get(hint).copied().unwrap_or(0) as usize)
    }
}

/// The segments of a path, visited from a sample on.
#[derive(Debug)]
pub(super) struct Run<'a> {
    ends: &'a [f32],
    segments: &'a [Segment],
    at: usize,
    samples_per_mm: f32,
}

impl<'a> Run<'a> {
    /// Visits the segments of `path` from the segment that contains `sample`.
    #[inline(always)]
    pub(super) fn new(params: &Params, paths: &Paths<'a>, path: u32, sample: u32) -> Self {
        let (ends, segments, at) = paths.hinted(params, path, sample);
        Self { ends, segments, at, samples_per_mm: 1.0 / params.sample_spacing_mm }
    }

    /// Returns the segment that holds `sample`, and the first sample beyond that segment, at most `last`. Samples must
    /// not decrease from call to call. Each pair of samples shares the segment of its first sample.
    #[inline(always)]
    pub(super) fn segment(&mut self, params: &Params, sample: u32, last: u32) -> (&'a Segment, u32) {
        let range = range_mm(params, sample);
        while self.ends.get(self.at).is_some_and(|&end_mm| end_mm <= range) {
            self.at = self.at.wrapping_add(1);
        }
        let end_mm = self.ends.get(self.at).copied().unwrap_or(f32::MAX);
        let about = (end_mm * self.samples_per_mm - 0.5).clamp(real(sample), real(last));
        // An even estimate, corrected below.
        let mut stop = ((about as u32).wrapping_add(1) & !1).clamp(sample.wrapping_add(2), last);
        while stop > sample.wrapping_add(2) && range_mm(params, stop.wrapping_sub(2)) >= end_mm {
            // A turn or two: unrolled to vectors, the loop takes longer.
            stop = black_box(stop.wrapping_sub(2));
        }
        while stop < last && range_mm(params, stop) < end_mm {
            stop = black_box(stop.wrapping_add(2));
        }
        (self.segments.get(self.at).unwrap_or(NONE), stop)
    }
}

/// A segment without scatterers, used for missing segments.
const NONE: &Segment = &Segment {
    origin_mm: [0.0; 3],
    ln_amplitude_at_zero: 0.0,
    step: [0.0; 3],
    fall_np_mm: 0.0,
    scatterer_mean: 0.0,
    scatterer_deviation: 0.0,
    scatterers: 0,
    ln_passed_at_zero: 0.0,
};

/// End of the path segment that holds `sample`, mm of range, and the segment.
#[inline(always)]
pub(super) fn seek<'a>(params: &Params, paths: &Paths<'a>, path: u32, sample: u32) -> (f32, &'a Segment) {
    let (ends, segments, mut at) = paths.hinted(params, path, sample);
    let range_mm = range_mm(params, sample);
    while ends.get(at).is_some_and(|&end_mm| end_mm <= range_mm) {
        at += 1;
    }
    (ends.get(at).copied().unwrap_or(f32::MAX), segments.get(at).unwrap_or(NONE))
}

#[inline(always)]
pub(super) fn range_mm(params: &Params, sample: u32) -> f32 {
    (real(sample) + 0.5) * params.sample_spacing_mm
}
