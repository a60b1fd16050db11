//! From scanlines to pixels: B-mode and, if wanted, segmentation and attenuation in one pass.

use std::ops::Range;

use insonify_core::simd::{at_least, at_most, exp, floor, nearest_bits, real, widened};
use rayon::prelude::*;

use crate::constants::{ACROSS_BITS, OUTSIDE, TILE_ROWS};
use crate::host::constants::{CONTRAST_MIN_NP_MM, ImageConstants, LN_SILENT};
use crate::params::Params;

/// Pixels per group. There are enough that values gathered one by one have left the store buffer before vector loads
/// read them.
const LANES: usize = 32;
/// Pixels tested together for a border between tissues.
const NEAR: usize = 8;
const WORDS: usize = LANES / 4;
const ACROSS_SCALE: f32 = 1.0 / ((1u32 << ACROSS_BITS) - 2) as f32;
const DEPTH_SCALE: f32 = 1.0 / ((1u32 << (32 - ACROSS_BITS)) - 2) as f32;
const COUNT_SHIFT: u32 = 28;

/// Two neighbouring words of the raster, read at once.
#[derive(Clone, Copy)]
#[repr(C, packed(4))]
struct Pair(u64);

/// Words of four pixels that overlap the sector, and their positions in the image; made once per configuration.
#[derive(Debug, Default)]
pub(crate) struct Layout {
    /// Packed positions of the words' pixels, tile by tile.
    positions: Vec<[u32; 4]>,
    /// Index of each word's first pixel, counted from its band's first. The bits from COUNT_SHIFT up hold the number of
    /// its pixels in the image.
    pixels: Vec<u32>,
    /// Range of words in each band of TILE_ROWS image rows.
    bands: Vec<Range<usize>>,
    width: usize,
}

impl Layout {
    /// Layout from the packed positions of all pixels [height × 4·row_words], and the indices of the sector's words of
    /// four pixels, tile by tile.
    pub(crate) fn new(width: u32, height: u32, pixels: &[u32], sector_words: &[u32]) -> Self {
        let row_words = width.div_ceil(4);
        let mut layout = Self { width: width as usize, ..Self::default() };
        let mut words = sector_words.iter().peekable();
        for band in 0..height.div_ceil(TILE_ROWS) {
            let first = layout.positions.len();
            while let Some(&word) = words.next_if(|&&word| word / row_words / TILE_ROWS == band) {
                let positions = pixels.as_chunks::<4>().0[word as usize];
                layout.positions.push(positions);
                let (row, column) = (word / row_words % TILE_ROWS, word % row_words * 4);
                layout.pixels.push((row * width + column) | ((width - column).min(4) << COUNT_SHIFT));
            }
            layout.bands.push(first..layout.positions.len());
        }
        layout
    }
}

/// Source data of the maps.
#[derive(Debug, Clone, Copy)]
pub(crate) struct Maps<'a> {
    /// Words of [`Section::raster`](super::section::Section::raster) [map_rays × map_depths].
    pub(crate) raster: &'a [u32],
    /// Σμ of the attenuation's 98th percentile, nepers.
    pub(crate) percentile_np: f32,
    /// One-way attenuation of each tissue, nepers/mm.
    pub(crate) rates_np_mm: &'a [f32; 256],
    pub(crate) constants: ImageConstants,
}

/// The image and maps, [height × width] each; maps are empty if not wanted.
#[derive(Debug)]
pub(crate) struct Image<'a> {
    /// Grey levels.
    pub(crate) bmode: &'a mut [u8],
    /// Tissue numbers: index of the tissue + 1.
    pub(crate) segmentation: &'a mut [u8],
    /// One-way attenuation e^(−Σμ) over its percentile, 0..=1.
    pub(crate) attenuation: &'a mut [f32],
}

