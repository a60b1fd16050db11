//! Multiples: echoes that the face reflects back into the body, and that return again.

use glam::DVec2;

use super::inputs::Inputs;
use crate::constants::{MULTIPLE_FIRST, MULTIPLE_GAIN_MAX, MULTIPLE_SAMPLES};

/// Adds multiples to the focused baseband [scanlines × samples].
///
/// Behind a face that reflects the amplitude ρ, the lines y of echoes h are y = h + ρ·h∗y. Only strong echoes S of h have
/// visible multiples. With the weak ones W = h − S, and without echoes that are weak twice, y = h + ρ·S∗(y + W): a pair of
/// a strong and a weak echo is passed in both orders.
pub fn multiples(inputs: &Inputs, focused: &mut [DVec2]) {
    if inputs.face_reflection > 0.0 {
        focused.chunks_exact_mut(inputs.samples).for_each(|row| of_line(inputs.face_reflection, row));
    }
}

fn of_line(face_reflection: f64, row: &mut [DVec2]) {
    let first = MULTIPLE_FIRST as usize;
    let mut powers: Vec<f64> = row.iter().skip(first).map(|echo| echo.length_squared()).collect();
    powers.sort_by(|a, b| b.total_cmp(a));
    let weakest = powers.get(MULTIPLE_SAMPLES as usize).copied().unwrap_or(0.0);
    // The amplitude falls to zero at the weakest power, so that a sample that is no longer strong leaves no step.
    let strong = |echo: DVec2| {
        let power = echo.length_squared();
        if power > weakest { echo * (1.0 - weakest / power) } else { DVec2::ZERO }
    };
    let echoes: Vec<(usize, DVec2)> = row
        .iter()
        .enumerate()
        .skip(first)
        .map(|(i, echo)| (i, strong(*echo)))
        .filter(|(_, s)| *s != DVec2::ZERO)
        .collect();
    let sum: f64 = echoes.iter().map(|(_, s)| s.length()).sum();
    let reflection = face_reflection.min(MULTIPLE_GAIN_MAX / sum);
    // y + W of the samples so far.
    let mut again: Vec<DVec2> = Vec::with_capacity(row.len());
    for (i, echo) in row.iter_mut().enumerate() {
        let weak = if i < first { *echo } else { *echo - strong(*echo) };
        // Sample i lies i + ½ samples deep, so depths of the samples j and k add up to that of sample j + k + 1.
        let earlier = echoes.iter().take_while(|(at, _)| *at < i);
        let added: DVec2 = earlier.map(|(at, s)| s.rotate(again[i - 1 - at])).sum();
        *echo += reflection * added;
        again.push(*echo + weak);
    }
}
