//! Output buffers of paths.

use super::path_record::PathRecord;
use crate::constants::{SEGMENTS, STARTS};
use crate::segment::Segment;

/// Outputs of consecutive paths, in the shaders' layouts.
#[derive(Debug)]
pub(in crate::host) struct PathOutputs<'a> {
    /// Segments of each path, nearest first [paths × SEGMENTS].
    pub(in crate::host) segments: &'a mut [Segment],
    /// Start of each segment, mm of range [paths × STARTS].
    pub(in crate::host) starts: &'a mut [f32],
    /// Echo at the start of each segment: amplitude, and range in mm [paths × SEGMENTS].
    pub(in crate::host) echoes: &'a mut [[f32; 2]],
    /// Bit set of the surfaces that each path starts inside `[paths]`.
    pub(in crate::host) starts_inside: &'a mut [[u32; 8]],
    /// One-way amplitude that the face passes, 0..=1 `[paths]`.
    pub(in crate::host) couplings: &'a mut [f32],
    /// Hints of [`PathRecord::hint`] [paths × hint words].
    pub(in crate::host) hints: &'a mut [u32],
    /// Number of segments of each path `[paths]`.
    pub(in crate::host) segment_counts: &'a mut [u32],
}

impl PathOutputs<'_> {
    /// Number of paths.
    pub(super) fn paths(&self) -> usize {
        self.segment_counts.len()
    }

    fn hint_words(&self) -> usize {
        self.hints.len() / self.paths().max(1)
    }

    /// Splits off the outputs of the first `paths` paths.
    pub(in crate::host) fn split_at(self, paths: usize) -> (Self, Self) {
        let hint_words = self.hint_words();
        let (segments, segments_rest) = self.segments.split_at_mut(paths * SEGMENTS as usize);
        let (starts, starts_rest) = self.starts.split_at_mut(paths * STARTS as usize);
        let (echoes, echoes_rest) = self.echoes.split_at_mut(paths * SEGMENTS as usize);
        let (starts_inside, starts_inside_rest) = self.starts_inside.split_at_mut(paths);
        let (couplings, couplings_rest) = self.couplings.split_at_mut(paths);
        let (hints, hints_rest) = self.hints.split_at_mut(paths * hint_words);
        let (segment_counts, segment_counts_rest) = self.segment_counts.split_at_mut(paths);
        let rest = Self {
            segments: segments_rest,
            starts: starts_rest,
            echoes: echoes_rest,
            starts_inside: starts_inside_rest,
            couplings: couplings_rest,
            hints: hints_rest,
            segment_counts: segment_counts_rest,
        };
        (Self { segments, starts, echoes, starts_inside, couplings, hints, segment_counts }, rest)
    }

    /// Writes the `i`-th path.
    pub(super) fn write(&mut self, i: usize, record: &PathRecord) {
        let count = record.count as usize;
        let hint_words = self.hint_words();
        self.segments[i * SEGMENTS as usize..][..count].copy_from_slice(&record.segments[..count]);
        self.starts[i * STARTS as usize..][..=count].copy_from_slice(&record.starts[..=count]);
        self.echoes[i * SEGMENTS as usize..][..count].copy_from_slice(&record.echoes[..count]);
        self.starts_inside[i] = record.starts_inside;
        self.couplings[i] = record.coupling;
        self.hints[i * hint_words..][..hint_words].copy_from_slice(&record.hints[..hint_words]);
        self.segment_counts[i] = record.count;
    }
}
