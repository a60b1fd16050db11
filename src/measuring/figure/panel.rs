//! Panel below the figure: errors of effects and of post-processing ("look") against theory.

use plotters::coord::Shift;
use plotters::drawing::DrawingAreaErrorKind;
use plotters::prelude::*;
use plotters::style::text_anchor::{HPos, Pos, VPos};

use super::{colour, text};
use crate::measuring::EffectError;

/// Heights of the title, of each row and of the axis, pixels.
const TITLE: i32 = 56;
const ROW: i32 = 34;
const AXIS: i32 = 40;
/// Left and right end of the error scale, pixels.
const SCALE: [i32; 2] = [660, 1130];
/// Errors at both ends of the scale, as multiples of their tolerances.
const ENDS: [f64; 2] = [0.03, 30.0];

/// Height of the panel, pixels; 0 without effects.
pub(super) fn height(effects: &[EffectError]) -> u32 {
    if effects.is_empty() { 0 } else { (TITLE + AXIS) as u32 + ROW as u32 * effects.len() as u32 }
}

/// Horizontal position on the scale, pixels, of an error given as a multiple of its tolerance.
fn position(part: f64) -> i32 {
    let [from, to] = ENDS.map(f64::ln);
    let along = ((part.max(f64::MIN_POSITIVE).ln() - from) / (to - from)).clamp(0.0, 1.0);
    SCALE[0] + (along * f64::from(SCALE[1] - SCALE[0])).round() as i32
}

/// Draws the panel of effects.
pub(super) fn draw<B: DrawingBackend>(
    area: &DrawingArea<B, Shift>,
    effects: &[EffectError],
) -> Result<(), DrawingAreaErrorKind<B::ErrorType>> {
    area.fill(&WHITE)?;
    let text = |h_pos, colour: &RGBColor| text(Pos::new(h_pos, VPos::Center), colour);
    let grey = RGBColor(130, 130, 130);
    area.draw(&Text::new(
        "Error against theory, effect by effect; below, steps of a look",
        (20, 12),
        text(HPos::Left, &BLACK),
    ))?;
    let under = "RMS over the tolerance of a single value. Hollow: without it. Filled: with it, at one ray.";
    area.draw(&Text::new(under, (20, 34), text(HPos::Left, &grey)))?;
    let bottom = TITLE + ROW * effects.len() as i32;
    for part in [0.1, 1.0, 10.0] {
        let line = if part == 1.0 { BLACK } else { RGBColor(220, 220, 220) };
        area.draw(&PathElement::new(vec![(position(part), TITLE), (position(part), bottom)], line))?;
        let label = if part == 1.0 { "tolerance".to_owned() } else { format!("{part}") };
        area.draw(&Text::new(label, (position(part), bottom + 14), text(HPos::Center, &BLACK)))?;
    }
    for (row, effect) in effects.iter().enumerate() {
        let error = &effect.error;
        let y = TITLE + ROW * row as i32 + ROW / 2;
        area.draw(&Text::new(error.effect.clone(), (20, y), text(HPos::Left, &BLACK)))?;
        area.draw(&Text::new(effect.cost(), (270, y), text(HPos::Right, &BLACK)))?;
        area.draw(&Text::new(error.quantity.clone(), (290, y), text(HPos::Left, &grey)))?;
        let [without, with] = [error.without, error.with].map(|rms| position(rms / error.tolerance));
        let colour = colour(row);
        area.draw(&PathElement::new(vec![(without, y), (with, y)], colour))?;
        area.draw(&Circle::new((without, y), 6, WHITE.filled()))?;
        area.draw(&Circle::new((without, y), 6, colour.stroke_width(2)))?;
        area.draw(&Circle::new((with, y), 6, colour.filled()))?;
        let (left, right) = (with.min(without) - 12, with.max(without) + 12);
        let ends = if with < without { [error.with, error.without] } else { [error.without, error.with] };
        area.draw(&Text::new(effect.with_unit(ends[0]), (left, y), text(HPos::Right, &BLACK)))?;
        area.draw(&Text::new(effect.with_unit(ends[1]), (right, y), text(HPos::Left, &BLACK)))?;
    }
    Ok(())
}
