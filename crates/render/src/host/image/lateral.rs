//! The lateral point-spread function: each sample becomes the beam's weighted sum over neighbouring scanlines.

use insonify_core::simd::{at_least, at_most, floor, phasor, prefetch, widened};
use rayon::prelude::*;

use crate::constants::DEPTH_BLOCK;
use crate::host::aperture::profiles::{Blend, TAPS_MAX};
use crate::host::aperture::visibility::BlockGain;
use crate::host::constants::{ImageConstants, NEIGHBOUR_GAIN_MAX};
use crate::kernels::Kernels;
use crate::params::Params;

/// Numbers in a block of complex samples that share a kernel.
const BLOCK: usize = 2 * DEPTH_BLOCK as usize;
/// Number of partial sums of squares; fixed, so that every instruction set adds in the same order.
const SUMS: usize = 8;
/// Least number of consecutive scanlines per task: neighbours read the same rows.
const LINES_TOGETHER: usize = 8;
/// Number of weights of the next plane that are prefetched.
const PREFETCHED: usize = 64;
/// Zero weights, for planes without extra weights.
static WITHOUT: [f32; TAPS_MAX] = [0.0; TAPS_MAX];

/// Inputs that make the lateral beam of every scanline.
#[derive(Debug, Clone, Copy)]
pub(in crate::host) struct LateralBeam<'a> {
    pub(in crate::host) constants: ImageConstants,
    /// Kernels of each block of samples.
    pub(in crate::host) kernels: &'a Kernels,
    /// The aperture's gain, and the position among the depth planes, of each block [scanlines × blocks]; empty without
    /// the aperture.
    pub(in crate::host) gains: &'a [BlockGain],
    /// Scatterers' amplitude on reflected paths relative to that with the aperture's gain [scanlines × blocks].
    pub(in crate::host) reflected: &'a [f32],
    /// Extra weights [planes × scanlines × (2·lateral_half + 1)] from the pass `profiles`. Without the aperture,
    /// `weights` and `blends` are empty.
    pub(in crate::host) weights: &'a [f32],
    pub(in crate::host) blends: &'a [Blend],
}

/// Focuses `baseband` into `focused`, both complex [scanlines × row_samples]: each sample becomes a weighted sum over
/// neighbouring scanlines. The weights are the kernel of the block of samples, or the profile of the scanline's beam.
/// Kernels of a phased array are wider off its normal. Weights below `least_weight` count as 0.
///
/// Each scanline sees its neighbours' scatterers with the gain of its own aperture. The wavefront of a steered frame is
/// perpendicular to its scanlines. So a neighbour's samples are taken deeper or shallower, by `params.steer_shift_mm`
/// per scanline.
///
/// Beyond the array's ends, a beam with an aperture receives a mirror image of the tissue inside, a quarter of a cycle
/// later. So the powers of tissue and image add. Without the aperture, the weights inside are scaled to the sum of all.
///
/// Obstacles of the scan plane don't hide echoes of reflected paths. A scanline receives these echoes with the kernel's
/// weight, times the reflected ratio of the neighbour. The greater of this weight and the weight by the gain applies.
///
/// `amplitudes` [blocks × 2 × scanlines] receives two factors of each scanline's echoes. The first is the greater of the
/// aperture's gain and the reflected amplitude. The second is the reflected ratio: reflected power over the greater of
/// both powers.
pub(in crate::host) fn lateral(
    params: &Params,
    beam: LateralBeam<'_>,
    baseband: &[[f32; 2]],
    amplitudes: &mut [f32],
    focused: &mut [[f32; 2]],
) {
    let row_samples = params.row_samples as usize;
    let blocks = row_samples / DEPTH_BLOCK as usize;
    let rows = amplitudes.par_chunks_exact_mut(2 * params.scanlines as usize).enumerate();
    rows.with_min_len(LINES_TOGETHER).for_each(|(block, row)| {
        let (carried, ratios) = row.split_at_mut(params.scanlines as usize);
        let lines = beam.gains.chunks_exact(blocks).zip(beam.reflected.chunks_exact(blocks));
        for ((carried, ratio), (gains, over_gain)) in carried.iter_mut().zip(ratios).zip(lines) {
            let reflected = at_most(gains[block][0] * over_gain[block], 1.0);
            *carried = at_least(gains[block][0], reflected);
            *ratio = (reflected / *carried) * (reflected / *carried);
        }
    });
    let amplitudes = &*amplitudes;
    let rows = focused.par_chunks_exact_mut(row_samples).enumerate().with_min_len(LINES_TOGETHER);
    rows.for_each(|(line, row)| {
        focus_row(params, beam, line, amplitudes, baseband.as_flattened(), row.as_flattened_mut());
    });
}

