//! Figure of error over time (logarithmic axis) of operating points, as SVG and PNG.
//!
//! The crate `plotters` draws both. In the SVG, text stays text. The PNG uses the bitmap font of the image captions, so
//! it needs no installed font.

mod labels;
mod panel;

use std::convert::Infallible;

use image::{Rgb, RgbImage};
use noto_sans_mono_bitmap::{FontWeight, RasterHeight, get_raster, get_raster_width};
use plotters::coord::Shift;
use plotters::drawing::DrawingAreaErrorKind;
use plotters::prelude::*;
use plotters::style::text_anchor::{HPos, Pos, VPos};
use plotters_backend::{BackendColor, BackendCoord, BackendTextStyle, DrawingBackend, DrawingErrorKind};

use super::table::shown;
use super::{EffectError, Point};

/// Height of text, pixels.
const TEXT: u32 = 16;

/// Width and height of the figure without the panel of effects, pixels.
const SIZE: (u32, u32) = (1200, 800);
/// Frame times of LQ and HQ in Zhang et al. 2020 on a 2080 Ti, ms, with their captions.
const PAPER: [(f64, &str); 2] = [(40.0, "paper, 2080 Ti: LQ 40 ms"), (75.0, "paper, 2080 Ti: HQ 75 ms")];

/// Data of a figure.
#[derive(Debug, Clone, Copy)]
pub struct Figure<'a> {
    /// Measured operating points.
    pub points: &'a [Point],
    /// Errors of effects, drawn in a panel below.
    pub effects: &'a [EffectError],
    /// Title above the figure.
    pub title: &'a str,
    /// Whether the reference is converged; if not, the error axis says so.
    pub converged: bool,
}

impl Figure<'_> {
    /// Width and height, pixels.
    fn size(&self) -> (u32, u32) {
        (SIZE.0, SIZE.1 + panel::height(self.effects))
    }

    fn draw<B: DrawingBackend>(&self, area: &DrawingArea<B, Shift>) -> Result<(), DrawingAreaErrorKind<B::ErrorType>> {
        let (upper, lower) = area.split_vertically(SIZE.1);
        draw(&upper, self.points, self.title, self.converged)?;
        if self.effects.is_empty() { Ok(()) } else { panel::draw(&lower, self.effects) }
    }
}

/// The figure as SVG.
///
/// # Errors
/// The message of the drawing library.
pub fn svg(figure: &Figure<'_>) -> Result<String, String> {
    let mut text = String::new();
    let area = SVGBackend::with_string(&mut text, figure.size()).into_drawing_area();
    figure.draw(&area).map_err(|e| e.to_string())?;
    area.present().map_err(|e| e.to_string())?;
    drop(area);
    Ok(text)
}

/// The figure as pixels: width, height, and RGB values [height × width × 3].
///
/// # Errors
/// The message of the drawing library.
pub fn rgb(figure: &Figure<'_>) -> Result<(u32, u32, Vec<u8>), String> {
    let (width, height) = figure.size();
    let mut raster = Raster { image: RgbImage::from_pixel(width, height, Rgb([255; 3])) };
    let area = (&mut raster).into_drawing_area();
    figure.draw(&area).map_err(|e| e.to_string())?;
    drop(area);
    Ok((width, height, raster.image.into_raw()))
}

