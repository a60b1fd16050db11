//! Recorded data of one path, in the device's layout.

use crate::constants::{HINT_BLOCK, SAMPLES_MAX, SEGMENTS, STARTS};
use crate::params::Params;
use crate::segment::Segment;

/// Words of hints for the largest number of samples.
const HINT_WORDS: usize = (SAMPLES_MAX / (4 * HINT_BLOCK) + 1) as usize;

/// Recorded data of a path, in the device's layout.
#[derive(Debug)]
pub(super) struct PathRecord {
    /// Surfaces that the path starts inside.
    pub(super) starts_inside: [u32; 8],
    /// One-way amplitude that the face passes into the body, 0..=1.
    pub(super) coupling: f32,
    pub(super) starts: [f32; STARTS as usize],
    pub(super) segments: [Segment; SEGMENTS as usize],
    pub(super) echoes: [[f32; 2]; SEGMENTS as usize],
    pub(super) count: u32,
    pub(super) hints: [u32; HINT_WORDS],
}

/// Copy of a path's last segment: [`PathRecord::reopen`] takes the record back to it.
#[derive(Debug, Clone, Copy)]
pub(super) struct LastSegment {
    count: u32,
    segment: Segment,
    start: f32,
    echo: [f32; 2],
}

impl PathRecord {
    pub(super) fn new() -> Self {
        Self {
            starts_inside: [0; 8],
            coupling: 1.0,
            starts: [0.0; STARTS as usize],
            segments: [Segment::default(); SEGMENTS as usize],
            echoes: [[0.0; 2]; SEGMENTS as usize],
            count: 0,
            hints: [0; HINT_WORDS],
        }
    }

    /// The last segment so far.
    pub(super) fn last(&self) -> LastSegment {
        let at = self.count.saturating_sub(1) as usize;
        LastSegment { count: self.count, segment: self.segments[at], start: self.starts[at], echo: self.echoes[at] }
    }

    /// Removes all segments after `last`.
    pub(super) fn reopen(&mut self, last: &LastSegment) {
        let at = last.count.saturating_sub(1) as usize;
        self.count = last.count;
        // In a full record, further segments may have replaced the last one.
        (self.segments[at], self.starts[at], self.echoes[at]) = (last.segment, last.start, last.echo);
    }

    /// Records the index of the segment that holds the first sample of each hint block, four blocks per word.
    pub(super) fn hint(&mut self, params: &Params) {
        let spacing_mm = params.sample_spacing_mm;
        let (mut block, mut holds) = (0_u32, 0_usize);
        for word in &mut self.hints[..params.hint_words as usize] {
            // No `map` of an array: it is a call.
            *word = 0;
            for byte in 0..4 {
                let at_mm = (block.wrapping_mul(HINT_BLOCK) as f32 + 0.5) * spacing_mm;
                while self.starts[holds + 1] <= at_mm {
                    holds += 1;
                }
                *word |= (holds as u32 & 0xff) << (8 * byte);
                block += 1;
            }
        }
    }
}
