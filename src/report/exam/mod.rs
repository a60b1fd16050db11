//! Page about a scored session: one HTML file with embedded pictures, light or dark by the reader's preference.

mod charts;
mod needle;
mod section;
mod tables;

use std::fmt::Write as _;
use std::path::Path;

use super::html::{escape, head};
use crate::exam::score::{MisplacedTime, POINTS, Reference, Score, Track};
use crate::sink::{SinkError, write_text};

pub use needle::NeedleReport;

const STYLE: &str = include_str!("style.css");

/// Title and remarks on a session, in addition to its score.
#[derive(Debug, Clone, Copy)]
pub struct Heading<'a> {
    /// Name of the session.
    pub title: &'a str,
    /// Sentence that tells which planes count.
    pub note: &'a str,
    /// Sentences on what may make the score wrong: a damaged recording, another scene, refused settings.
    pub warnings: &'a [String],
}

/// A session scored against standard planes.
#[derive(Clone, Copy)]
pub struct PlanesReport<'a> {
    /// The score.
    pub score: &'a Score,
    /// Positions of the probe.
    pub track: &'a Track,
    /// Planes and surfaces.
    pub reference: &'a Reference<'a>,
}

/// Writes the page about a session to `path`: its planes, its needle, or both.
///
/// # Errors
/// The file cannot be written.
pub fn write(
    path: &Path,
    heading: Heading<'_>,
    planes: Option<PlanesReport<'_>>,
    needle: Option<NeedleReport<'_>>,
) -> Result<(), SinkError> {
    write_text(path, &page(heading, planes, needle))
}

/// Text of the page. Writing to a string cannot fail.
fn page(heading: Heading<'_>, planes: Option<PlanesReport<'_>>, needle: Option<NeedleReport<'_>>) -> String {
    let title = escape(heading.title);
    let mut out = head(&title, STYLE) + &format!("<h1>{title}</h1>\n");
    if let Some(PlanesReport { score, .. }) = planes {
        let _ = writeln!(
            out,
            "<p class=\"lead\">{} · {:.1}&nbsp;s · {:.0}&nbsp;mm of way at {:.0}&nbsp;mm/s · \
             {:.0}&nbsp;% of the time on the skin, with {:.0}&nbsp;% of the face</p>",
            mark(score),
            score.duration_s,
            score.path_mm,
            score.mean_speed_mm_s,
            100.0 * score.contact,
            100.0 * score.face_contact,
        );
    }
    // Options are marked as code, so that no option is broken at the end of a line.
    let note = escape(heading.note).replace("--planes", "<code>--planes</code>");
    let _ = writeln!(out, "<p class=\"note\">{note}</p>");
    out.push_str(&warned(heading.warnings));
    out.push_str(&planes.as_ref().map_or_else(String::new, |planes| faults(planes.score, planes.track)));
    out.push_str(&needle.as_ref().map_or_else(String::new, needle::section));
    out.push_str(&planes.as_ref().map_or_else(String::new, of_planes));
    out.push_str("</body></html>\n");
    out
}

/// Sections about the standard planes.
fn of_planes(PlanesReport { score, track, reference }: &PlanesReport<'_>) -> String {
    let planes = || score.planes.iter().zip(&reference.planes).zip(&track.offsets);
    let mut out = tables::planes(score);
    let _ = writeln!(out, "<p class=\"note\">{POINTS} {}</p>", escape(&reference.tolerances()));
    out.push_str(&tables::calipers(&score.calipers));
    out.push_str(&tables::texts(&score.texts));
    out.push_str("<section><h2>Where the probe went</h2>\n<div class=\"row\">");
    out.push_str(&charts::paths(track, reference));
    out.push_str("</div></section>\n");
    for ((result, plane), offsets) in planes() {
        let found = match result.find_s {
            Some(s) => format!("<span class=\"good\">found at {s:.1} s</span>"),
            None if result.best_s.is_none() => "<span class=\"bad\">not judged</span>".to_owned(),
            None => "<span class=\"bad\">not found</span>".to_owned(),
        };
        let _ = writeln!(out, "<section><h2>{} {found}</h2>", escape(&plane.title));
        if let Some(why) = &result.why_not {
            let _ = writeln!(out, "<p class=\"note\">Why not: {}.</p>", escape(why));
        }
        out.push_str(&charts::deviations(plane, offsets, track, result));
        out.push_str(&section::pair(plane, result, reference));
        out.push_str(&tables::measures(&result.measures));
        out.push_str("</section>\n");
    }
    out
}

