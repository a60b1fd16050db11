//! Page about a scored session: one HTML file with embedded pictures, light or dark by the reader's preference.

mod charts;
mod section;

use std::fmt::Write as _;
use std::path::Path;

use super::html::{escape, head};
use crate::exam::score::{Measure, PlaneScore, Reference, Score, Track};
use crate::sink::{SinkError, write_text};

const STYLE: &str = include_str!("style.css");

/// Writes the page about `score` to `path`; `title` names the session.
///
/// # Errors
/// The file cannot be written.
pub fn write(
    path: &Path,
    title: &str,
    score: &Score,
    track: &Track,
    reference: &Reference<'_>,
) -> Result<(), SinkError> {
    write_text(path, &page(title, score, track, reference))
}

/// The page. Writing to a string cannot fail.
fn page(title: &str, score: &Score, track: &Track, reference: &Reference<'_>) -> String {
    let title = escape(title);
    let mut out = head(&title, STYLE) + &format!("<h1>{title}</h1>\n");
    let _ = writeln!(
        out,
        "<p class=\"lead\"><b>{:.0}</b> of 100 points · <b>{} of {}</b> planes found · {:.1} s · {:.0} mm of way at {:.0} \
         mm/s · {:.0} % of the time on the skin, with {:.0} % of the face</p>",
        score.points,
        score.found,
        score.planes.len(),
        score.duration_s,
        score.path_mm,
        score.mean_speed_mm_s,
        100.0 * score.contact,
        100.0 * score.face_contact
    );
    let planes = || score.planes.iter().zip(&reference.planes).zip(&track.offsets);
    out.push_str(&table(score));
    out.push_str("<h2>Where the probe went</h2>\n<div class=\"row\">");
    out.push_str(&charts::ways(track, reference));
    out.push_str("</div>\n");
    for ((result, plane), offsets) in planes() {
        let found = match result.find_s {
            Some(s) => format!("<span class=\"good\">found at {s:.1} s</span>"),
            None => "<span class=\"bad\">not found</span>".to_owned(),
        };
        let _ = writeln!(out, "<section><h2>{} {found}</h2>", escape(&plane.title));
        out.push_str(&charts::deviations(plane, offsets, track, result));
        out.push_str(&section::pair(plane, result, reference));
        out.push_str(&measures(&result.measures));
        out.push_str("</section>\n");
    }
    if !score.calipers.is_empty() {
        out.push_str(
            "<h2>What the session measured</h2><table><tr><th>measure<th>at<th>measured<th>truly<th>error</tr>",
        );
        for c in &score.calipers {
            let _ = write!(
                out,
                "<tr><td>{}<td>{:.1} s<td>{:.1} mm<td>{}<td>{}</tr>",
                escape(&c.name),
                c.time_s,
                c.measured_mm,
                or_dash(c.true_mm, 1, " mm"),
                error(c.error_percent)
            );
        }
        out.push_str("</table>\n");
    }
    out.push_str("</body></html>\n");
    out
}

fn table(score: &Score) -> String {
    let mut out = "<table><tr><th>plane<th>found at<th>way until then<th>held<th>angle off<th>distance off<th>unsteady\
                   <th>pressed<th>points</tr>"
        .to_owned();
    for p in &score.planes {
        let PlaneScore { name, view, .. } = p;
        let view = if view.is_empty() { String::new() } else { format!(" ({view})") };
        let _ = write!(
            out,
            "<tr class=\"{}\"><td>{}{}<td>{}<td>{}<td>{:.1} s<td>{}<td>{}<td>{}<td>{}<td>{:.0}</tr>",
            if p.found { "found" } else { "missed" },
            escape(name),
            escape(&view),
            p.find_s.map_or_else(|| "no".to_owned(), |s| format!("{s:.1} s")),
            or_dash(p.path_to_find_mm, 0, " mm"),
            p.longest_hold_s,
            or_dash(p.best.map(|b| b.angle_deg), 1, "°"),
            or_dash(p.best.map(|b| b.distance_mm), 1, " mm"),
            or_dash(p.unsteady_mm, 2, " mm"),
            or_dash(p.press_mm, 1, " mm"),
            p.points
        );
    }
    out + "</table>\n<p class=\"note\">Angle, distance, steadiness and pressure are those of the best second.</p>\n"
}

fn measures(measures: &[Measure]) -> String {
    if measures.is_empty() {
        return String::new();
    }
    let mut out = "<table><tr><th>measure<th>at the best moment<th>truly<th>error</tr>".to_owned();
    for m in measures {
        let measured = m.measured_mm.map_or_else(|| "not in view".to_owned(), |mm| format!("{mm:.1} mm"));
        let _ = write!(
            out,
            "<tr><td><b>{}</b> {}<td>{measured}<td>{}<td>{}</tr>",
            escape(&m.name),
            escape(&m.title),
            or_dash(m.true_mm, 1, " mm"),
            error(m.error_percent)
        );
    }
    out + "</table>\n"
}

fn or_dash(value: Option<f64>, digits: usize, unit: &str) -> String {
    value.map_or_else(|| "–".to_owned(), |v| format!("{v:.digits$}{unit}"))
}

fn error(percent: Option<f64>) -> String {
    percent.map_or_else(|| "–".to_owned(), |e| format!("{e:+.1} %"))
}
