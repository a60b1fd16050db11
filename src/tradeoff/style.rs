//! Text size and colours of the figure.

use plotters::style::RGBColor;

/// Height of the text, pixels.
pub(super) const TEXT: u32 = 16;

/// Colours distinguishable by the colour-blind (Okabe and Ito 2008).
pub(super) fn colour(index: usize) -> RGBColor {
    const COLOURS: [RGBColor; 8] = [
        RGBColor(0, 114, 178),
        RGBColor(213, 94, 0),
        RGBColor(0, 158, 115),
        RGBColor(204, 121, 167),
        RGBColor(230, 159, 0),
        RGBColor(86, 180, 233),
        RGBColor(150, 140, 30),
        RGBColor(90, 90, 90),
    ];
    COLOURS[index % COLOURS.len()]
}