/// Points and number of planes found, or a text that nothing was judged.
fn mark(score: &Score) -> String {
    match score.points {
        Some(points) => {
            format!("<b>{points:.0}</b> of 100 points · <b>{} of {}</b> planes found", score.found, score.planes.len())
        }
        None => "<b>not judged</b>".to_owned(),
    }
}

/// Warnings, as markup.
fn warned(warnings: &[String]) -> String {
    notes(warnings.iter().map(|warning| format!("Warning: {warning}.")))
}

/// Doubts about the score, as markup: nothing could be judged, impossible probe positions, and unreadable marks.
fn faults(score: &Score, track: &Track) -> String {
    let not_judged = score.not_judged.iter().map(|why| format!("Not judged: {why}."));
    let misplaced = MisplacedTime::of(track).map(|time| format!("Misplaced: {time}."));
    let refused = score.calipers_refused.iter().map(|reason| format!("Left out at {reason}."));
    notes(not_judged.chain(misplaced).chain(refused))
}

/// Paragraphs with these texts.
fn notes(texts: impl Iterator<Item = String>) -> String {
    texts.fold(String::new(), |mut out, text| {
        let _ = writeln!(out, "<p class=\"note\">{}</p>", escape(&text));
        out
    })
}

#[cfg(test)]
mod tests {
    use super::*;
    use crate::transducer::Misplacement;
    use crate::transducer::placement::{Cause, Fault};

    /// Track of three seconds with this placement.
    fn track(misplaced: Option<Misplacement>) -> Track {
        Track {
            time_s: (0..31).map(|i| 0.1 * f64::from(i)).collect(),
            position_mm: vec![[0.0; 3]; 31],
            contact: vec![true; 31],
            face: vec![1.0; 31],
            misplaced: vec![misplaced; 31],
            offsets: Vec::new(),
        }
    }

    #[test]
    fn the_page_tells_of_a_misplaced_probe_and_of_refused_marks() {
        let score = |refused: &[&str]| Score {
            points: Some(0.0),
            not_judged: None,
            found: 0,
            duration_s: 3.0,
            path_mm: 0.0,
            mean_speed_mm_s: 0.0,
            contact: 1.0,
            face_contact: 1.0,
            planes: Vec::new(),
            calipers: Vec::new(),
            texts: Vec::new(),
            calipers_refused: refused.iter().map(|&reason| reason.to_owned()).collect(),
        };
        assert_eq!(faults(&score(&[]), &track(None)), "");
        assert!(mark(&score(&[])).starts_with("<b>0</b> of 100 points"));
        let sparse = Score { points: None, not_judged: Some("only 3 poses".into()), ..score(&[]) };
        assert_eq!(mark(&sparse), "<b>not judged</b>");
        let html = faults(&sparse, &track(None));
        assert!(html.starts_with("<p class=\"note\">Not judged: only 3 poses.</p>\n"), "{html}");
        let html = warned(&["the file is <not> whole".to_owned()]);
        assert!(html.contains("<p class=\"note\">Warning: the file is &lt;not&gt; whole.</p>"), "{html}");
        let deep = Misplacement { fault: Fault::Deep { depth_mm: 83.0 }, likely: Some(Cause::Metres) };
        let html = faults(&score(&["2.00 s: the id <b>"]), &track(Some(deep)));
        assert_eq!(html.matches("<p class=\"note\">").count(), 2, "{html}");
        for part in
            ["Misplaced: for 3.0 s, from 0.0 s on", "83 mm deep", "times 1000", "Left out at 2.00 s: the id &lt;b&gt;."]
        {
            assert!(html.contains(part), "{part}: {html}");
        }
    }
}
