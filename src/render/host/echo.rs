//! Adds the interfaces' echoes to the baseband, each scanline's in a fixed order.

use rayon::prelude::*;

use super::constants::ImageConstants;
use super::wide::phasor;
use crate::render::constants::SEGMENTS;
use crate::render::params::Params;

/// Adds echoes to `baseband`, complex [scanlines × row_samples]. `echoes` holds amplitude and range in mm
/// [paths × SEGMENTS]; `segment_counts` has one number per path. A path's first segment begins at the face and has no echo.
pub(crate) fn echo(
    params: &Params,
    constants: ImageConstants,
    echoes: &[[f32; 2]],
    segment_counts: &[u32],
    baseband: &mut [[f32; 2]],
) {
    let rows = baseband.par_chunks_exact_mut(params.row_samples as usize).enumerate();
    let [rays, scanlines] = [params.rays as usize, params.scanlines as usize];
    rows.for_each(|(line, row)| {
        let row = &mut row[..params.samples as usize];
        for layer in 0..params.layer_count as usize {
            let first = (layer * scanlines + line) * rays;
            let counts = segment_counts[first..first + rays].iter();
            for (echoes, &count) in echoes[first * SEGMENTS as usize..].chunks_exact(SEGMENTS as usize).zip(counts) {
                for &[amplitude, range_mm] in echoes.iter().take(count as usize).skip(constants.first_interface()) {
                    let sample = range_mm / params.sample_spacing_mm;
                    if amplitude != 0.0 && sample >= 0.0 && sample < params.samples as f32 {
                        let [re, im] = phasor(-params.phase_turns_per_mm * range_mm);
                        if let Some(at) = row.get_mut(sample as usize) {
                            *at = [at[0] + amplitude * re, at[1] + amplitude * im];
                        }
                    }
                }
            }
        }
    });
}
