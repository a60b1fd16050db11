//! Adds the needle's echoes to the focused lines, with the loss of the scanline up to the needle.

use insonify_core::simd::{at_least, exp, phasor, widened};
use rayon::prelude::*;

use crate::fractional_delay::TAPS;
use crate::host::aperture::gain::{ApertureGain, ApertureGains};
use crate::host::constants::ImageConstants;
use crate::host::paths::Paths;
use crate::host::scatter::echo::add_at;
use crate::needle::{NeedleEcho, NeedleFrame};
use crate::params::Params;
use crate::segment::Segment;

/// Inputs of the pass.
#[derive(Debug, Clone, Copy)]
pub(in crate::host) struct Needle<'a> {
    pub(in crate::host) frame: &'a NeedleFrame,
    pub(in crate::host) paths: Paths<'a>,
    /// The aperture's gain along the scanlines; if `None`, echoes have the loss of the axial path.
    pub(in crate::host) aperture_gains: Option<&'a ApertureGains<'a>>,
    /// Weights of an echo between two samples; empty if an echo lies at the nearest sample.
    pub(in crate::host) delays: &'a [[f32; TAPS]],
}

/// Adds the echoes to `focused`, complex [scanlines × row_samples].
pub(in crate::host) fn needle_echo(
    params: &Params,
    constants: ImageConstants,
    needle: Needle<'_>,
    focused: &mut [[f32; 2]],
) {
    if needle.frame.echoes.is_empty() {
        return;
    }
    let rows = focused.par_chunks_exact_mut(params.row_samples as usize).zip(needle.frame.starts.par_windows(2));
    rows.with_min_len(8).enumerate().for_each(|(line, (row, ends))| {
        let echoes = &needle.frame.echoes[ends[0] as usize..ends[1] as usize];
        add_line(params, constants, &needle, line as u32, echoes, &mut row[..params.samples as usize]);
    });
}

widened! {
    /// Adds the echoes of one scanline.
    fn add_line(
        params: &Params, constants: ImageConstants, needle: &Needle<'_>, line: u32, echoes: &[NeedleEcho],
        row: &mut [[f32; 2]],
    ) = add_line_body
}

#[inline(always)]
fn add_line_body(
    params: &Params,
    constants: ImageConstants,
    needle: &Needle<'_>,
    line: u32,
    echoes: &[NeedleEcho],
    row: &mut [[f32; 2]],
) {
    let gain = needle.aperture_gains.map(|gains| gains.line(line));
    for echo in echoes {
        add(params, constants, needle, (line, gain), echo, row);
    }
}

/// Adds one echo to scanline `line`, whose aperture gain is `gain`.
#[inline(always)]
fn add(
    params: &Params,
    constants: ImageConstants,
    needle: &Needle<'_>,
    (line, gain): (u32, Option<ApertureGain<'_>>),
    echo: &NeedleEcho,
    row: &mut [[f32; 2]],
) {
    let (segment, reached_mm) = reached(&needle.paths, params.axial_path_of(line), echo.depth_mm);
    let ln_gain = match gain {
        Some(gain) => gain.at(reached_mm, segment.loss_np(reached_mm)),
        None => segment.ln_amplitude_at_zero - segment.fall_np_mm * reached_mm,
    };
    let trips = at_least(-echo.extra_mm, 1.0);
    let range_mm = trips * reached_mm + at_least(echo.extra_mm, 0.0);
    let amplitude = constants.needle_amplitude() * echo.amplitude * exp(at_least(trips * ln_gain, -80.0));
    let [re, im] = phasor(-params.phase_turns_per_mm * range_mm);
    let [turned_re, turned_im] = phasor(echo.turns);
    let value = [re * turned_re - im * turned_im, re * turned_im + im * turned_re];
    add_at(params, range_mm, value.map(|part| amplitude * part), needle.delays, row);
}

/// Segment of a path at a depth, and the range there, mm. Media of other speeds than 1540 m/s make it differ from the
/// depth.
#[inline(always)]
fn reached<'a>(paths: &Paths<'a>, path: u32, depth_mm: f32) -> (&'a Segment, f32) {
    let (starts, segments) = paths.of(path as usize);
    let (mut left_mm, mut at) = (depth_mm, 0);
    loop {
        let (segment, rate) = (&segments[at], rate_of(&segments[at]));
        let through_mm = (starts[at + 1] - starts[at]) * rate;
        if through_mm >= left_mm || at + 1 == segments.len() {
            return (segment, starts[at] + left_mm / rate);
        }
        left_mm -= through_mm;
        at += 1;
    }
}

/// Depth per mm of range on a segment; 1 on reflected segments.
#[inline(always)]
fn rate_of(segment: &Segment) -> f32 {
    let [x, y, z] = segment.step;
    let rate = (x * x + y * y + z * z).sqrt();
    if segment.has_reflected() || rate < 0.1 { 1.0 } else { rate }
}
