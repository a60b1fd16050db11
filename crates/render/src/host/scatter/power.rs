//! Power of the scatterers along the paths of a scanline. Scaled powers have the factor e^(2·[`LN_SCALE`]).

use insonify_core::simd::{at_least, at_most, exp};

use super::media::{Media, Power, parts};
use crate::host::constants::{LN_SCALE, LN_SPECKLE_SILENT};
use crate::host::paths::{BLOCK, CHUNK, Lanes, Paths, Run, range_mm};
use crate::params::Params;
use crate::segment::Segment;

/// Scaled power at and below which scatterers have no echo: e⁻⁷⁰.
const SILENT_POWER: f32 = 3.975_449_7e-31;
/// Largest fall of ln power per block for which a block's powers are computed from the previous block's.
const LN_FALL_MAX: f32 = 7.0;
/// Range of ln of the scaled powers. Lanes before the start of their segment are stronger, by up to a block's fall.
const LN_POWERS: [f32; 2] = [2.0 * (LN_SPECKLE_SILENT + LN_SCALE), 2.0 * LN_SCALE + LN_FALL_MAX];

/// Consecutive blocks of samples on a path, and the path's weight.
#[derive(Debug, Clone, Copy)]
pub(super) struct Stretch {
    pub(super) first: u32,
    pub(super) blocks: usize,
    pub(super) weight: f32,
}

/// Powers of the scatterers at consecutive blocks of samples, summed over paths.
#[derive(Debug)]
pub(super) struct Powers {
    /// Power, before loss and gain, on paths that get the aperture's gain instead of their own loss.
    by_aperture: [Power; CHUNK],
    /// Counts of such paths whose power is not yet in `by_aperture`.
    media: Media,
    /// Scaled power on paths with their own loss.
    traced: [Power; CHUNK],
    /// Whether any path was added to `traced`.
    any_traced: bool,
}

impl Powers {
    pub(super) const fn new() -> Self {
        let zeros = [[[0.0; BLOCK]; 3]; CHUNK];
        Self { by_aperture: zeros, media: Media::new(), traced: zeros, any_traced: false }
    }

    /// Clears the first `blocks` blocks.
    #[inline(always)]
    pub(super) fn begin(&mut self, blocks: usize) {
        self.by_aperture[..blocks].fill([[0.0; BLOCK]; 3]);
        self.traced[..blocks].fill([[0.0; BLOCK]; 3]);
        self.any_traced = false;
    }

    /// Adds a path. With `aperture`, the aperture's gain will replace its loss up to its first reflection. After the
    /// reflection the path has its own loss, and the axial path's power is added, too.
    #[inline(always)]
    pub(super) fn add(
        &mut self,
        params: &Params,
        paths: &Paths<'_>,
        [path, axial_path]: [u32; 2],
        stretch: Stretch,
        aperture: bool,
    ) {
        let Stretch { first, blocks, .. } = stretch;
        let last = first.wrapping_add((blocks * BLOCK) as u32);
        let mut run = Run::new(params, paths, path, first);
        let mut sample = first;
        while sample < last {
            let (segment, stop) = run.segment(params, sample, last);
            let samples = [sample.wrapping_sub(first) as usize, stop.wrapping_sub(first) as usize];
            if aperture && !segment.has_reflected() {
                self.media.add(stretch.weight, segment, samples, &mut self.by_aperture);
            } else {
                self.any_traced = true;
                self.add_traced(params, stretch, segment, samples);
                if aperture {
                    self.add_axial_path(params, paths, axial_path, stretch, [sample, stop]);
                }
            }
            sample = stop;
        }
    }

    /// Adds the axial path's scatterers at samples that a path misses since it has reflected.
    #[inline(always)]
    fn add_axial_path(
        &mut self,
        params: &Params,
        paths: &Paths<'_>,
        axial_path: u32,
        stretch: Stretch,
        [from, to]: [u32; 2],
    ) {
        let mut run = Run::new(params, paths, axial_path, from);
        let mut sample = from;
        while sample < to {
            let (segment, stop) = run.segment(params, sample, to);
            let samples = [sample.wrapping_sub(stretch.first) as usize, stop.wrapping_sub(stretch.first) as usize];
            self.media.add(stretch.weight, segment, samples, &mut self.by_aperture);
            sample = stop;
        }
    }

