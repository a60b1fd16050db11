//! Adds the interfaces' echoes to the baseband, each scanline's in a fixed order.

use insonify_core::simd::{at_least, at_most, exp, floor, phasor, widened};
use rayon::prelude::*;

use crate::constants::{DELAY_STEPS, SEGMENTS};
use crate::fractional_delay::TAPS;
use crate::host::aperture::gain::{ApertureGain, ApertureGains, InterfaceGains};
use crate::host::constants::ImageConstants;
use crate::host::paths::Paths;
use crate::params::Params;

/// Interfaces whose echoes are computed at once.
const LANES: usize = 16;
/// Room for the echoes of a path, in whole groups of [`LANES`].
const ECHOES: usize = (SEGMENTS as usize).next_multiple_of(LANES);
/// Index beyond every sample.
const SAMPLES_BEYOND: f32 = 1.0e6;
/// One number per echo of a path.
type Numbers = [f32; ECHOES];

/// Place of an echo between samples.
#[derive(Debug, Clone, Copy)]
struct Place {
    /// First of the samples that share the echo; 2³² − 1 or − 2 for the samples before the row.
    first: u32,
    /// Step of the table of weights, and the part of the way to the next one.
    step: u32,
    part: f32,
}

impl Place {
    /// Place of an echo at a fractional index of samples.
    #[inline(always)]
    fn at(sample: f32) -> Self {
        // Samples are centred half a spacing after their number. Ranges beyond every sample are not added.
        let index = at_most(sample, SAMPLES_BEYOND) - 0.5;
        let before = floor(index);
        let step = (index - before as f32) * DELAY_STEPS as f32;
        let low = floor(step);
        Self { first: (before as u32).wrapping_sub(1), step: low as u32, part: step - low as f32 }
    }
}

/// Inputs of the pass.
#[derive(Debug, Clone, Copy)]
pub(in crate::host) struct Interfaces<'a> {
    pub(in crate::host) paths: Paths<'a>,
    /// Amplitude and range in mm [paths × SEGMENTS]. A path's first segment begins at the face and has no echo.
    pub(in crate::host) echoes: &'a [[f32; 2]],
    /// Number of segments of each path.
    pub(in crate::host) segment_counts: &'a [u32],
    /// The aperture's gain along the scanlines; if `None`, echoes have the loss of their paths.
    pub(in crate::host) aperture_gains: Option<&'a ApertureGains<'a>>,
    /// Weights of an echo between two samples; empty if an echo lies at the nearest sample.
    pub(in crate::host) delays: &'a [[f32; TAPS]],
}

/// Echoes of a path in the baseband.
#[derive(Debug)]
struct Echoes {
    count: usize,
    amplitude: Numbers,
    /// ln of the aperture's gain; 0 for echoes with the loss of their path.
    ln_gain: Numbers,
    /// Ranges of the echo and of its interface, mm. They differ within the interface's thickness.
    range_mm: Numbers,
    interface_mm: Numbers,
    /// Complex value, and fractional index of the sample.
    value: [Numbers; 2],
    sample: Numbers,
    /// Place between samples: see [`Place`].
    first: [u32; ECHOES],
    step: [u32; ECHOES],
    part: Numbers,
}

impl Echoes {
    #[inline(always)]
    fn new() -> Self {
        let zeros = [0.0; ECHOES];
        Self {
            count: 0,
            amplitude: zeros,
            ln_gain: zeros,
            range_mm: zeros,
            interface_mm: zeros,
            value: [zeros; 2],
            sample: zeros,
            first: [0; ECHOES],
            step: [0; ECHOES],
            part: zeros,
        }
    }

    /// Computes the values of all echoes.
    #[inline(always)]
    fn compute(&mut self, params: &Params) {
        for first in (0..self.count).step_by(LANES) {
            for i in first..first + LANES {
                let amplitude = self.amplitude[i] * exp(at_least(self.ln_gain[i], -80.0));
                let [re, im] = phasor(-params.phase_turns_per_mm * self.range_mm[i]);
                (self.value[0][i], self.value[1][i]) = (amplitude * re, amplitude * im);
                self.sample[i] = self.range_mm[i] / params.sample_spacing_mm;
            }
            if params.levels_per_sample == 2 {
                self.place(first);
            }
        }
    }

    /// Computes the places between samples of [`LANES`] echoes from `first` on.
    #[inline(always)]
    fn place(&mut self, first: usize) {
        for i in first..first + LANES {
            let place = Place::at(self.sample[i]);
            (self.first[i], self.step[i], self.part[i]) = (place.first, place.step, place.part);
        }
    }

    /// Adds the echoes of interfaces beyond the range `from_mm`, times `weight`, to the samples of a scanline.
    #[inline(always)]
    fn add(&self, weight: f32, from_mm: f32, delays: &[[f32; TAPS]], row: &mut [[f32; 2]]) {
        let delays = delays.first_chunk();
        for i in 0..self.count {
            let in_row = self.sample[i] >= 0.0 && self.sample[i] < row.len() as f32;
            let counts = in_row && self.interface_mm[i] > from_mm;
            if !counts {
                continue;
            }
            let value = [weight * self.value[0][i], weight * self.value[1][i]];
            if let Some(delays) = delays {
                let place = Place { first: self.first[i], step: self.step[i], part: self.part[i] };
                add_between(place, value, delays, row);
            } else if let Some(at) = row.get_mut(self.sample[i] as usize) {
                *at = [at[0] + value[0], at[1] + value[1]];
            }
        }
    }
}