/// Kernel of a scanline at a block.
struct Kernel<'a> {
    taps: &'a [f32],
    /// Number of taps with weights to either side of the middle.
    reach: usize,
    /// Amplitude of speckle with this kernel, relative to the depth's kernel.
    level: f32,
    /// Root of the sum of squares, relative to the depth's kernel.
    width: f32,
}

/// Weights of a scanline's neighbours for one block, from tap `first` to before tap `end`.
struct Weights {
    taps: [f32; TAPS_MAX],
    first: usize,
    end: usize,
}

impl<'a> LateralBeam<'a> {
    /// Kernel of a block; widened for phased arrays off their normal, with `wide` as memory.
    #[inline(always)]
    fn kernel<'b>(&self, params: &Params, line: usize, block: usize, wide: &'b mut [f32; TAPS_MAX]) -> Kernel<'b>
    where
        'a: 'b,
    {
        let half = params.lateral_half as usize;
        let taps = 2 * half + 1;
        let (plain, reach) = (&self.kernels.lateral[block * taps..][..taps], self.kernels.reach[block] as usize);
        let projection = params.projection(line);
        if projection >= 1.0 {
            return Kernel { taps: plain, reach, level: 1.0, width: 1.0 };
        }
        let reach = (((reach + 1) as f32 / projection).ceil() as usize).min(half);
        let wide = &mut wide[..taps];
        wide.fill(0.0);
        widen(plain, reach, projection, wide);
        let widened = &wide[half - reach..=half + reach];
        let width = (sum_of_squares(widened) / self.kernels.power[block]).sqrt();
        // Speckle of a wide kernel whose sum is 1 would be darker.
        Kernel { reach, level: width / widened.iter().sum::<f32>(), width, taps: wide }
    }

    /// Fills in the weights of a scanline with this kernel at `position`, a fractional index of the depth planes.
    #[inline(always)]
    fn weigh(&self, params: &Params, line: usize, kernel: &Kernel<'_>, position: f32, weights: &mut Weights) {
        let half = params.lateral_half as usize;
        let &Kernel { taps: kernel, reach, .. } = kernel;
        let taps = kernel.len();
        let (mut first, mut end) = (half - reach, half + reach + 1);
        let lines = params.scanlines as usize;
        let planes = self.blends.len() / lines;
        // Before the first plane, the first plane's profile applies.
        let position = at_most(at_least(position, 0.0), planes.saturating_sub(1) as f32);
        let low = (position as usize).min(planes.saturating_sub(2));
        let part = position - low as f32;
        let shares = [(low, 1.0 - part), (low + 1, part)];
        let (mut kept, mut rows) = (0.0, [&WITHOUT; 2].map(|row| (&row[..taps], 0.0)));
        for ((plane, share), row) in shares.into_iter().zip(&mut rows) {
            let at = plane.min(planes.saturating_sub(1)) * lines + line;
            let [of_kernel, from, to] = self.blends.get(at).copied().unwrap_or([1.0, 0.0, 0.0]);
            kept += share * of_kernel;
            if to > from {
                *row = (&self.weights[at * taps..][..taps], share);
                (first, end) = (first.min(from as usize), end.max(to as usize));
            }
        }
        if planes == 0 || kept >= 1.0 {
            (weights.first, weights.end) = (half - reach, half + reach + 1);
            for (weight, &kernel) in weights.taps[weights.first..weights.end].iter_mut().zip(&kernel[weights.first..]) {
                *weight = kernel;
            }
            return;
        }
        (weights.first, weights.end) = (first, end);
        // Prefetches this scanline's weights at the next plane.
        if let Some(soon) =
            self.weights.get(((low + 2) * lines + line) * taps..).and_then(|rest| rest.first_chunk::<PREFETCHED>())
        {
            prefetch(soon);
        }
        let [(one, one_share), (next, next_share)] = rows;
        let profiles = one[first..end].iter().zip(&next[first..end]);
        for ((weight, &kernel), (&one, &next)) in
            weights.taps[first..end].iter_mut().zip(&kernel[first..end]).zip(profiles)
        {
            *weight = kernel * kept + one_share * one + next_share * next;
        }
    }
}

