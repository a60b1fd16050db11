//! The steps of post-processing in f64, pixel by pixel.

use insonify_core::settings::{GreyMap, LookSettings};

use super::speckle_reduction::SPECKLE_DB;
use super::{Shape, edges, speckle_reduction};

/// The picture after all steps, as grey levels before rounding. `before` is the previous output of persistence; `None`
/// for the first picture.
pub fn apply(settings: &LookSettings, shape: Shape<'_>, picture: &[f64], before: Option<&[f64]>) -> Vec<f64> {
    let reduced = speckle_reduction(settings.speckle_reduction, shape, picture);
    let edged = enhance(settings.edge_enhancement, shape, &reduced);
    let lasting = persist(settings.persistence, &edged, before);
    grey_map(settings.grey_map, &lasting)
}

/// Mean and variance over the square window around pixel `at`, without pixels outside the sector.
fn moments(shape: Shape<'_>, half: usize, picture: &[f64], at: usize) -> [f64; 2] {
    let (row, column, height) = (at / shape.width, at % shape.width, picture.len() / shape.width);
    let (mut count, mut sum, mut squares) = (0.0, 0.0, 0.0);
    for y in row.saturating_sub(half)..=(row + half).min(height - 1) {
        for x in column.saturating_sub(half)..=(column + half).min(shape.width - 1) {
            if shape.mask[y * shape.width + x] != 0 {
                let level = picture[y * shape.width + x];
                (count, sum, squares) = (count + 1.0, sum + level, squares + level * level);
            }
        }
    }
    let mean = sum / count;
    [mean, squares / count - mean * mean]
}

fn inside(shape: Shape<'_>, picture: &[f64], each: impl Fn(usize, f64) -> f64) -> Vec<f64> {
    let level = |(i, &level): (usize, &f64)| if shape.mask[i] == 0 { level } else { each(i, level) };
    picture.iter().enumerate().map(level).collect()
}

/// Lee's filter, blended with the original by `strength`.
pub(crate) fn speckle_reduction(strength: f64, shape: Shape<'_>, picture: &[f64]) -> Vec<f64> {
    let speckle = (SPECKLE_DB * 255.0 / shape.dynamic_range_db).powi(2) / shape.independent_angles.max(1.0);
    inside(shape, picture, |i, level| {
        let [mean, variance] = moments(shape, speckle_reduction::HALF, picture, i);
        let kept = (variance - speckle).max(0.0) / variance.max(1.0e-3);
        level + strength * (mean + kept * (level - mean) - level)
    })
}

/// The unsharp mask with strength `amount`.
pub(crate) fn enhance(amount: f64, shape: Shape<'_>, picture: &[f64]) -> Vec<f64> {
    inside(shape, picture, |i, level| {
        let [mean, _] = moments(shape, edges::HALF, picture, i);
        (level + amount * (level - mean)).clamp(0.0, 255.0)
    })
}

/// The running mean after a picture; `before` is the mean until then.
pub(crate) fn persist(amount: f64, picture: &[f64], before: Option<&[f64]>) -> Vec<f64> {
    let before = before.unwrap_or(picture);
    picture.iter().zip(before).map(|(level, before)| amount * before + (1.0 - amount) * level).collect()
}

/// A grey map by formulas unlike those under test: powers as exponentials of logarithms, the S-curve as a Bézier curve.
pub(crate) fn grey_map(map: GreyMap, picture: &[f64]) -> Vec<f64> {
    let power = |x: f64, exponent: f64| (exponent * x.ln()).exp();
    // Bézier curve with the control points 0, 0, 1, 1.
    let bezier = |x: f64| 3.0 * (1.0 - x) * x.powi(2) + x.powi(3);
    let display = |x: f64| match map {
        GreyMap::Linear => x,
        GreyMap::Soft => power(x, 0.8),
        GreyMap::Bright => power(x, 0.6),
        GreyMap::Dark => power(x, 1.5),
        GreyMap::Contrast => x + 0.5 * (bezier(x) - x),
        GreyMap::Sharp => bezier(x),
    };
    picture.iter().map(|level| 255.0 * display(level / 255.0)).collect()
}