fn draw<B: DrawingBackend>(
    area: &DrawingArea<B, Shift>,
    points: &[Point],
    title: &str,
    converged: bool,
) -> Result<(), DrawingAreaErrorKind<B::ErrorType>> {
    let drawn: Vec<&Point> =
        points.iter().filter(|p| p.time.median_ms > 0.0 && p.error.seen.whole.is_finite()).collect();
    let times = drawn.iter().map(|p| p.time.median_ms).chain(PAPER.map(|(ms, _)| ms));
    let (least, most) = times.fold((f64::INFINITY, 0.0f64), |(a, b), ms| (a.min(ms), b.max(ms)));
    let (from_ms, to_ms) = (least / 1.5, most * 2.0);
    let worst = drawn.iter().map(|p| p.error.seen.whole).fold(1.0, f64::max);
    area.fill(&WHITE)?;
    let from_left = Pos::new(HPos::Left, VPos::Center);
    area.draw(&Text::new(title.to_owned(), (20, 20), text(from_left, &BLACK)))?;
    let reference = if converged { "the converged reference" } else { "the reference (NOT converged)" };
    let axis = format!("seen error (levels and texture) against {reference}, grey levels");
    area.draw(&Text::new(axis, (20, 42), text(from_left, &BLACK)))?;
    let mut chart = ChartBuilder::on(area)
        .margin_top(60)
        .margin_right(40)
        .margin_bottom(30)
        .margin_left(10)
        .set_label_area_size(LabelAreaPosition::Left, 60)
        .set_label_area_size(LabelAreaPosition::Bottom, 30)
        .build_cartesian_2d((from_ms..to_ms).log_scale(), 0.0..worst * 1.15)?;
    chart
        .configure_mesh()
        .light_line_style(RGBColor(244, 244, 244))
        .bold_line_style(RGBColor(220, 220, 220))
        .disable_x_mesh()
        .x_labels(0)
        .x_label_formatter(&|_| String::new())
        .y_label_formatter(&|levels| if worst < 8.0 { format!("{levels:.1}") } else { format!("{levels:.0}") })
        .label_style(text(Pos::new(HPos::Center, VPos::Center), &BLACK))
        .draw()?;
    for ms in ticks(from_ms, to_ms) {
        chart.draw_series([PathElement::new(vec![(ms, 0.0), (ms, worst * 1.15)], RGBColor(228, 228, 228))])?;
        let (x, y) = chart.as_coord_spec().translate(&(ms, 0.0));
        area.draw(&Text::new(format!("{ms}"), (x, y + 12), text(Pos::new(HPos::Center, VPos::Center), &BLACK)))?;
    }
    let grey = RGBColor(130, 130, 130);
    for (row, (ms, name)) in PAPER.into_iter().enumerate() {
        chart.draw_series([PathElement::new(vec![(ms, 0.0), (ms, worst * 1.15)], grey)])?;
        let at = (ms * 1.02, worst * (1.12 - 0.04 * row as f64));
        chart.draw_series([Text::new(name, at, text(from_left, &grey))])?;
    }
    let mut front: Vec<&Point> = drawn.iter().copied().filter(|p| p.on_front).collect();
    front.sort_by(|a, b| a.time.median_ms.total_cmp(&b.time.median_ms));
    let path: Vec<_> = front.iter().map(|p| (p.time.median_ms, p.error.seen.whole)).collect();
    chart.draw_series([PathElement::new(path, BLACK.stroke_width(2))])?;
    let mut sweeps: Vec<&str> = Vec::new();
    let mut names = Vec::new();
    // Area of the legend.
    let mut taken = vec![[SIZE.0 as i32 - 260, 75, SIZE.0 as i32, 100 + 22 * 8]];
    for point in &drawn {
        let known = sweeps.iter().position(|sweep| *sweep == point.sweep);
        let index = known.unwrap_or_else(|| {
            sweeps.push(&point.sweep);
            sweeps.len() - 1
        });
        let (at, colour) = ((point.time.median_ms, point.error.seen.whole), colour(index));
        let style = if point.error_is_noise { colour.stroke_width(1) } else { colour.filled() };
        let size = if point.on_front { 6 } else { 4 };
        // A thin line leads to this point from the point without all effects, or from the generator's raw frame.
        let is_led_to = point.knobs.all_effects || point.generator.is_some();
        let other = drawn.iter().find(|p| is_led_to && Some(&p.name) == point.against.as_ref());
        if let Some(other) = other {
            let from = (other.time.median_ms, other.error.seen.whole);
            chart.draw_series([PathElement::new(vec![from, at], colour)])?;
        }
        if point.knobs.all_effects {
            chart.draw_series([TriangleMarker::new(at, size + 2, colour.filled())])?;
            if point.error_is_noise {
                // Triangles can't be hollow: draw a smaller white one inside.
                chart.draw_series([TriangleMarker::new(at, size - 1, WHITE.filled())])?;
            }
        } else if point.generator.is_some() {
            chart.draw_series([EmptyElement::at(at) + square((0, 0), style)])?;
        } else {
            chart.draw_series([Circle::new(at, size, style)])?;
        }
        // A point that coincides with its neighbour within the noise gets no label.
        let apart = !(point.error_is_noise && point.time_is_noise);
        let named = point.on_front || point.generator.is_some() || point.sweep == "all effects";
        let marker = chart.as_coord_spec().translate(&at);
        taken.push(labels::marker(marker));
        // LQ, HQ and generators are placed first.
        let always = ["1x1", "32x3"].contains(&point.name.as_str());
        if apart && named || always {
            names.push((!always, point.generator.is_none(), marker, shown(&point.name)));
        }
    }
    names.sort_by_key(|name| (name.0, name.1));
    let names = names.into_iter().map(|(_, _, marker, name)| (marker, name)).collect();
    label(area, names, taken)?;
    legend(area, &sweeps)
}