/// Adds an echo at a range to a scanline: to the samples around its place, or to the nearest sample if `delays` is empty.
#[inline(always)]
pub(in crate::host) fn add_at(
    params: &Params,
    range_mm: f32,
    value: [f32; 2],
    delays: &[[f32; TAPS]],
    row: &mut [[f32; 2]],
) {
    let sample = range_mm / params.sample_spacing_mm;
    if !(0.0..row.len() as f32).contains(&sample) {
        return;
    }
    if let Some(delays) = delays.first_chunk() {
        add_between(Place::at(sample), value, delays, row);
    } else if let Some(at) = row.get_mut(sample as usize) {
        *at = [at[0] + value[0], at[1] + value[1]];
    }
}

/// Adds an echo to the four samples around its place.
#[inline(always)]
fn add_between(
    place: Place,
    [re, im]: [f32; 2],
    delays: &[[f32; TAPS]; DELAY_STEPS as usize + 1],
    row: &mut [[f32; 2]],
) {
    let step = (place.step as usize).min(DELAY_STEPS as usize - 1);
    let (one, next) = (&delays[step], &delays[step + 1]);
    let mut values = [[0.0; 2]; TAPS];
    for (value, (&one, &next)) in values.iter_mut().zip(one.iter().zip(next)) {
        let weight = one + (next - one) * place.part;
        *value = [weight * re, weight * im];
    }
    let within = row.get_mut(place.first as usize..).and_then(|rest| rest.first_chunk_mut::<TAPS>());
    if let Some(samples) = within {
        for (at, value) in samples.iter_mut().zip(values) {
            *at = [at[0] + value[0], at[1] + value[1]];
        }
        return;
    }
    // At the row's ends, taps beyond it are lost.
    for (tap, value) in values.into_iter().enumerate() {
        if let Some(at) = row.get_mut(place.first.wrapping_add(tap as u32) as usize) {
            *at = [at[0] + value[0], at[1] + value[1]];
        }
    }
}

/// Adds echoes to `baseband`, complex [scanlines × row_samples].
pub(in crate::host) fn echo(
    params: &Params,
    constants: ImageConstants,
    interfaces: Interfaces<'_>,
    baseband: &mut [[f32; 2]],
) {
    let rows = baseband.par_chunks_exact_mut(params.row_samples as usize).enumerate();
    rows.for_each(|(line, row)| {
        add_line(params, constants, &interfaces, line as u32, &mut row[..params.samples as usize]);
    });
}

widened! {
    /// Adds the echoes of one scanline.
    fn add_line(
        params: &Params, constants: ImageConstants, interfaces: &Interfaces<'_>, line: u32, row: &mut [[f32; 2]],
    ) = add_line_body
}

#[inline(always)]
fn add_line_body(
    params: &Params,
    constants: ImageConstants,
    interfaces: &Interfaces<'_>,
    line: u32,
    row: &mut [[f32; 2]],
) {
    // No closures: they may be compiled without the vector instructions.
    let mut gain = None;
    if let Some(gains) = interfaces.aperture_gains {
        gain = Some(gains.line(line));
    }
    let (mut echoes, mut axial_echoes) = (Echoes::new(), Echoes::new());
    let mut axial_listed = false;
    let weight = params.path_weight();
    for layer in 0..params.layer_count {
        let first = layer.wrapping_mul(params.scanlines).wrapping_add(line).wrapping_mul(params.rays);
        for ray in 0..params.rays {
            let path = first.wrapping_add(ray) as usize;
            let reflected_mm = interfaces.list(path, constants.first_interface(), gain, &mut echoes);
            echoes.compute(params);
            echoes.add(1.0, f32::NEG_INFINITY, interfaces.delays, row);
            if params.axial_paths == 0 || reflected_mm == f32::MAX {
                continue;
            }
            // The axial path's echoes replace those that the path missed.
            if !axial_listed {
                interfaces.list(params.axial_path_of(line) as usize, 1, gain, &mut axial_echoes);
                axial_echoes.compute(params);
                axial_listed = true;
            }
            axial_echoes.add(weight, reflected_mm, interfaces.delays, row);
        }
    }
}

impl Interfaces<'_> {
    /// Lists the echoes of a path from segment `first` on. With a `gain`, returns the range of the path's first
    /// reflection, beyond which the axial path's echoes are added, too. Without a gain or a reflection, returns
    /// `f32::MAX`.
    #[inline(always)]
    fn list(&self, path: usize, first: usize, gain: Option<ApertureGain<'_>>, echoes: &mut Echoes) -> f32 {
        let (starts, segments) = self.paths.of(path);
        let sources = &self.echoes[path * SEGMENTS as usize..][..SEGMENTS as usize];
        let count = (self.segment_counts[path] as usize).min(sources.len());
        let mut gains = None;
        if let Some(gain) = gain {
            gains = Some(InterfaceGains::new(gain, (starts, segments)));
        }
        let mut reflected_mm = f32::MAX;
        echoes.count = 0;
        for segment in first..count {
            if gains.is_some() && reflected_mm == f32::MAX && segments[segment].has_reflected() {
                reflected_mm = starts[segment];
            }
            let [amplitude, range_mm] = sources[segment];
            if amplitude == 0.0 {
                continue;
            }
            let mut ln_gain = 0.0;
            if let (Some(gains), Some(arrived)) = (&mut gains, segment.checked_sub(1))
                && !segments[arrived].has_reflected()
            {
                ln_gain = gains.at(arrived);
            }
            let i = echoes.count;
            (echoes.amplitude[i], echoes.ln_gain[i]) = (amplitude, ln_gain);
            (echoes.range_mm[i], echoes.interface_mm[i]) = (range_mm, starts[segment]);
            echoes.count = i + 1;
        }
        reflected_mm
    }
}