/// Writes every pixel, 0 outside the sector, from the detector's output `polar`.
pub(crate) fn scan_convert(params: &Params, layout: &Layout, polar: &[u32], maps: Option<Maps<'_>>, image: Image<'_>) {
    let band = TILE_ROWS as usize * layout.width;
    let bmode = image.bmode.par_chunks_mut(band).zip(&layout.bands);
    match maps {
        None => bmode.for_each(|(bmode, words)| convert_band(params, layout, words, polar, bmode)),
        Some(maps) => {
            let both = image.segmentation.par_chunks_mut(band).zip(image.attenuation.par_chunks_mut(band));
            bmode.zip(both).for_each(|((bmode, words), (segmentation, attenuation))| {
                convert_band_with_maps(params, layout, words, polar, &maps, bmode, segmentation, attenuation);
            });
        }
    }
}

widened! {
    /// Converts a band of rows without maps.
    fn convert_band(
        params: &Params, layout: &Layout, words: &Range<usize>, polar: &[u32], bmode: &mut [u8],
    ) = convert_band_body
}

widened! {
    /// Converts a band of rows with maps.
    fn convert_band_with_maps(
        params: &Params, layout: &Layout, words: &Range<usize>, polar: &[u32], maps: &Maps<'_>, bmode: &mut [u8],
        segmentation: &mut [u8], attenuation: &mut [f32],
    ) = convert_band_with_maps_body
}

// Plain loops: a closure would be compiled separately, without AVX2.
#[inline(always)]
fn convert_band_body(params: &Params, layout: &Layout, words: &Range<usize>, polar: &[u32], bmode: &mut [u8]) {
    bmode.fill(0);
    let positions = layout.positions[words.clone()].chunks(WORDS);
    for (positions, pixels) in positions.zip(layout.pixels[words.clone()].chunks(WORDS)) {
        store(bmode, pixels, &greys(params, polar, &group(positions)));
    }
}

#[inline(always)]
#[allow(clippy::too_many_arguments, reason = "a band of each map")]
fn convert_band_with_maps_body(
    params: &Params,
    layout: &Layout,
    words: &Range<usize>,
    polar: &[u32],
    maps: &Maps<'_>,
    bmode: &mut [u8],
    segmentation: &mut [u8],
    attenuation: &mut [f32],
) {
    bmode.fill(0);
    segmentation.fill(0);
    attenuation.fill(0.0);
    let positions = layout.positions[words.clone()].chunks(WORDS);
    for (positions, pixels) in positions.zip(layout.pixels[words.clone()].chunks(WORDS)) {
        let positions = group(positions);
        store(bmode, pixels, &greys(params, polar, &positions));
        let (tissues, levels) = sections(params, maps, &positions);
        store(segmentation, pixels, &tissues);
        store(attenuation, pixels, &levels);
    }
}

/// The positions of up to WORDS words, filled up with positions outside the sector.
#[inline(always)]
fn group(words: &[[u32; 4]]) -> [u32; LANES] {
    let mut positions = [OUTSIDE; LANES];
    match words.first_chunk::<WORDS>() {
        Some(whole) => positions.copy_from_slice(whole.as_flattened()),
        None => positions[..4 * words.len()].copy_from_slice(words.as_flattened()),
    }
    positions
}

/// Writes words of four pixels to their positions; the last of a row may have fewer.
#[inline(always)]
fn store<T: Copy>(into: &mut [T], pixels: &[u32], values: &[T; LANES]) {
    for (&pixel, values) in pixels.iter().zip(values.as_chunks::<4>().0) {
        let count = (pixel >> COUNT_SHIFT) as usize;
        let from = (pixel & ((1 << COUNT_SHIFT) - 1)) as usize;
        match into.get_mut(from..).and_then(|rest| rest.first_chunk_mut::<4>()) {
            Some(word) if count == 4 => *word = *values,
            _ => {
                for (pixel, &value) in into.iter_mut().skip(from).zip(&values[..count]) {
                    *pixel = value;
                }
            }
        }
    }
}

#[inline(always)]
fn mix(a: f32, b: f32, part: f32) -> f32 {
    a + (b - a) * part
}