/// Fills the `reach` taps to either side of the middle with the kernel, stretched by 1/`projection`: the aperture's
/// projected width makes a wider beam.
#[inline(always)]
fn widen(kernel: &[f32], reach: usize, projection: f32, taps: &mut [f32]) {
    let half = kernel.len() / 2;
    taps[half] = kernel[half];
    for offset in 1..=reach {
        let position = offset as f32 * projection;
        let low = (position as usize).min(half - 1);
        let part = position - low as f32;
        let weight = (1.0 - part) * kernel[half + low] + part * kernel[half + low + 1];
        (taps[half - offset], taps[half + offset]) = (weight, weight);
    }
}

widened! {
    /// Focuses one scanline.
    fn focus_row(
        params: &Params, beam: LateralBeam<'_>, line: usize, amplitudes: &[f32], baseband: &[f32], row: &mut [f32],
    ) = focus_row_body
}

#[inline(always)]
fn focus_row_body(
    params: &Params,
    beam: LateralBeam<'_>,
    line: usize,
    amplitudes: &[f32],
    baseband: &[f32],
    row: &mut [f32],
) {
    let LateralBeam { constants, kernels, gains, .. } = beam;
    let (half, lines) = (params.lateral_half as usize, params.scanlines as usize);
    let stride = row.len();
    // Taps within the array.
    let from = half.saturating_sub(line);
    let to = (2 * half + 1).min(lines + half - line);
    let blocks = row.as_chunks_mut::<BLOCK>().0;
    let block_count = blocks.len();
    let (mut weights, mut wide) = (Weights { taps: [0.0; TAPS_MAX], first: 0, end: 0 }, [0.0; TAPS_MAX]);
    let steered = params.steer_shift_mm != 0.0;
    // Samples and phase by which each neighbour's echoes come later.
    let (mut shifts, mut turns) = ([0; TAPS_MAX], [[1.0, 0.0]; TAPS_MAX]);
    if steered {
        for (tap, (shift, turn)) in shifts.iter_mut().zip(&mut turns).enumerate().take(2 * half + 1) {
            let later_mm = (tap as f32 - half as f32) * params.steer_shift_mm;
            *shift = floor(later_mm / params.sample_spacing_mm + 0.5);
            *turn = phasor(-params.phase_turns_per_mm * later_mm);
        }
    }
    for (block, out) in blocks.iter_mut().enumerate() {
        let [own, position] = gains.get(line * block_count + block).copied().unwrap_or([1.0, 0.0]);
        let kernel = beam.kernel(params, line, block, &mut wide);
        beam.weigh(params, line, &kernel, position, &mut weights);
        let (first, end) = match gains {
            [] => (weights.first.clamp(from, to), weights.end.clamp(from, to)),
            _ => (weights.first, weights.end),
        };
        let mut weighted = [0.0_f32; TAPS_MAX];
        for (weighted, &weight) in weighted[first..end].iter_mut().zip(&weights.taps[first..end]) {
            // Denormal weights are zeros on a GPU, and slow here.
            *weighted = if weight >= constants.least_weight() { weight } else { 0.0 };
        }
        let scale = match gains {
            [] => 1.0 / at_least(weighted[first..end].iter().sum::<f32>() * kernel.level, 1.0e-30),
            _ => (kernels.power[block] / at_least(sum_of_squares(&weighted[first..end]), 0.5 * kernels.power[block]))
                .sqrt(),
        };
        let within = first.clamp(from, to)..end.clamp(from, to);
        let beyond = (first..within.start.min(end)).chain(within.end.max(first)..end);
        let nearest = line + within.start - half;
        if !gains.is_empty() {
            let (carried, ratios) = amplitudes[2 * block * lines..][..2 * lines].split_at(lines);
            // Reflected echoes keep the power of the kernel.
            let of_kernel = 1.0 / (scale * kernel.width);
            let received = |weight: f32, kernel: f32, carried: f32, ratio: f32| {
                let by_gain = weight * at_most(own / carried, NEIGHBOUR_GAIN_MAX);
                let received = at_least(by_gain, kernel * of_kernel * ratio);
                if received >= constants.least_weight() { received } else { 0.0 }
            };
            let others = carried[nearest..].iter().zip(&ratios[nearest..]).zip(&kernel.taps[within.clone()]);
            for (weighted, ((&carried, &ratio), &kernel)) in weighted[within.clone()].iter_mut().zip(others) {
                *weighted = received(*weighted, kernel, carried, ratio);
            }
            for tap in beyond.clone() {
                let source = mirrored(line + tap, half, lines);
                weighted[tap] = received(weighted[tap], kernel.taps[tap], carried[source], ratios[source]);
            }
        }
        let sources = baseband[nearest * stride..].chunks_exact(stride).zip(&weighted[within.clone()]);
        let (mut sum, mut turned) = ([0.0_f32; BLOCK], [0.0_f32; BLOCK]);
        if steered {
            for ((source, &weighted), (&shift, [cos, sin])) in
                sources.zip(shifts[within.clone()].iter().zip(&turns[within]))
            {
                add_shifted(source, block, shift, [weighted * cos, weighted * sin], &mut sum, &mut turned);
            }
        } else {
            for (source, &weighted) in sources {
                let Some(source) = source.as_chunks::<BLOCK>().0.get(block) else { continue };
                for (sum, &value) in sum.iter_mut().zip(source) {
                    *sum += weighted * value;
                }
            }
        }
        for tap in beyond.clone() {
            let source = &baseband[mirrored(line + tap, half, lines) * stride..][..stride];
            let [cos, sin] = turns[tap];
            add_shifted(source, block, shifts[tap], [-weighted[tap] * sin, weighted[tap] * cos], &mut sum, &mut turned);
        }
        if steered || beyond.count() > 0 {
            // (re, im) + i·(re', im').
            for (sum, turned) in sum.as_chunks_mut::<2>().0.iter_mut().zip(turned.as_chunks::<2>().0) {
                *sum = [sum[0] - turned[1], sum[1] + turned[0]];
            }
        }
        for (out, &sum) in out.iter_mut().zip(&sum) {
            *out = sum * scale;
        }
    }
}

