//! The interfaces' echoes.

use glam::DVec2;

use super::inputs::Inputs;
use super::segment::Path;
use super::visibility::{ApertureGain, Boundary};

/// Adds each interface's echo to `baseband` [scanlines × samples], at the sample that holds the echo's range, or
/// spread over the samples around it.
///
/// With the effect `aperture`, the aperture's gain replaces a path's loss up to its first reflection. After the
/// reflection the path adds its own echoes, and the axial path's echoes times the gain.
pub fn echo(inputs: &Inputs, paths: &[Path], gains: &[Boundary], baseband: &mut [DVec2]) {
    for (index, path) in paths.iter().enumerate().take(inputs.sounding()) {
        let line = index / inputs.rays_per_line % inputs.scanlines;
        let gain = inputs.aperture.as_ref().map(|aperture| ApertureGain::new(aperture, gains, line));
        // The first segment begins at the face, not at an interface.
        for segment in 1..path.segments.len() {
            add(inputs, path, segment, gain, 1.0, line, baseband);
        }
        let reflection = path.segments.iter().find(|segment| segment.has_reflected);
        if let (Some(reflection), Some(_), 1..) = (reflection, gain, inputs.axial_paths) {
            let weight = inputs.path_weight();
            let axial_path = &paths[inputs.axial_path_of(line)];
            let behind =
                (1..axial_path.segments.len()).filter(|&s| axial_path.segments[s].start_mm > reflection.start_mm);
            behind.for_each(|segment| add(inputs, axial_path, segment, gain, weight, line, baseband));
        }
    }
}

/// Adds the echo at the start of segment `number` of a path, times `weight`.
fn add(
    inputs: &Inputs,
    path: &Path,
    number: usize,
    gain: Option<ApertureGain<'_>>,
    weight: f64,
    line: usize,
    baseband: &mut [DVec2],
) {
    let segment = &path.segments[number];
    let sample = segment.echo_range_mm / inputs.sample_spacing_mm;
    if segment.echo != 0.0 && (0.0..inputs.samples as f64).contains(&sample) {
        let arrived = number - 1;
        let gain = gain.filter(|_| !path.segments[arrived].has_reflected);
        let gain = gain.map_or(1.0, |gain| gain.at_interface(path, arrived).max(-80.0).exp());
        let value = weight * gain * segment.echo * inputs.carrier(segment.echo_range_mm);
        spread(inputs, segment.echo_range_mm, value, &mut baseband[line * inputs.samples..][..inputs.samples]);
    }
}

/// Adds an echo at a range to a scanline: at the sample that holds the range, or spread over the samples around it. A
/// range beyond the scanline adds nothing.
pub(super) fn spread(inputs: &Inputs, range_mm: f64, value: DVec2, row: &mut [DVec2]) {
    let sample = range_mm / inputs.sample_spacing_mm;
    if !(0.0..inputs.samples as f64).contains(&sample) {
        return;
    }
    if inputs.delays.is_empty() {
        row[sample as usize] += value;
        return;
    }
    // Samples are centred half a spacing after their number.
    let before = (sample - 0.5).floor();
    for (tap, weight) in inputs.delay_weights(sample - 0.5 - before).into_iter().enumerate() {
        let at = before + tap as f64 - 1.0;
        if (0.0..inputs.samples as f64).contains(&at) {
            row[at as usize] += weight * value;
        }
    }
}

impl Inputs {
    /// Weights of an echo at the fraction `part` of the way from one sample to the next, linear between their table's
    /// steps.
    fn delay_weights(&self, part: f64) -> [f64; 4] {
        let step = part * (self.delays.len() - 1) as f64;
        let low = (step as usize).min(self.delays.len() - 2);
        let [one, next] = [self.delays[low], self.delays[low + 1]];
        std::array::from_fn(|tap| one[tap] + (next[tap] - one[tap]) * (step - low as f64))
    }
}