    /// Completes the powers after the last path.
    #[inline(always)]
    pub(super) fn end(&mut self, weight: f32) {
        self.media.sum(weight, &mut self.by_aperture);
    }

    /// Adds the scaled power of a segment's scatterers, with the path's loss.
    #[inline(always)]
    fn add_traced(&mut self, params: &Params, stretch: Stretch, segment: &Segment, [begin, end]: [usize; 2]) {
        let (level, fall) = (segment.ln_amplitude_at_zero, segment.fall_np_mm);
        // Skips media without scatterers, and segments below any display.
        let Some(parts) = parts(stretch.weight, segment) else { return };
        if level - fall * range_mm(params, stretch.first.wrapping_add(begin as u32)) <= LN_SPECKLE_SILENT {
            return;
        }
        let mut now = [0.0; BLOCK];
        let fall_a_block = 2.0 * fall * params.sample_spacing_mm * BLOCK as f32;
        let on = exp(-at_most(fall_a_block, LN_FALL_MAX));
        for block in begin / BLOCK..end.div_ceil(BLOCK) {
            if block == begin / BLOCK || fall_a_block > LN_FALL_MAX {
                let first = stretch.first.wrapping_add((block * BLOCK) as u32);
                for (i, now) in now.iter_mut().enumerate() {
                    let ln_amplitude = level - fall * range_mm(params, first.wrapping_add(i as u32));
                    *now = scaled_power(ln_amplitude);
                }
            }
            let Some(sums) = self.traced.get_mut(block) else { break };
            let (from, to) = (begin.saturating_sub(block * BLOCK) as i32, end.wrapping_sub(block * BLOCK) as i32);
            for i in 0..BLOCK {
                let within = (i as i32 >= from) & ((i as i32) < to) & (now[i] > SILENT_POWER);
                let power = if within { now[i] } else { 0.0 };
                for (sums, part) in sums.iter_mut().zip(parts) {
                    sums[i] += part * power;
                }
                now[i] *= on;
            }
            // Amplitude falls with depth, so the first sample bounds the block.
            if now[0] <= SILENT_POWER {
                break;
            }
        }
    }

    /// Scaled power at the first sample of a block on paths with their own loss. With the aperture, these are the
    /// reflected paths.
    #[inline(always)]
    pub(super) fn reflected(&self, block: usize) -> f32 {
        let [mean, deviation, _] = &self.traced[block];
        if self.any_traced { mean[0] + deviation[0] } else { 0.0 }
    }

    /// Scaled power at the samples of a block. The aperture's gain, given as ln of the two-way amplitude, replaces the
    /// loss of paths that have not reflected. Without `ln_gain`, all paths have their own loss.
    #[inline(always)]
    pub(super) fn total(&self, block: usize, ln_gain: Option<&Lanes>) -> Power {
        let Some(ln_gain) = ln_gain else { return self.traced[block] };
        let mut total = self.by_aperture[block];
        for i in 0..BLOCK {
            let gain = scaled_power(ln_gain[i]);
            for sums in &mut total {
                sums[i] *= gain;
            }
        }
        if self.any_traced {
            for (sums, traced) in total.iter_mut().zip(&self.traced[block]) {
                for i in 0..BLOCK {
                    sums[i] += traced[i];
                }
            }
        }
        total
    }
}

/// Scaled power of a segment's scatterers, with the aperture's gain instead of the path's loss.
#[inline(always)]
pub(super) fn power_with_gain(segment: &Segment, ln_gain: f32) -> f32 {
    parts(1.0, segment).map_or(0.0, |[mean, deviation, _]| (mean + deviation) * scaled_power(ln_gain))
}

/// Scaled power of an amplitude, clamped to [`LN_POWERS`].
#[inline(always)]
fn scaled_power(ln_amplitude: f32) -> f32 {
    exp(at_most(at_least(2.0 * (ln_amplitude + LN_SCALE), LN_POWERS[0]), LN_POWERS[1]))
}