/// Index of the scanline whose mirror image is at `at` − `half`, beyond the array's ends. No kernel is wider than the
/// array.
#[inline(always)]
fn mirrored(at: usize, half: usize, lines: usize) -> usize {
    if at < half { half - at - 1 } else { 2 * lines - 1 - (at - half) }
}

/// Sum of squares in an order that every instruction set keeps.
#[inline(always)]
fn sum_of_squares(values: &[f32]) -> f32 {
    let mut sums = [0.0_f32; SUMS];
    let (chunks, rest) = values.as_chunks::<SUMS>();
    for chunk in chunks {
        for lane in 0..SUMS {
            sums[lane] += chunk[lane] * chunk[lane];
        }
    }
    let mut last = [0.0_f32; SUMS];
    for (last, &value) in last.iter_mut().zip(rest) {
        *last = value;
    }
    for lane in 0..SUMS {
        sums[lane] += last[lane] * last[lane];
    }
    sums.iter().sum()
}

/// Adds a neighbour's block, taken `samples` earlier in its row, times a complex weight. Samples outside of the row
/// count as 0.
#[inline(always)]
fn add_shifted(
    source: &[f32],
    block: usize,
    samples: i32,
    [re, im]: [f32; 2],
    sum: &mut [f32; BLOCK],
    turned: &mut [f32; BLOCK],
) {
    let start = (block * BLOCK) as isize - 2 * samples as isize;
    if let Some(chunk) =
        usize::try_from(start).ok().and_then(|at| source.get(at..)).and_then(|s| s.first_chunk::<BLOCK>())
    {
        for i in 0..BLOCK {
            sum[i] += re * chunk[i];
            turned[i] += im * chunk[i];
        }
        return;
    }
    for i in 0..BLOCK {
        let value = usize::try_from(start + i as isize).ok().and_then(|at| source.get(at)).copied().unwrap_or(0.0);
        sum[i] += re * value;
        turned[i] += im * value;
    }
}
