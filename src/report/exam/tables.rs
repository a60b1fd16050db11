//! Tables of the page. On a narrow screen each row becomes a block, and each cell shows the name of its column.

use std::fmt::Write as _;

use crate::exam::score::{CaliperScore, Measure, NO_PLANE, PlaneScore, Score, TextScore};
use crate::report::html::escape;

/// An HTML table with the names of its columns.
pub(super) struct Table<const N: usize> {
    columns: [&'static str; N],
    out: String,
}

impl<const N: usize> Table<N> {
    pub(super) fn new(columns: [&'static str; N]) -> Self {
        let heads = columns.map(|name| format!("<th>{name}")).concat();
        Self { columns, out: format!("<table><thead><tr>{heads}</tr></thead><tbody>") }
    }

    /// Adds a row; its cells are markup.
    pub(super) fn row(&mut self, class: &str, cells: [String; N]) {
        let _ = write!(self.out, "<tr class=\"{class}\">");
        for (name, cell) in self.columns.iter().zip(cells) {
            let _ = write!(self.out, "<td data-name=\"{name}\">{cell}");
        }
        self.out.push_str("</tr>");
    }

    pub(super) fn end(self) -> String {
        self.out + "</tbody></table>\n"
    }
}

/// Table of the scores of all planes.
pub(super) fn planes(score: &Score) -> String {
    let mut table = Table::new([
        "plane",
        "found at",
        "way until then",
        "held",
        "angle off",
        "distance off",
        "unsteady",
        "pressed",
        "points",
    ]);
    for p in &score.planes {
        let PlaneScore { name, view, .. } = p;
        let view = if view.is_empty() { String::new() } else { format!(" ({view})") };
        let judged = p.best_s.map(|_| p.points);
        let not_found = if judged.is_some() { "no" } else { "–" };
        let cells = [
            escape(&(name.clone() + &view)),
            p.find_s.map_or_else(|| not_found.to_owned(), |s| format!("{s:.1} s")),
            or_dash(p.path_to_find_mm, 0, " mm"),
            format!("{:.1} s", p.longest_hold_s),
            or_dash(p.best.map(|b| b.angle_deg), 1, "°"),
            or_dash(p.best.map(|b| b.distance_mm), 1, " mm"),
            or_dash(p.unsteady_mm, 2, " mm"),
            or_dash(p.press_mm, 1, " mm"),
            or_dash(judged, 0, ""),
        ];
        table.row(if p.found { "found" } else { "missed" }, cells);
    }
    table.end() + "<p class=\"note\">Angle, distance, steadiness and pressure are those of the best second.</p>\n"
}

/// Table of measurements that the score makes at the best moment of a plane.
pub(super) fn measures(measures: &[Measure]) -> String {
    if measures.is_empty() {
        return String::new();
    }
    let mut table = Table::new(["measure", "at the best moment", "truly", "error"]);
    for m in measures {
        let cells = [
            format!("<b>{}</b> {}", escape(&m.name), escape(&m.title)),
            m.measured_mm.map_or_else(|| "not in view".to_owned(), |mm| format!("{mm:.1} mm")),
            or_dash(m.true_mm, 1, " mm"),
            percent(m.error_percent),
        ];
        table.row("", cells);
    }
    table.end()
}

/// Table of measurements made in the session itself.
pub(super) fn calipers(calipers: &[CaliperScore]) -> String {
    if calipers.is_empty() {
        return String::new();
    }
    let mut table = Table::new(["measure", "picture", "shows", "measured", "truly", "error"]);
    for c in calipers {
        let measured = match (c.measured_mm, c.angle_deg) {
            (Some(mm), _) => format!("{mm:.1} mm"),
            (None, angle_deg) => or_dash(angle_deg, 1, "°"),
        };
        let area = c.area_mm2.map_or_else(String::new, |mm2| format!(", {:.2} cm²", 0.01 * mm2));
        let error = match (c.error_mm, c.note.is_empty()) {
            (Some(mm), _) => format!("{mm:+.1} mm, {}", percent(c.error_percent)),
            (None, true) => "–".to_owned(),
            (None, false) => escape(&c.note),
        };
        let cells = [
            escape(if c.name.is_empty() { c.kind.name() } else { &c.name }),
            format!("{:.1} s", c.picture_s),
            escape(c.plane.as_deref().unwrap_or(NO_PLANE)),
            measured + &area,
            or_dash(c.true_mm, 1, " mm"),
            error,
        ];
        table.row("", cells);
    }
    "<h2>What the session measured</h2>".to_owned() + &table.end()
}

/// Table of the session's texts and body marks.
pub(super) fn texts(texts: &[TextScore]) -> String {
    if texts.is_empty() {
        return String::new();
    }
    let mut table = Table::new(["text or body mark", "picture", "shows"]);
    for text in texts {
        let turned = text.turn_deg.map_or_else(String::new, |deg| format!(" (body mark, probe turned by {deg:.0}°)"));
        let cells = [
            escape(&text.text) + &turned,
            format!("{:.1} s", text.picture_s),
            escape(text.plane.as_deref().unwrap_or(NO_PLANE)),
        ];
        table.row("", cells);
    }
    "<h2>What the session wrote</h2>".to_owned() + &table.end()
}

fn or_dash(value: Option<f64>, digits: usize, unit: &str) -> String {
    value.map_or_else(|| "–".to_owned(), |v| format!("{v:.digits$}{unit}"))
}

fn percent(percent: Option<f64>) -> String {
    percent.map_or_else(|| "–".to_owned(), |e| format!("{e:+.1} %"))
}

#[cfg(test)]
mod tests {
    use super::*;
    use crate::recording::MeasureKind;

    #[test]
    fn each_cell_names_its_column_and_texts_of_the_session_are_escaped() {
        let caliper = CaliperScore {
            time_s: 3.0,
            picture_s: 2.5,
            plane: Some("head".into()),
            name: "<b>BPD".into(),
            kind: MeasureKind::Distance,
            measured_mm: Some(55.0),
            angle_deg: None,
            area_mm2: None,
            axes_mm: None,
            true_mm: Some(50.0),
            error_mm: Some(5.0),
            error_percent: Some(10.0),
            note: String::new(),
        };
        let angle = CaliperScore { measured_mm: None, angle_deg: Some(33.0), error_mm: None, ..caliper.clone() };
        let html = calipers(&[caliper, angle]);
        assert_eq!(html.matches("<td").count(), html.matches("<td data-name=\"").count());
        for part in ["&lt;b&gt;BPD", "data-name=\"error\">+5.0 mm, +10.0 %", "33.0°", "data-name=\"shows\">head"] {
            assert!(html.contains(part), "{part}: {html}");
        }
        let text = TextScore { picture_s: 1.0, plane: None, text: "<script>".into(), turn_deg: None };
        let html = texts(&[text]);
        assert!(html.contains("&lt;script&gt;") && html.contains("no standard plane in this picture"), "{html}");
        assert!(calipers(&[]).is_empty() && texts(&[]).is_empty());
    }
}
