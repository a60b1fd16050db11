//! Scatterers along the paths: complex baseband before the point-spread function.

use insonify_core::simd::widened;
use rayon::prelude::*;

use super::media::Power;
use super::power::{Powers, Stretch, power_with_gain};
use super::speckle::{Block, BlockOfPath, Speckle, Strength};
use super::texture::{POSITIONS, Waves};
use crate::constants::TEXTURE_SAMPLES;
use crate::host::aperture::gain::ApertureGains;
use crate::host::constants::{ImageConstants, REFLECTED_MAX, UNSCALED};
use crate::host::paths::{BLOCK, CHUNK, Lanes, Paths, range_mm, seek};
use crate::params::Params;
use crate::texture::PackedTexture;

/// Number of texture levels in a block: one for [`TEXTURE_SAMPLES`] samples.
const BLOCK_POSITIONS: usize = BLOCK / TEXTURE_SAMPLES as usize;
/// Number of blocks whose texture levels are found at once.
const TEXTURE_BLOCKS: usize = POSITIONS / BLOCK_POSITIONS;

/// Inputs of the pass, except the paths.
#[derive(Debug, Clone, Copy)]
pub(in crate::host) struct Scatterers<'a> {
    pub(in crate::host) constants: ImageConstants,
    /// Gain of each block of samples.
    pub(in crate::host) gain: &'a [f32],
    /// 1/Y for each block of samples, 1/mm, where Y is the largest elevational distance of a sheet that contributes.
    /// Empty if scatterers come from the lattice.
    pub(in crate::host) per_reach_mm: &'a [f32],
    /// Textures; texture number n is at index n − 1. Empty without the effect.
    pub(in crate::host) textures: &'a [PackedTexture],
    /// Plane waves of the textures' random fields.
    pub(in crate::host) waves: &'a Waves,
    /// The aperture's gain along the scanlines; if `None`, every path has its own loss.
    pub(in crate::host) aperture_gains: Option<&'a ApertureGains<'a>>,
}

/// Outputs of the pass.
#[derive(Debug)]
pub(in crate::host) struct Marched<'a> {
    /// Complex baseband [scanlines × row_samples]. The first batch clears it, the last batch adds the scatterers.
    pub(in crate::host) baseband: &'a mut [[f32; 2]],
    /// Ratio of the scatterers' amplitude on reflected paths to their amplitude with the aperture's gain, at the first
    /// sample of each block [scanlines × blocks]. Filled in with the aperture only.
    pub(in crate::host) reflected: &'a mut [f32],
    /// Powers summed over the batches so far [scanlines × row_samples]; empty if there is one batch.
    pub(in crate::host) kept: &'a mut [[f32; 3]],
}

/// Computes the scatterers' echoes.
pub(in crate::host) fn march(params: &Params, paths: Paths<'_>, scatterers: Scatterers<'_>, into: Marched<'_>) {
    let samples = params.row_samples as usize;
    let Marched { baseband, reflected, kept } = into;
    let rows = baseband.par_chunks_exact_mut(samples).zip(reflected.par_chunks_exact_mut(samples / BLOCK)).enumerate();
    if kept.is_empty() {
        rows.for_each(|(line, (row, reflected))| {
            march_row(params, &paths, &scatterers, line as u32, row, reflected, &mut []);
        });
    } else {
        rows.zip(kept.par_chunks_exact_mut(samples)).for_each(|((line, (row, reflected)), kept)| {
            march_row(params, &paths, &scatterers, line as u32, row, reflected, kept);
        });
    }
}

widened! {
    /// Computes the echoes of one scanline.
    fn march_row(
        params: &Params, paths: &Paths<'_>, scatterers: &Scatterers<'_>, line: u32, row: &mut [[f32; 2]],
        reflected: &mut [f32], kept: &mut [[f32; 3]],
    ) = march_row_body
}

#[inline(always)]
fn march_row_body(
    params: &Params,
    paths: &Paths<'_>,
    scatterers: &Scatterers<'_>,
    line: u32,
    row: &mut [[f32; 2]],
    reflected: &mut [f32],
    kept: &mut [[f32; 3]],
) {
    let begins = params.layer_first == 0;
    let ends = params.layer_first.wrapping_add(params.layer_count) == params.layers;
    // The axial path sets where the scatterers of all paths of a scanline lie. A single path is its own axial path.
    let axial_path = params.axial_path_of(line);
    let mut powers = Powers::new();
    let speckle = Speckle::new(params, scatterers.constants);
    let chunks = row.as_chunks_mut::<BLOCK>().0.chunks_mut(CHUNK);
    for (chunk, row) in chunks.enumerate() {
        let first = (chunk * CHUNK * BLOCK) as u32;
        powers.begin(row.len());
        // The mean power of all rays sets the scatterers' strength.
        let weight = params.path_weight();
        for layer in 0..params.layer_count {
            let path = layer.wrapping_mul(params.scanlines).wrapping_add(line).wrapping_mul(params.rays);
            for ray in 0..params.rays {
                let stretch = Stretch { first, blocks: row.len(), weight };
                powers.add(
                    params,
                    paths,
                    [path.wrapping_add(ray), axial_path],
                    stretch,
                    scatterers.aperture_gains.is_some(),
                );
            }
        }
        powers.end(weight);
        let mut textured = [1.0; POSITIONS];
        for (i, row) in row.iter_mut().enumerate() {
            let block = first.wrapping_add((i * BLOCK) as u32);
            // No closure: if not inlined, it is compiled without the vector instructions.
            let mut ln_gain = None;
            if let Some(gains) = scatterers.aperture_gains {
                ln_gain = Some(gains.block(params, paths, line, block));
            }
            let mut total = powers.total(i, ln_gain.as_ref());
            if let Some(kept) = kept.get_mut(block as usize..).and_then(|rest| rest.first_chunk_mut::<BLOCK>()) {
                add_kept(&mut total, kept, begins);
            }
            if let (Some(ln_gain), Some(reflected)) = (&ln_gain, reflected.get_mut(block as usize / BLOCK)) {
                // Power of the reflected paths; the last batch turns it into a ratio of amplitudes.
                *reflected = powers.reflected(i) + if begins { 0.0 } else { *reflected };
                if ends && *reflected > 0.0 {
                    let by_aperture = power_with_gain(seek(params, paths, axial_path, block).1, ln_gain[0]);
                    *reflected = reflected_over_aperture(*reflected, by_aperture);
                }
            }
            let mut sums = [[0.0; BLOCK]; 2];
            if ends {
                let part = i % TEXTURE_BLOCKS;
                if part == 0 && !scatterers.textures.is_empty() {
                    textured = texture_gains(params, paths, axial_path, scatterers, block);
                }
                let gains = &textured[part * BLOCK_POSITIONS..][..BLOCK_POSITIONS];
                echo(params, paths, axial_path, scatterers, &speckle, block, gains, &total, &mut sums);
            }
            for (j, out) in row.iter_mut().enumerate() {
                // `row` already holds the echoes of earlier batches.
                let before = if begins { [0.0; 2] } else { *out };
                *out = [before[0] + sums[0][j], before[1] + sums[1][j]];
            }
        }
    }
}

