//! Page about a scored session: one HTML file with embedded pictures, light or dark by the reader's preference.

mod charts;
mod section;
mod tables;

use std::fmt::Write as _;
use std::path::Path;

use super::html::{escape, head};
use crate::exam::score::{Reference, Score, Track};
use crate::sink::{SinkError, write_text};

const STYLE: &str = include_str!("style.css");

/// Writes the page about `score` to `path`; `title` names the session, `note` says which planes count.
///
/// # Errors
/// The file cannot be written.
pub fn write(
    path: &Path,
    title: &str,
    note: &str,
    score: &Score,
    track: &Track,
    reference: &Reference<'_>,
) -> Result<(), SinkError> {
    write_text(path, &page(title, note, score, track, reference))
}

/// The page. Writing to a string cannot fail.
fn page(title: &str, note: &str, score: &Score, track: &Track, reference: &Reference<'_>) -> String {
    let title = escape(title);
    let mut out = head(&title, STYLE) + &format!("<h1>{title}</h1>\n");
    let _ = writeln!(
        out,
        "<p class=\"lead\"><b>{:.0}</b> of 100 points · <b>{} of {}</b> planes found · {:.1}&nbsp;s · {:.0}&nbsp;mm of way at {:.0}&nbsp;mm/s · \
         {:.0}&nbsp;% of the time on the skin, with {:.0}&nbsp;% of the face</p>\n<p class=\"note\">{}</p>",
        score.points,
        score.found,
        score.planes.len(),
        score.duration_s,
        score.path_mm,
        score.mean_speed_mm_s,
        100.0 * score.contact,
        100.0 * score.face_contact,
        // No option is cut at the end of a line.
        escape(note).replace("--planes", "<code>--planes</code>")
    );
    let planes = || score.planes.iter().zip(&reference.planes).zip(&track.offsets);
    out.push_str(&tables::planes(score));
    out.push_str(&tables::calipers(&score.calipers));
    out.push_str(&tables::texts(&score.texts));
    out.push_str("<section><h2>Where the probe went</h2>\n<div class=\"row\">");
    out.push_str(&charts::ways(track, reference));
    out.push_str("</div></section>\n");
    for ((result, plane), offsets) in planes() {
        let found = match result.find_s {
            Some(s) => format!("<span class=\"good\">found at {s:.1} s</span>"),
            None => "<span class=\"bad\">not found</span>".to_owned(),
        };
        let _ = writeln!(out, "<section><h2>{} {found}</h2>", escape(&plane.title));
        out.push_str(&charts::deviations(plane, offsets, track, result));
        out.push_str(&section::pair(plane, result, reference));
        out.push_str(&tables::measures(&result.measures));
        out.push_str("</section>\n");
    }
    out.push_str("</body></html>\n");
    out
}