/// Grey levels, bilinear between two levels of two scanlines.
#[inline(always)]
fn greys(params: &Params, polar: &[u32], positions: &[u32; LANES]) -> [u8; LANES] {
    let row_levels = params.row_levels();
    let levels_per_sample = real(params.levels_per_sample);
    let stride = if params.scanlines > 1 { row_levels } else { 0 };
    let last_line = real(params.scanlines.wrapping_sub(1));
    let last_pair = params.scanlines.saturating_sub(2) as i32;
    let last_sample = real(params.samples.wrapping_sub(1));
    let last = (polar.len() as u32).saturating_sub(stride).saturating_sub(1);
    let (mut at, mut along, mut aside) = ([0u32; LANES], [0.0f32; LANES], [0.0f32; LANES]);
    for i in 0..LANES {
        let across = real(positions[i] & ((1 << ACROSS_BITS) - 1)) * ACROSS_SCALE;
        let depth = real(positions[i] >> ACROSS_BITS) * DEPTH_SCALE;
        let line = at_most(at_least(across * real(params.scanlines) - 0.5, 0.0), last_line);
        let sample = at_most(at_least(depth * real(params.samples) - 0.5, 0.0), last_sample);
        let level = sample * levels_per_sample;
        let line0 = floor(line).min(last_pair);
        let level0 = floor(level);
        at[i] = (line0 as u32).wrapping_mul(row_levels).wrapping_add(level0 as u32).min(last);
        along[i] = level - level0 as f32;
        aside[i] = line - line0 as f32;
    }
    let (mut one, mut next) = ([0u32; LANES], [0u32; LANES]);
    if (last as usize) + (stride as usize) < polar.len() {
        for i in 0..LANES {
            // SAFETY: at[i] ≤ last, and last + stride lies in `polar`. Volatile, since gathers take longer.
            unsafe {
                let polar = polar.as_ptr();
                one[i] = polar.add(at[i] as usize).read_volatile();
                next[i] = polar.add(at[i].wrapping_add(stride) as usize).read_volatile();
            }
        }
    }
    let mut grey = [0u8; LANES];
    for i in 0..LANES {
        let a = mix(real(one[i] & 0xffff), real(one[i] >> 16), along[i]);
        let b = mix(real(next[i] & 0xffff), real(next[i] >> 16), along[i]);
        let level = nearest_bits(mix(a, b, aside[i]) * (255.0 / 65535.0));
        grey[i] = if positions[i] == OUTSIDE { 0 } else { level as u8 };
    }
    grey
}

