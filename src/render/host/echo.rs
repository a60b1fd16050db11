//! Adds the interfaces' echoes to the baseband, each scanline's in a fixed order.

use rayon::prelude::*;

use super::constants::ImageConstants;
use super::line_gain::{LineGain, Visibility};
use super::paths::Paths;
use super::transmission::diverted;
use crate::render::constants::SEGMENTS;
use crate::render::params::Params;
use crate::simd::{exp, phasor};

/// Inputs of the interfaces.
#[derive(Debug, Clone, Copy)]
pub(super) struct Interfaces<'a> {
    pub(super) paths: Paths<'a>,
    /// Amplitude and range in mm [paths × SEGMENTS]. A path's first segment begins at the face and has no echo.
    pub(super) echoes: &'a [[f32; 2]],
    /// Segments of each path.
    pub(super) segment_counts: &'a [u32],
    /// Gain along the scanlines; without it, echoes have the loss of their paths.
    pub(super) visibility: Option<&'a Visibility<'a>>,
}

/// An echo in the baseband.
#[derive(Debug, Clone, Copy, Default)]
struct Echo {
    sample: usize,
    value: [f32; 2],
    /// Range of its interface, mm.
    range_mm: f32,
}

/// Echoes of the guide of a scanline.
type GuideEchoes = [Echo; SEGMENTS as usize];

/// Adds echoes to `baseband`, complex [scanlines × row_samples].
pub(super) fn echo(params: &Params, constants: ImageConstants, interfaces: Interfaces<'_>, baseband: &mut [[f32; 2]]) {
    let rows = baseband.par_chunks_exact_mut(params.row_samples as usize).enumerate();
    rows.for_each(|(line, row)| {
        let row = &mut row[..params.samples as usize];
        let gain = interfaces.visibility.map(|visibility| visibility.line(line as u32));
        let mut guide_echoes: GuideEchoes = [Echo::default(); SEGMENTS as usize];
        let mut guides = None;
        let weight = params.path_weight();
        for layer in 0..params.layer_count {
            let first = (layer * params.scanlines + line as u32) * params.rays;
            for path in first..first + params.rays {
                let reflected_mm = interfaces.add_path(params, constants, path as usize, gain, row);
                if params.guides == 0 || reflected_mm == f32::MAX {
                    continue;
                }
                // The guide stands for what the path missed.
                let count = *guides.get_or_insert_with(|| {
                    let guide = params.guide_of(line as u32) as usize;
                    interfaces.guide_echoes(params, guide, gain, &mut guide_echoes)
                });
                for echo in guide_echoes[..count].iter().filter(|echo| echo.range_mm > reflected_mm) {
                    let [re, im] = echo.value;
                    let at = &mut row[echo.sample];
                    *at = [at[0] + weight * re, at[1] + weight * im];
                }
            }
        }
    });
}

impl Interfaces<'_> {
    /// The echo at the start of a segment of a path, if it lies within the samples.
    #[inline(always)]
    fn echo_at(&self, params: &Params, path: usize, segment: usize, gain: Option<LineGain<'_>>) -> Option<Echo> {
        let [amplitude, range_mm] = self.echoes[path * SEGMENTS as usize + segment];
        let sample = range_mm / params.sample_spacing_mm;
        if amplitude == 0.0 || sample < 0.0 || sample >= params.samples as f32 {
            return None;
        }
        let (starts, segments) = self.paths.of(path);
        let mut amplitude = amplitude;
        if let (Some(gain), Some(arrived)) = (gain, segment.checked_sub(1))
            && !diverted(&segments[arrived])
        {
            amplitude *= exp(gain.at_interface(starts, segments, arrived).max(-80.0));
        }
        let [re, im] = phasor(-params.phase_turns_per_mm * range_mm);
        Some(Echo { sample: sample as usize, value: [amplitude * re, amplitude * im], range_mm: starts[segment] })
    }

    /// Adds the echoes of a path. Returns the range of its first reflection if the guide stands for it from there on,
    /// else the greatest number.
    fn add_path(
        &self,
        params: &Params,
        constants: ImageConstants,
        path: usize,
        gain: Option<LineGain<'_>>,
        row: &mut [[f32; 2]],
    ) -> f32 {
        let mut reflected_mm = f32::MAX;
        let (starts, segments) = self.paths.of(path);
        for segment in constants.first_interface()..self.segment_counts[path] as usize {
            if gain.is_some() && reflected_mm == f32::MAX && diverted(&segments[segment]) {
                reflected_mm = starts[segment];
            }
            if let Some(echo) = self.echo_at(params, path, segment, gain)
                && let Some(at) = row.get_mut(echo.sample)
            {
                *at = [at[0] + echo.value[0], at[1] + echo.value[1]];
            }
        }
        reflected_mm
    }

    /// Fills in the echoes of a guide; returns their number.
    fn guide_echoes(
        &self,
        params: &Params,
        guide: usize,
        gain: Option<LineGain<'_>>,
        echoes: &mut GuideEchoes,
    ) -> usize {
        let mut count = 0;
        for segment in 1..self.segment_counts[guide] as usize {
            if let Some(echo) = self.echo_at(params, guide, segment, gain) {
                echoes[count] = echo;
                count += 1;
            }
        }
        count
    }
}