/// Ratio of two amplitudes, given their powers; at most `REFLECTED_MAX`.
#[inline(always)]
fn reflected_over_aperture(reflected: f32, by_aperture: f32) -> f32 {
    if by_aperture > reflected * (1.0 / (REFLECTED_MAX * REFLECTED_MAX)) {
        (reflected / by_aperture).sqrt()
    } else {
        REFLECTED_MAX
    }
}

/// Adds the powers of earlier batches, and keeps the sum.
#[inline(always)]
fn add_kept(total: &mut Power, kept: &mut [[f32; 3]; BLOCK], begins: bool) {
    for (i, kept) in kept.iter_mut().enumerate() {
        for (sums, kept) in total.iter_mut().zip(kept) {
            sums[i] += if begins { 0.0 } else { *kept };
            *kept = sums[i];
        }
    }
}

/// Adds the echoes of a block's scatterers to `sums`, from the power that all paths send there.
#[inline(always)]
#[allow(clippy::too_many_arguments, reason = "inputs of one block")]
fn echo(
    params: &Params,
    paths: &Paths<'_>,
    axial_path: u32,
    scatterers: &Scatterers<'_>,
    speckle: &Speckle,
    first: u32,
    textured: &[f32],
    power: &Power,
    sums: &mut [Lanes; 2],
) {
    // Media without scatterers and samples in full shadow return no echo.
    if power[2].iter().all(|&power| power == 0.0) {
        return;
    }
    let of_block = |table: &[f32]| table.get(first as usize / BLOCK).copied().unwrap_or(0.0);
    let mut ranges_mm = [0.0; BLOCK];
    for (i, range) in ranges_mm.iter_mut().enumerate() {
        *range = range_mm(params, first.wrapping_add(i as u32));
    }
    let mut gains = [UNSCALED * of_block(scatterers.gain); BLOCK];
    for (gains, textured) in gains.chunks_exact_mut(TEXTURE_SAMPLES as usize).zip(textured) {
        for gain in gains {
            *gain *= textured;
        }
    }
    let block =
        Block { ranges_mm, per_reach_mm: of_block(scatterers.per_reach_mm), strength: Strength::new(power, &gains) };
    speckle.echo(&block, &BlockOfPath { params, paths, path: axial_path, first }, sums);
}

/// Amplitude factors of the texture of the axial path's tissues over [`TEXTURE_BLOCKS`] blocks, one for
/// [`TEXTURE_SAMPLES`] samples.
#[inline(always)]
fn texture_gains(
    params: &Params,
    paths: &Paths<'_>,
    axial_path: u32,
    scatterers: &Scatterers<'_>,
    first: u32,
) -> [f32; POSITIONS] {
    const MIDDLE: f32 = 0.5 * (TEXTURE_SAMPLES - 1) as f32;
    let mut numbers = [0; POSITIONS];
    let mut here_mm = [[0.0; POSITIONS]; 3];
    for (i, number) in numbers.iter_mut().enumerate() {
        let sample = first.wrapping_add(TEXTURE_SAMPLES.wrapping_mul(i as u32));
        let segment = seek(params, paths, axial_path, sample).1;
        *number = segment.texture();
        let ([x, y, z], [dx, dy, dz]) = (segment.origin_mm, segment.step);
        let at_mm = range_mm(params, sample) + MIDDLE * params.sample_spacing_mm;
        for (axis, mm) in [x + dx * at_mm, y + dy * at_mm, z + dz * at_mm].into_iter().enumerate() {
            here_mm[axis][i] = mm;
        }
    }
    let mut gains = [1.0; POSITIONS];
    for (i, &number) in numbers.iter().enumerate() {
        // Each tissue is handled once: most runs of samples have one or two.
        if numbers[..i].contains(&number) {
            continue;
        }
        let Some(texture) = scatterers.textures.get(number.wrapping_sub(1)) else { continue };
        let of_tissue = scatterers.waves.gains(texture, &here_mm);
        for ((gain, of_tissue), other) in gains.iter_mut().zip(of_tissue).zip(numbers) {
            if other == number {
                *gain = of_tissue;
            }
        }
    }
    gains
}