/// Tissue numbers and attenuation of pixels. Σμ is linear between map rays, and up to half a spacing beyond the outer
/// rays. The tissue is the nearer ray's.
#[inline(always)]
fn sections(params: &Params, maps: &Maps<'_>, positions: &[u32; LANES]) -> ([u8; LANES], [f32; LANES]) {
    let stride = if params.map_rays > 1 { params.map_depths } else { 0 };
    let last_ray = params.map_rays.max(2).wrapping_sub(2) as i32;
    let last_step = params.map_depths.wrapping_sub(2) as i32;
    let last = (maps.raster.len() as u32).saturating_sub(stride).saturating_sub(2);
    let steps_per_mm = 1.0 / params.map_step_mm;
    let (mut at, mut beyond_mm, mut part) = ([0u32; LANES], [0.0f32; LANES], [0.0f32; LANES]);
    for i in 0..LANES {
        let across = real(positions[i] & ((1 << ACROSS_BITS) - 1)) * ACROSS_SCALE;
        let depth_mm = real(positions[i] >> ACROSS_BITS) * DEPTH_SCALE * params.depth_mm;
        let ray = across * real(params.map_rays) - 0.5;
        let first = floor(at_least(ray, 0.0)).min(last_ray);
        let step = floor(depth_mm * steps_per_mm).min(last_step);
        part[i] = at_most(at_least(ray - first as f32, -0.5), 1.5);
        beyond_mm[i] = depth_mm - step as f32 * params.map_step_mm;
        at[i] = (first as u32).wrapping_mul(params.map_depths).wrapping_add(step as u32).min(last);
    }
    // Raster words of each pixel's two map rays at the two depths around it.
    let mut pairs = [[0u64; LANES]; 2];
    if (last as usize) + (stride as usize) + 1 < maps.raster.len() {
        for i in 0..LANES {
            // SAFETY: at[i] ≤ last, and last + stride + 1 lies in `raster`. Volatile, since gathers take longer.
            unsafe {
                let raster = maps.raster.as_ptr();
                pairs[0][i] = raster.add(at[i] as usize).cast::<Pair>().read_volatile().0;
                pairs[1][i] = raster.add(at[i].wrapping_add(stride) as usize).cast::<Pair>().read_volatile().0;
            }
        }
    }
    let mut words = [[0u32; LANES]; 4];
    for i in 0..LANES {
        [words[0][i], words[1][i]] = halves(pairs[0][i]);
        [words[2][i], words[3][i]] = halves(pairs[1][i]);
    }
    let mut tissues = [0u32; LANES];
    let mut sums = [0.0f32; LANES];
    let mut differ = [0u32; LANES];
    for i in 0..LANES {
        let along = at_most(at_least(beyond_mm[i] * steps_per_mm, 0.0), 1.0);
        let one = mix(sum_np(words[0][i]), sum_np(words[1][i]), along);
        let next = mix(sum_np(words[2][i]), sum_np(words[3][i]), along);
        sums[i] = mix(one, next, part[i]);
        tissues[i] = if part[i] >= 0.5 { words[2][i] } else { words[0][i] } & 255;
        differ[i] = ((words[0][i] ^ words[1][i]) | (words[2][i] ^ words[3][i])) & 255;
    }
    for (near, differ) in differ.as_chunks::<NEAR>().0.iter().enumerate() {
        if differ.iter().fold(0, |any, d| any | d) == 0 {
            continue;
        }
        for (i, &differ) in (near * NEAR..).zip(differ) {
            let [a, b, c, d] = [words[0][i], words[1][i], words[2][i], words[3][i]];
            if differ != 0 {
                let one = section_at(params, maps, a, b, beyond_mm[i]);
                let next = section_at(params, maps, c, d, beyond_mm[i]);
                sums[i] = mix(one.0, next.0, part[i]);
                tissues[i] = if part[i] >= 0.5 { next.1 } else { one.1 };
            }
        }
    }
    let (mut numbers, mut levels) = ([0u8; LANES], [0.0f32; LANES]);
    for i in 0..LANES {
        let inside = positions[i] != OUTSIDE;
        let ln_level = maps.percentile_np - at_least(sums[i], 0.0);
        let level = at_most(exp(at_least(at_most(ln_level, 0.0), LN_SILENT)), 1.0);
        levels[i] = if inside && ln_level > LN_SILENT { level } else { 0.0 };
        numbers[i] = if inside { tissues[i].wrapping_add(maps.constants.first_number()) as u8 } else { 0 };
    }
    (numbers, levels)
}

/// The two words in the order that they have in memory.
#[inline(always)]
fn halves(pair: u64) -> [u32; 2] {
    let (low, high) = (pair as u32, (pair >> 32) as u32);
    if cfg!(target_endian = "big") { [high, low] } else { [low, high] }
}

/// Σμ of a raster word.
#[inline(always)]
fn sum_np(word: u32) -> f32 {
    f32::from_bits((word & 0xffff_fe00) >> 1)
}

/// Σμ and tissue between two depths of a map ray. If the depths lie in different tissues, their Σμ gives the position
/// of the boundary.
fn section_at(params: &Params, maps: &Maps<'_>, before: u32, after: u32, beyond_mm: f32) -> (f32, u32) {
    let step_mm = params.map_step_mm;
    let (sum0, sum1) = (sum_np(before), sum_np(after));
    if (before ^ after) & 255 == 0 {
        return (sum0 + (sum1 - sum0) * (beyond_mm / step_mm).clamp(0.0, 1.0), before & 255);
    }
    let rate = |word: u32| maps.rates_np_mm[(word & 255) as usize];
    let contrast = rate(before) - rate(after);
    // If both tissues attenuate alike, the boundary is unknown. The midpoint is at most half a pixel off.
    let mut boundary_mm = 0.5 * step_mm;
    if contrast.abs() > CONTRAST_MIN_NP_MM {
        boundary_mm = ((sum1 - sum0 - rate(after) * step_mm) / contrast).max(0.0).min(step_mm);
    }
    let sum = sum0 + rate(before) * beyond_mm.min(boundary_mm) + rate(after) * (beyond_mm - boundary_mm).max(0.0);
    (sum, if beyond_mm > boundary_mm { after } else { before } & 255)
}
