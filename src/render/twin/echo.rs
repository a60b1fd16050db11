//! The interfaces' echoes.

use glam::DVec2;

use super::inputs::Inputs;
use super::trace::Path;

/// Adds every interface's echo to the baseband sample that holds its range [scanlines × samples].
pub fn echo(inputs: &Inputs, paths: &[Path], baseband: &mut [DVec2]) {
    for (index, path) in paths.iter().enumerate().take(inputs.sounding()) {
        let line = index / inputs.rays_per_line % inputs.scanlines;
        // The first segment begins at the face, not at an interface.
        for segment in path.segments.iter().skip(1) {
            let sample = segment.echo_range_mm / inputs.sample_spacing_mm;
            if segment.echo != 0.0 && (0.0..inputs.samples as f64).contains(&sample) {
                let at = line * inputs.samples + sample as usize;
                baseband[at] += segment.echo * inputs.carrier(segment.echo_range_mm);
            }
        }
    }
}
