//! Figure of the cost curves, one panel each: time against the varied quantity, both on logarithmic axes.

use plotters::prelude::*;

use super::{Curve, Point, exponent};

const SIZE: (u32, u32) = (1260, 760);
const PANELS: (usize, usize) = (2, 3);
const COLOURS: [RGBColor; 4] =
    [RGBColor(213, 94, 0), RGBColor(0, 114, 178), RGBColor(0, 158, 115), RGBColor(204, 121, 167)];

/// The figure of the curves as SVG.
pub(super) fn svg(curves: &[Curve], title: &str) -> Result<String, String> {
    let mut text = String::new();
    draw(&SVGBackend::with_string(&mut text, SIZE).into_drawing_area(), curves, title).map_err(|e| e.to_string())?;
    Ok(text)
}

fn draw<'a, B: DrawingBackend>(
    area: &DrawingArea<B, plotters::coord::Shift>,
    curves: &'a [Curve],
    title: &str,
) -> Result<(), Box<dyn std::error::Error + 'a>>
where
    B::ErrorType: 'static,
{
    area.fill(&WHITE)?;
    area.draw(&Text::new(title.to_owned(), (16, 14), ("sans-serif", 15)))?;
    let (_, panels) = area.split_vertically(34);
    for (curve, panel) in curves.iter().zip(panels.split_evenly(PANELS)) {
        let frames = || curve.points.iter().map(|p| (p.x, p.total_ms));
        let (first, last) = (frames().next().unwrap_or((1.0, 1.0)).0, frames().next_back().unwrap_or((2.0, 1.0)).0);
        let most_ms = frames().map(|(_, ms)| ms).fold(1.0, f64::max);
        let exponent = exponent(&curve.points, |p| p.total_ms);
        // The range of times leaves room for labels above the curve.
        let mut chart = ChartBuilder::on(&panel)
            .caption(format!("{}: ms ~ n^{exponent:.2}", curve.name), ("sans-serif", 15))
            .margin(8)
            .set_label_area_size(LabelAreaPosition::Left, 52)
            .set_label_area_size(LabelAreaPosition::Bottom, 26)
            .build_cartesian_2d((first / 1.2..last * 1.2).log_scale(), (0.5..most_ms * 15.0).log_scale())?;
        let number = |n: &f64| if *n >= 1e4 { format!("{n:.0e}") } else { format!("{n}") };
        chart
            .configure_mesh()
            .light_line_style(WHITE)
            .bold_line_style(RGBColor(225, 225, 225))
            .x_label_formatter(&number)
            .y_label_formatter(&number)
            .draw()?;
        let mut passes: Vec<usize> = (0..curve.points.last().map_or(0, |p| p.passes.len())).collect();
        let at_most = |&pass: &usize| curve.points.iter().map(|p| p.passes[pass].1).fold(0.0, f64::max);
        passes.sort_by(|a, b| at_most(b).total_cmp(&at_most(a)));
        for (&pass, colour) in passes.iter().zip(COLOURS) {
            let line = curve.points.iter().map(move |p: &Point| (p.x, p.passes[pass].1.max(0.5)));
            let name = curve.points[0].passes[pass].0;
            chart
                .draw_series([PathElement::new(line.collect::<Vec<_>>(), colour)])?
                .label(name)
                .legend(move |(x, y)| PathElement::new([(x, y), (x + 16, y)], colour));
        }
        chart
            .draw_series([PathElement::new(frames().collect::<Vec<_>>(), BLACK.stroke_width(2))])?
            .label("frame")
            .legend(|(x, y)| PathElement::new([(x, y), (x + 16, y)], BLACK.stroke_width(2)));
        chart.draw_series(frames().map(|at| Circle::new(at, 3, BLACK.filled())))?;
        chart
            .configure_series_labels()
            .position(SeriesLabelPosition::UpperLeft)
            .label_font(("sans-serif", 12))
            .background_style(WHITE.mix(0.8))
            .draw()?;
    }
    area.present()?;
    Ok(())
}
