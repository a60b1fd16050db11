//! The needle in the f64 twin: shadow, echoes and outline, from the frame's table.

use glam::{DVec2, DVec3};

use super::echo::spread;
use super::inputs::Inputs;
use super::needle_table::Needle;
use super::segment::{Path, segment_at};
use super::visibility::{ApertureGain, Boundary};

/// Multiplies the transmission of the cells behind the needle.
pub fn needle_shadow(inputs: &Inputs, mask: &mut [DVec2]) {
    for &(cell, passes) in inputs.needle.iter().flat_map(|needle| &needle.shadows) {
        mask[cell] *= passes;
    }
}

/// Adds the needle's echoes to the focused lines [scanlines × samples], with the loss of the scanline up to the needle.
pub fn needle_echo(inputs: &Inputs, paths: &[Path], gains: &[Boundary], focused: &mut [DVec2]) {
    let Some(needle) = &inputs.needle else { return };
    for (line, echoes) in needle.echoes.iter().enumerate() {
        let path = &paths[inputs.axial_path_of(line)];
        let row = &mut focused[line * inputs.samples..][..inputs.samples];
        for echo in echoes {
            let reached_mm = range_of(path, echo.depth_mm);
            let segment = &path.segments[segment_at(path, reached_mm)];
            let ln_gain = match &inputs.aperture {
                Some(aperture) => {
                    let loss_np = -0.5 * segment.ln_passed(reached_mm);
                    ApertureGain::new(aperture, gains, line).at(reached_mm, loss_np)
                }
                None => segment.ln_amplitude(reached_mm),
            };
            let trips = (-echo.extra_mm).max(1.0);
            let range_mm = trips * reached_mm + echo.extra_mm.max(0.0);
            let phase = DVec2::from_angle(std::f64::consts::TAU * echo.turns);
            let value = echo.amplitude * (trips * ln_gain).max(-80.0).exp() * inputs.carrier(range_mm).rotate(phase);
            spread(inputs, range_mm, value, row);
        }
    }
}

/// Range at which a path reaches a depth, mm. Media of other speeds than 1540 m/s make it differ from the depth.
fn range_of(path: &Path, depth_mm: f64) -> f64 {
    let mut left_mm = depth_mm;
    for (segment, next) in path.segments.iter().zip(path.segments.iter().skip(1)) {
        let rate = rate_of(segment);
        let through_mm = (next.start_mm - segment.start_mm) * rate;
        if through_mm >= left_mm {
            return segment.start_mm + left_mm / rate;
        }
        left_mm -= through_mm;
    }
    path.segments.last().map_or(depth_mm, |last| last.start_mm + left_mm / rate_of(last))
}

/// Depth per mm of range on a segment; 1 on reflected segments.
fn rate_of(segment: &super::segment::Segment) -> f64 {
    let rate = segment.step.length();
    if segment.has_reflected || rate < 0.1 { 1.0 } else { rate }
}

/// Marks the needle's cross-section in the segmentation [height × width].
pub fn needle_map(inputs: &Inputs, segmentation: &mut [u8]) {
    let Some(Needle { outline, .. }) = &inputs.needle else { return };
    let [width, height] = [inputs.image.width, inputs.image.height].map(|v| v as usize);
    let wide = |v: [f32; 3]| DVec3::from(v.map(f64::from));
    let (tip_mm, direction) = (wide(outline.tip_mm), wide(outline.direction));
    for row in 0..height.min((outline.first[1] + outline.size[1]) as usize) {
        for column in 0..width {
            let at = |corner: f32, pixel: usize| f64::from(corner) + (pixel as f64 + 0.5) * f64::from(outline.pixel_mm);
            let centre = DVec3::new(at(outline.corner_mm[0], column), 0.0, at(outline.corner_mm[1], row));
            let from_tip = centre - tip_mm;
            let along = from_tip.dot(direction);
            let inside = (0.0..=f64::from(outline.length_mm)).contains(&along)
                && (from_tip - along * direction).length() <= f64::from(outline.radius_mm);
            let pixel = &mut segmentation[row * width + column];
            if inside && *pixel != 0 && outline.size[0] > 0 {
                *pixel = outline.tissue as u8;
            }
        }
    }
}
