//! Number of a scanline's paths in each medium. Media are few and paths many, so counting is faster than adding powers.

use insonify_core::simd::real;

use crate::host::constants::DENSITY_ONE;
use crate::host::paths::{BLOCK, CHUNK, Lanes};
use crate::segment::Segment;

/// Power of the scatterers at the samples of a block: squared mean amplitude, squared deviation, and the sum of both
/// times the density.
pub(super) type Power = [Lanes; 3];

/// Number of media that are counted before their power is summed.
const MEDIA: usize = 16;
/// Pairs of samples in a block. Both samples of a pair share a segment.
const BLOCK_PAIRS: usize = BLOCK / 2;
/// Pairs of samples in a chunk.
const PAIRS: usize = CHUNK * BLOCK_PAIRS;

/// Scatterers of a medium.
#[derive(Debug, Clone, Copy)]
struct Medium {
    mean: f32,
    deviation: f32,
    /// Fraction of the lattice's cells that contain a scatterer, in 1/131072.
    density: u32,
}

impl Medium {
    #[inline(always)]
    const fn of(segment: &Segment) -> Self {
        Self {
            mean: segment.scatterer_mean,
            deviation: segment.scatterer_deviation,
            density: segment.scatterer_density(),
        }
    }

    #[inline(always)]
    const fn bits(&self) -> [u32; 3] {
        [self.mean.to_bits(), self.deviation.to_bits(), self.density]
    }

    /// [`parts`] of a segment in this medium.
    #[inline(always)]
    fn parts(&self, weight: f32) -> Option<[f32; 3]> {
        let [mean, deviation] = [weight * self.mean * self.mean, weight * self.deviation * self.deviation];
        let dense = (mean + deviation) * (real(self.density) * (1.0 / DENSITY_ONE));
        (self.density != 0).then_some([mean, deviation, dense])
    }
}

/// Counts of the paths of a chunk in each medium.
#[derive(Debug)]
pub(super) struct Media {
    media: [Medium; MEDIA],
    /// Number of paths that enter each medium at a pair of samples, less the number of paths that leave it.
    changes: [[i16; PAIRS + 1]; MEDIA],
    count: usize,
}

impl Media {
    pub(super) const fn new() -> Self {
        Self {
            media: [Medium { mean: 0.0, deviation: 0.0, density: 0 }; MEDIA],
            changes: [[0; PAIRS + 1]; MEDIA],
            count: 0,
        }
    }

    /// Counts a path in its medium over samples `begin..end`, both even. If all `MEDIA` slots are taken, first adds the
    /// power counted so far to `sums` and forgets it; each path weighs `weight`.
    #[inline(always)]
    pub(super) fn add(&mut self, weight: f32, segment: &Segment, [begin, end]: [usize; 2], sums: &mut [Power; CHUNK]) {
        let medium = Medium::of(segment);
        if medium.density == 0 {
            return;
        }
        let known = self.media.iter().take(self.count).position(|other| other.bits() == medium.bits());
        let index = known.unwrap_or_else(|| {
            if self.count == MEDIA {
                self.sum(weight, sums);
            }
            self.media[self.count] = medium;
            self.count += 1;
            self.count - 1
        });
        let changes = &mut self.changes[index];
        for (pair, change) in [(begin / 2, 1), (end / 2, -1)] {
            if let Some(paths) = changes.get_mut(pair) {
                *paths = paths.wrapping_add(change);
            }
        }
    }

    /// Adds the power of all counted paths to `sums`, and forgets them. Each path weighs `weight`.
    #[inline(always)]
    pub(super) fn sum(&mut self, weight: f32, sums: &mut [Power; CHUNK]) {
        for (medium, changes) in self.media.iter().zip(&mut self.changes).take(self.count) {
            let parts = medium.parts(weight).unwrap_or_default();
            let mut paths = 0_i16;
            for (changes, sums) in changes.as_chunks::<BLOCK_PAIRS>().0.iter().zip(&mut *sums) {
                if paths == 0 && *changes == [0; BLOCK_PAIRS] {
                    continue;
                }
                let mut within: Lanes = [0.0; BLOCK];
                for (pair, change) in within.as_chunks_mut::<2>().0.iter_mut().zip(changes) {
                    paths = paths.wrapping_add(*change);
                    *pair = [f32::from(paths); 2];
                }
                for (sums, part) in sums.iter_mut().zip(parts) {
                    for (sum, paths) in sums.iter_mut().zip(&within) {
                        *sum += paths * part;
                    }
                }
            }
            changes.fill(0);
        }
        self.count = 0;
    }
}

/// Power of a segment's scatterers times `weight`, in the order of [`Power`], with the density in 0..=1. `None` without
/// scatterers.
#[inline(always)]
pub(super) fn parts(weight: f32, segment: &Segment) -> Option<[f32; 3]> {
    Medium::of(segment).parts(weight)
}

#[cfg(test)]
mod tests {
    use super::*;

    /// Overlapping paths in more media than are counted at once.
    #[test]
    fn counted_paths_have_the_power_of_each_of_them() {
        let segment = |number: usize| {
            // Media without scatterers have no power.
            let scatterers = if number.is_multiple_of(5) { 0 } else { 1 << 10 | number as u32 };
            let (scatterer_mean, scatterer_deviation) = (0.1 * number as f32, 1.0 + number as f32);
            Segment { scatterer_mean, scatterer_deviation, scatterers, ..Segment::default() }
        };
        let mut media = Media::new();
        let mut sums = [[[0.0; BLOCK]; 3]; CHUNK];
        let mut expected = vec![[0.0_f64; 3]; CHUNK * BLOCK];
        for path in 0..200 {
            let segment = segment(path * 7 % 41);
            let begin = 2 * (path * 13 % 250);
            let end = (begin + 2 * (1 + path * 5 % 90)).min(CHUNK * BLOCK);
            media.add(0.25, &segment, [begin, end], &mut sums);
            let parts = parts(0.25, &segment).unwrap_or_default();
            for sample in &mut expected[begin..end] {
                for (sum, part) in sample.iter_mut().zip(parts) {
                    *sum += f64::from(part);
                }
            }
        }
        media.sum(0.25, &mut sums);
        for (sample, expected) in expected.iter().enumerate() {
            for (part, expected) in expected.iter().enumerate() {
                let got = f64::from(sums[sample / BLOCK][part][sample % BLOCK]);
                assert!((got - expected).abs() <= 1.0e-5 * expected, "sample {sample}: {got} for {expected}");
            }
        }
        assert!(media.changes.as_flattened().iter().all(|&change| change == 0), "changes are left");
    }
}
