//! Charts of a session: deviations over time, and the probe's path over the scene.

use std::fmt::Write;

use glam::DVec3;

use crate::anatomy::planes::StandardPlane;
use crate::exam::offset::Offset;
use crate::exam::score::{HOLD_S, PlaneScore, Reference, Track};
use crate::report::html::{escape, points as svg_points};

/// Largest number of points of a line; a screen shows no more.
const POINTS_MAX: usize = 900;

/// Largest deviation that is drawn, as a multiple of the tolerance. Larger ones are drawn at this value.
const TOP: f64 = 4.0;

/// Size and margins in units of the picture. Texts are 12 to 22 units high (style.css).
const WIDTH: f64 = 720.0;
const HEIGHT: f64 = 170.0;
const LEFT: f64 = 28.0;
const BOTTOM: f64 = 26.0;

/// Deviations in angle and distance over time, as multiples of their tolerances. The plane is found within the band
/// up to 1.
pub(super) fn deviations(plane: &StandardPlane, offsets: &[Offset], track: &Track, result: &PlaneScore) -> String {
    let end_s = track.time_s.last().copied().unwrap_or(0.0).max(1e-3);
    let x = |t: f64| LEFT + (WIDTH - LEFT) * t / end_s;
    let y = |v: f64| (HEIGHT - BOTTOM) * (1.0 - v.min(TOP) / TOP);
    let t = &plane.tolerances;
    let mut out = format!(
        "<figure><figcaption>Off the plane over time, in tolerances\
         <span class=\"key\" style=\"background:var(--a)\"></span>angle (1 = {}°)\
         <span class=\"key\" style=\"background:var(--d)\"></span>distance (1 = {} mm)\
         <span class=\"key\" style=\"background:var(--off);height:10px\"></span>off the skin\
         <span class=\"key\" style=\"background:var(--good)\"></span>best second</figcaption>\
         <svg class=\"chart\" viewBox=\"0 0 {WIDTH} {HEIGHT}\">",
        t.angle_deg, t.distance_mm
    );
    for (from, to) in off_skin(track) {
        let (from, to) = (x(from), x(to));
        let _ = write!(
            out,
            "<rect class=\"offskin\" x=\"{from:.1}\" y=\"0\" width=\"{:.1}\" height=\"{}\"/>",
            (to - from).max(0.5),
            HEIGHT - BOTTOM
        );
    }
    let _ = write!(
        out,
        "<rect class=\"band\" x=\"{LEFT}\" y=\"{:.1}\" width=\"{}\" height=\"{:.1}\"/>",
        y(1.0),
        WIDTH - LEFT,
        y(0.0) - y(1.0)
    );
    for value in [0.0, 1.0, 2.0, 3.0, 4.0] {
        let _ = write!(
            out,
            "<line class=\"axis\" x1=\"{LEFT}\" x2=\"{WIDTH}\" y1=\"{0:.1}\" y2=\"{0:.1}\"/>\
             <text x=\"{1}\" y=\"{2:.1}\" text-anchor=\"end\">{value}</text>",
            y(value),
            LEFT - 6.0,
            y(value) + if value == TOP { 14.0 } else { 5.0 }
        );
    }
    for i in 0..=4 {
        let t = end_s * f64::from(i) / 4.0;
        let anchor = if i == 4 { "end" } else { "middle" };
        let _ = write!(out, "<text x=\"{:.1}\" y=\"{}\" text-anchor=\"{anchor}\">{t:.0} s</text>", x(t), HEIGHT - 4.0);
    }
    if let Some(best_s) = result.best_s {
        let _ = write!(
            out,
            "<line class=\"best\" x1=\"{:.1}\" x2=\"{:.1}\" y1=\"{2:.1}\" y2=\"{2:.1}\"/>",
            x(best_s),
            x(best_s + HOLD_S),
            y(0.0)
        );
    }
    let step = offsets.len().div_ceil(POINTS_MAX).max(1);
    let mut line = |class: &str, value: &dyn Fn(&Offset) -> f64| {
        let shown = offsets.iter().zip(&track.time_s).step_by(step);
        let all = svg_points(shown.map(|(offset, &t)| (x(t), y(value(offset)))));
        let _ = write!(out, "<polyline class=\"line {class}\" points=\"{all}\"/>");
    };
    line("distance", &|o| o.distance_mm / t.distance_mm);
    line("angle", &|o| o.angle_deg / t.angle_deg);
    out + "</svg></figure>\n"
}

