//! Annotations of a picture: tissues, scale, axes, and the fan's outline.

use glam::DVec3;
use image::RgbImage;

use super::panel::{Panel, Picture};
use crate::anatomy::Axes;
use crate::sink::canvas::{Canvas, Text};
use crate::sink::colour::{self, Rgb};

const GROUND: Rgb = [14, 17, 22];
const INK: Rgb = [214, 221, 227];
const FAINT: Rgb = [139, 151, 163];
const FAN: Rgb = [255, 205, 90];

/// Width of the legend of tissues in a picture of `width` pixels, pixels.
pub(super) fn legend_width(width: u32) -> u32 {
    if width < 480 { 0 } else { 210 }
}

pub(super) fn canvas(width: u32, height: u32) -> Canvas {
    Canvas::new(width, height, GROUND)
}

pub(super) fn picture(canvas: &Canvas) -> Picture {
    let (width, height) = canvas.size();
    Picture { width, height, rgb: canvas.as_rgb().to_vec() }
}

/// Draws a panel at the position `at`, with the fan's outline, a scale and the axes.
pub(super) fn draw_panel(canvas: &mut Canvas, at: (u32, u32), panel: &Panel, axes: Axes) {
    if let Some(image) = RgbImage::from_raw(panel.width, panel.height, panel.rgb.clone()) {
        canvas.draw(at.0, at.1, &image);
    }
    let mut pen = Pen { canvas, at, size: (panel.width, panel.height) };
    let pixels: Vec<_> = panel.outline.iter().map(|&p| panel.camera.pixel(p)).collect();
    for (i, &from) in pixels.iter().enumerate() {
        pen.line(from, pixels[(i + 1) % pixels.len()], 2, FAN);
    }
    pen.scale(panel.camera.mm_per_pixel);
    pen.axes(panel, axes);
}

pub(super) fn title(canvas: &mut Canvas, at: (u32, u32), title: &str) {
    canvas.text(at.0 + 12, at.1 + 8, title, Text::Small, INK);
}

/// Draws the legend of tissues, from `left` to the canvas's edge.
pub(super) fn legend(canvas: &mut Canvas, left: u32, names: &[&str]) {
    let (width, height) = canvas.size();
    if left >= width {
        return;
    }
    let row = 22;
    let room = (height.saturating_sub(40) / row) as usize;
    for (i, name) in names.iter().enumerate().take(room) {
        let y = 16 + row * i as u32;
        if i + 1 == room && names.len() > room {
            canvas.text(left + 12, y, &format!("and {} more", names.len() - i), Text::Small, FAINT);
            break;
        }
        canvas.fill(left + 12, y + 2, 14, 12, colour::tissue(name));
        canvas.text(left + 34, y, &name.replace('_', " "), Text::Small, INK);
    }
}

/// Drawing tool that is limited to a panel.
struct Pen<'a> {
    canvas: &'a mut Canvas,
    at: (u32, u32),
    size: (u32, u32),
}

impl Pen<'_> {
    fn dot(&mut self, x: f64, y: f64, side: u32, colour: Rgb) {
        let half = f64::from(side) / 2.0;
        let (x, y) = ((x - half).round(), (y - half).round());
        let inside = x >= 0.0 && y >= 0.0 && x + f64::from(side) <= f64::from(self.size.0);
        if inside && y + f64::from(side) <= f64::from(self.size.1) {
            self.canvas.fill(self.at.0 + x as u32, self.at.1 + y as u32, side, side, colour);
        }
    }

    fn line(&mut self, from: (f64, f64), to: (f64, f64), side: u32, colour: Rgb) {
        let steps = (to.0 - from.0).abs().max((to.1 - from.1).abs()).ceil().clamp(1.0, 1e5);
        for i in 0..=steps as u32 {
            let part = f64::from(i) / steps;
            self.dot(from.0 + part * (to.0 - from.0), from.1 + part * (to.1 - from.1), side, colour);
        }
    }

    /// Draws a scale bar of a round length, about a fifth of the panel.
    fn scale(&mut self, mm_per_pixel: f64) {
        let room = 0.2 * f64::from(self.size.0) * mm_per_pixel;
        let decade = 10f64.powf(room.max(1e-9).log10().floor());
        let length = [5.0, 2.0, 1.0].into_iter().map(|m| m * decade).find(|&mm| mm <= room).unwrap_or(decade);
        let text = format!("{length} mm");
        let pixels = length / mm_per_pixel;
        let (x, y) = (f64::from(self.size.0) - 20.0 - pixels, f64::from(self.size.1) - 18.0);
        self.line((x, y), (x + pixels, y), 3, INK);
        for end in [x, x + pixels] {
            self.line((end, y - 5.0), (end, y + 5.0), 2, INK);
        }
        let left = (x + 0.5 * (pixels - f64::from(Text::Small.width(&text)))).max(0.0) as u32;
        let top = self.size.1.saturating_sub(44);
        self.canvas.text(self.at.0 + left, self.at.1 + top, &text, Text::Small, INK);
    }

    fn axes(&mut self, panel: &Panel, axes: Axes) {
        const ARM: f64 = 34.0;
        let foot = (62.0, f64::from(self.size.1) - 58.0);
        let colours = [[235, 92, 84], [112, 200, 96], [92, 150, 245]];
        for ((axis, label), colour) in DVec3::AXES.into_iter().zip(axes.labels()).zip(colours) {
            let (x, y) = (axis.dot(panel.camera.right), -axis.dot(panel.camera.up));
            // An axis that points towards the viewer or away has no room for its name.
            if x.hypot(y) < 0.2 {
                continue;
            }
            self.line(foot, (foot.0 + ARM * x, foot.1 + ARM * y), 2, colour);
            let width = f64::from(Text::Small.width(label));
            let left = foot.0
                + (ARM + 6.0) * x
                + if x < -0.3 {
                    -width
                } else if x > 0.3 {
                    0.0
                } else {
                    -0.5 * width
                };
            let top = foot.1 + (ARM + 10.0) * y - 8.0;
            let (left, top) = (left.max(2.0) as u32, top.max(2.0) as u32);
            self.canvas.text(self.at.0 + left, self.at.1 + top, label, Text::Small, colour);
        }
    }
}