/// Draws names next to their markers, clear of the rectangles `taken`. Names without a free position are left out.
fn label<B: DrawingBackend>(
    area: &DrawingArea<B, Shift>,
    names: Vec<((i32, i32), String)>,
    taken: Vec<[i32; 4]>,
) -> Result<(), DrawingAreaErrorKind<B::ErrorType>> {
    let from_left = Pos::new(HPos::Left, VPos::Center);
    let sizes: Vec<_> = names.iter().map(|(marker, name)| (*marker, text_size(name).0 as i32)).collect();
    let frame = [75, 60, SIZE.0 as i32 - 40, SIZE.1 as i32 - 65];
    for ((marker, name), position) in names.into_iter().zip(labels::positions(&sizes, taken, frame)) {
        let Some((x, y)) = position else { continue };
        if (y - marker.1).abs() > TEXT as i32 {
            // A label far from its marker gets a line to it.
            let end = if x > marker.0 { x } else { marker.0 - 9 };
            area.draw(&PathElement::new(vec![marker, (end, y)], RGBColor(190, 190, 190)))?;
        }
        area.draw(&Text::new(name, (x, y), text(from_left, &BLACK)))?;
    }
    Ok(())
}

/// Text style with a colour and an anchor.
fn text(anchor: Pos, colour: &RGBColor) -> TextStyle<'static> {
    ("sans-serif", TEXT).into_font().color(colour).pos(anchor)
}

/// Draws the legend, with one entry per sweep (varied quality setting), and the caption of the time axis.
fn legend<B: DrawingBackend>(
    area: &DrawingArea<B, Shift>,
    sweeps: &[&str],
) -> Result<(), DrawingAreaErrorKind<B::ErrorType>> {
    let from_left = Pos::new(HPos::Left, VPos::Center);
    let (width, height) = SIZE;
    for (row, sweep) in sweeps.iter().enumerate() {
        let y = 90 + 22 * row as i32;
        let at = (width as i32 - 250, y);
        if *sweep == "all effects" {
            area.draw(&TriangleMarker::new(at, 6, colour(row).filled()))?;
        } else if *sweep == "generator" {
            area.draw(&square(at, colour(row).filled()))?;
        } else {
            area.draw(&Circle::new(at, 4, colour(row).filled()))?;
        }
        area.draw(&Text::new((*sweep).to_owned(), (width as i32 - 235, y), text(from_left, &BLACK)))?;
    }
    let under =
        "time of a frame, ms (median). Black line: Pareto front. Hollow: error within the noise of its neighbour.";
    area.draw(&Text::new(under, (70, height as i32 - 15), text(from_left, &BLACK)))
}