/// Intervals in which the probe was off the skin, s.
fn off_skin(track: &Track) -> Vec<(f64, f64)> {
    let mut spans: Vec<(f64, f64)> = Vec::new();
    let mut before = true;
    for (&t, &contact) in track.time_s.iter().zip(&track.contact) {
        match (before, contact, spans.last_mut()) {
            (true, false, _) => spans.push((t, t)),
            (false, _, Some((_, to))) => *to = t,
            _ => {}
        }
        before = contact;
    }
    spans
}

/// Path of the probe's face from two sides, coloured by time, with the positions from which planes are seen.
pub(super) fn paths(track: &Track, reference: &Reference<'_>) -> String {
    let sides = [("from the front", 0, 1, ["x", "y"]), ("from the feet", 0, 2, ["x", "z"])];
    let seen = |plane: &&StandardPlane| {
        let skin = reference.skin?;
        let view = plane.views.first()?;
        Some((plane.name.clone(), view.pose_on(skin, 0.0)?.position_mm))
    };
    let marks: Vec<(String, DVec3)> = reference.planes.iter().filter_map(seen).collect();
    sides.map(|(caption, i, j, names)| path(track, &marks, caption, (i, j), names)).concat()
}

fn path(track: &Track, marks: &[(String, DVec3)], caption: &str, (i, j): (usize, usize), names: [&str; 2]) -> String {
    /// Margin of the picture, and its smallest size, mm.
    const BORDER_MM: f64 = 18.0;
    const LEAST_MM: f64 = 60.0;
    // SVG's y axis points down, so the sign changes: up in the scene is up in the picture.
    let flat = |p: [f64; 3]| (p[i], -p[j]);
    let points: Vec<(f64, f64)> = track.position_mm.iter().map(|&p| flat(p)).collect();
    let all = || points.iter().copied().chain(marks.iter().map(|(_, p)| flat(p.to_array())));
    let range = |f: fn((f64, f64)) -> f64| {
        let (low, high) = all().map(f).fold((f64::MAX, f64::MIN), |(l, h), v| (l.min(v), h.max(v)));
        let pad = BORDER_MM + (0.5 * (LEAST_MM - (high - low))).max(0.0);
        (low - pad, high - low + 2.0 * pad)
    };
    let ((x, width), (y, height)) = (range(|p| p.0), range(|p| p.1));
    let mut out = format!("<figure><svg viewBox=\"{x:.1} {y:.1} {width:.1} {height:.1}\" style=\"max-height:420px\">");
    let step = points.len().div_ceil(POINTS_MAX).max(1);
    let thin: Vec<_> = points.iter().copied().step_by(step).collect();
    // Pieces of the path with one colour each, from blue at the start to orange at the end.
    let pieces = 48.min(thin.len().max(1));
    for piece in 0..pieces {
        let (first, last) = (piece * thin.len() / pieces, ((piece + 1) * thin.len() / pieces).min(thin.len() - 1));
        let hue = 215.0 + 170.0 * piece as f64 / pieces as f64;
        let all = svg_points(thin[first..=last.max(first)].iter().copied());
        let _ = write!(out, "<polyline class=\"line\" style=\"stroke:hsl({hue:.0} 70% 50%)\" points=\"{all}\"/>");
    }
    for (name, position) in marks {
        let (px, py) = flat(position.to_array());
        let _ = write!(
            out,
            "<circle class=\"mark\" cx=\"{px:.1}\" cy=\"{py:.1}\" r=\"{:.1}\"/>\
             <text style=\"font-size:{:.1}px\" x=\"{:.1}\" y=\"{py:.1}\">{}</text>",
            width / 150.0,
            width / 30.0,
            px + width / 80.0,
            escape(name)
        );
    }
    let [across, up] = names;
    let _ = write!(
        out,
        "</svg><figcaption>The middle of the probe's face {caption}: {across} to the right, {up} up, {width:.0} mm wide; \
         from blue over red to orange as time goes on; dots: where planes are seen from</figcaption></figure>"
    );
    out
}