/// Colour number `index` of a palette that colour-blind people can tell apart (Okabe and Ito 2008).
fn colour(index: usize) -> RGBColor {
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

/// Ticks at 1, 2 and 5 times each power of ten within `from`..`to`, ms; for a logarithmic axis.
fn ticks(from: f64, to: f64) -> impl Iterator<Item = f64> {
    let exponents = from.log10().floor() as i32..=to.log10().ceil() as i32;
    let all =
        exponents.flat_map(|e| [1.0, 2.0, 5.0].map(|n| if e < 0 { n / 10f64.powi(-e) } else { n * 10f64.powi(e) }));
    all.filter(move |ms| (from..to).contains(ms))
}

/// Marker of a generator.
fn square((x, y): (i32, i32), style: ShapeStyle) -> Rectangle<(i32, i32)> {
    Rectangle::new([(x - 6, y - 6), (x + 6, y + 6)], style)
}

/// Image that `plotters` draws on.
struct Raster {
    image: RgbImage,
}

impl DrawingBackend for &mut Raster {
    type ErrorType = Infallible;

    fn get_size(&self) -> (u32, u32) {
        self.image.dimensions()
    }

    fn ensure_prepared(&mut self) -> Result<(), DrawingErrorKind<Infallible>> {
        Ok(())
    }

    fn present(&mut self) -> Result<(), DrawingErrorKind<Infallible>> {
        Ok(())
    }

    fn draw_pixel(&mut self, (x, y): BackendCoord, colour: BackendColor) -> Result<(), DrawingErrorKind<Infallible>> {
        let (Ok(x), Ok(y)) = (u32::try_from(x), u32::try_from(y)) else { return Ok(()) };
        if let Some(pixel) = self.image.get_pixel_mut_checked(x, y) {
            let (r, g, b) = colour.rgb;
            for (below, above) in pixel.0.iter_mut().zip([r, g, b]) {
                let mixed = f64::from(*below) * (1.0 - colour.alpha) + f64::from(above) * colour.alpha;
                *below = mixed.round() as u8;
            }
        }
        Ok(())
    }

    fn draw_text<S: BackendTextStyle>(
        &mut self,
        text: &str,
        style: &S,
        (x, y): BackendCoord,
    ) -> Result<(), DrawingErrorKind<Infallible>> {
        let (width, height) = text_size(text);
        let left = match style.anchor().h_pos {
            HPos::Left => x,
            HPos::Center => x - width as i32 / 2,
            HPos::Right => x - width as i32,
        };
        let top = match style.anchor().v_pos {
            VPos::Top => y,
            VPos::Center => y - height as i32 / 2,
            VPos::Bottom => y - height as i32,
        };
        let colour = style.color();
        for (column, c) in text.chars().enumerate() {
            let c = if (' '..='~').contains(&c) { c } else { '?' };
            let Some(glyph) = get_raster(c, FontWeight::Regular, RasterHeight::Size16) else { continue };
            let left = left + (column * glyph.width()) as i32;
            for (row, coverages) in (top..).zip(glyph.rows()) {
                for (column, &coverage) in (left..).zip(coverages.iter()) {
                    let alpha = colour.alpha * f64::from(coverage) / 255.0;
                    self.draw_pixel((column, row), BackendColor { alpha, ..colour })?;
                }
            }
        }
        Ok(())
    }

    fn estimate_text_size<S: BackendTextStyle>(
        &self,
        text: &str,
        _: &S,
    ) -> Result<(u32, u32), DrawingErrorKind<Infallible>> {
        Ok(text_size(text))
    }
}

fn text_size(text: &str) -> (u32, u32) {
    let glyph = get_raster_width(FontWeight::Regular, RasterHeight::Size16) as u32;
    (glyph * text.chars().count() as u32, TEXT)
}

#[cfg(test)]
mod tests {
    use super::super::effect_error::tests::effects;
    use super::super::point::mark_front;
    use super::super::point::tests::point;
    use super::*;

    fn points() -> Vec<Point> {
        let mut points =
            vec![point("1x1", 41.0, 30.0, None), point("8x3", 300.0, 12.0, None), point("32x3", 1500.0, 5.0, None)];
        points.push(Point { sweep: "samples".into(), error_is_noise: true, ..point("slow", 900.0, 25.0, None) });
        let mut all = Point { sweep: "all effects".into(), ..point("1x1 all effects", 80.0, 30.0, Some("1x1")) };
        all.knobs.all_effects = true;
        points.push(all);
        for (name, ms, error) in [("1x1 + msa", 70.0, 6.0), ("maps + fast", 50.0, 28.0)] {
            let generator = Some(name.to_owned());
            points.push(Point { generator, sweep: "generator".into(), ..point(name, ms, error, Some("1x1")) });
        }
        mark_front(&mut points);
        points
    }

    fn figure<'a>(points: &'a [Point], effects: &'a [EffectError], converged: bool) -> Figure<'a> {
        Figure { points, effects, title: "A scene", converged }
    }

    #[test]
    fn ticks_are_ones_twos_and_fives() {
        assert_eq!(ticks(15.0, 120.0).collect::<Vec<_>>(), [20.0, 50.0, 100.0]);
        assert_eq!(ticks(0.3, 10.0).collect::<Vec<_>>(), [0.5, 1.0, 2.0, 5.0]);
        let text = svg(&figure(&points(), &[], true)).unwrap();
        assert!(!text.contains("100.0"), "an axis of two kinds of labels: {text}");
        for ms in ["50", "100", "200", "500", "1000", "2000"] {
            assert!(text.contains(&format!(">\n{ms}\n<")), "{ms} ms has no tick: {text}");
        }
    }

    #[test]
    fn both_figures_name_what_they_show() {
        let (points, effects) = (points(), effects());
        let text = svg(&figure(&points, &effects, true)).unwrap();
        assert!(text.contains("<polygon") && text.contains("the converged reference"), "{text}");
        assert!(svg(&figure(&points, &[], false)).unwrap().contains("NOT converged"));
        for word in [
            "A scene",
            "1x1 (LQ)",
            "32x3 (HQ)",
            "2080 Ti: LQ 40 ms",
            "2080 Ti: HQ 75 ms",
            "samples",
            "Pareto",
            "1x1 (LQ), all effects",
            "1x1 + msa",
            "maps + fast",
            "speed_displacement",
            "18.2 dB",
            "no time",
        ] {
            assert!(text.contains(word), "`{word}` is missing");
        }
        // Squares of this size: two generators and their legend entry.
        let squares = text.matches(r#"width="12" height="12""#).count();
        assert_eq!(squares, 3, "{text}");
        assert!(text.starts_with("<svg") && text.trim_end().ends_with("</svg>"));
        let (width, height, pixels) = rgb(&figure(&points, &effects, true)).unwrap();
        assert_eq!((width, height), (1200, 800 + panel::height(&effects)));
        assert_eq!(pixels.len(), (3 * width * height) as usize);
        let ink = pixels.chunks_exact(3).filter(|p| p.iter().all(|&v| v < 128)).count();
        assert!(ink > 3000, "{ink}");
        // Colour of the first sweep.
        assert!(pixels.chunks_exact(3).any(|p| p == [0, 114, 178]));
    }

    #[test]
    fn no_points_and_broken_points_are_drawn_without_a_word() {
        assert!(svg(&figure(&[], &[], true)).is_ok() && rgb(&figure(&[], &[], false)).is_ok());
        let broken = [point("x", f64::NAN, f64::NAN, None), point("y", 0.0, 1.0, None)];
        let mut effects = effects();
        (effects[0].error.with, effects[0].error.without) = (f64::NAN, 0.0);
        assert!(rgb(&figure(&broken, &effects, true)).is_ok());
    }
}
