//! Report of a mark, as a line of text and as JSON.

use insonify_core::settings::MarkContent;
use serde::Serialize;

use super::caliper::CaliperEvent;
use super::marks::RecordedMark;

/// Properties of a mark, for a line of text and for JSON.
#[derive(Debug, Clone, PartialEq, Serialize)]
pub struct MarkReport {
    /// Time of the mark's last change, s from the start.
    pub time_s: f64,
    /// Time of the marked picture, s from the start.
    pub picture_s: f64,
    /// Number of the marked frame in its session, if the mark names a frame.
    #[serde(skip_serializing_if = "Option::is_none")]
    pub frame: Option<u64>,
    /// `distance`, `angle`, `ellipse`, `text` or `body_mark`.
    pub kind: &'static str,
    /// Name of the measure, name of the body mark, or the text itself.
    pub text: String,
    /// Value of a measurement, in `unit`; `None` for other marks.
    #[serde(skip_serializing_if = "Option::is_none")]
    pub value: Option<f64>,
    /// `mm` or `deg`; `None` without a value.
    #[serde(skip_serializing_if = "Option::is_none")]
    pub unit: Option<&'static str>,
    /// Area of an ellipse, mm²; `None` for other marks.
    #[serde(skip_serializing_if = "Option::is_none")]
    pub area_mm2: Option<f64>,
    /// Points, (x, z) of the probe frame, mm.
    #[serde(skip_serializing_if = "Vec::is_empty")]
    pub points_mm: Vec<[f64; 2]>,
    /// Turn of the probe on a body mark, degrees; `None` for other marks.
    #[serde(skip_serializing_if = "Option::is_none")]
    pub turn_deg: Option<f64>,
}

impl MarkReport {
    /// Report of `mark` in a session that began at `start_ns`.
    pub fn new(mark: &RecordedMark, start_ns: u64) -> Self {
        let seconds = |time_ns: u64| (i128::from(time_ns) - i128::from(start_ns)) as f64 * 1e-9;
        let report = Self {
            time_s: seconds(mark.host_time_ns),
            picture_s: seconds(mark.picture_time_ns()),
            frame: mark.frame.map(|frame| frame.number),
            kind: mark.content.kind(),
            text: String::new(),
            value: None,
            unit: None,
            area_mm2: None,
            points_mm: Vec::new(),
            turn_deg: None,
        };
        if let Some(caliper) = CaliperEvent::of(&mark.content) {
            let ((value, unit), area_mm2) = (caliper.value(), caliper.area_mm2());
            let CaliperEvent { measure: text, points_mm } = caliper;
            return Self { text, points_mm, value: Some(value), unit: Some(unit), area_mm2, ..report };
        }
        match &mark.content {
            MarkContent::Text { text, at_mm } => Self { text: text.clone(), points_mm: vec![*at_mm], ..report },
            MarkContent::BodyMark { name, turn_deg } => {
                Self { text: name.clone(), turn_deg: Some(*turn_deg), ..report }
            }
            _ => report,
        }
    }
}

impl std::fmt::Display for MarkReport {
    fn fmt(&self, f: &mut std::fmt::Formatter<'_>) -> std::fmt::Result {
        write!(f, "{:9.3} s  ", self.picture_s)?;
        match (self.kind, self.value) {
            ("text", _) => write!(f, "text \"{}\"", self.text)?,
            ("body_mark", _) => {
                write!(f, "body mark {}, probe turned by {:.0}°", self.text, self.turn_deg.unwrap_or_default())?;
            }
            (kind, value) => {
                let unit = if self.unit == Some("deg") { "°" } else { " mm" };
                let name = if self.text.is_empty() { kind } else { self.text.as_str() };
                write!(f, "{name} {:.1}{unit}", value.unwrap_or_default())?;
                if let Some(area_mm2) = self.area_mm2 {
                    write!(f, ", {:.2} cm²", 0.01 * area_mm2)?;
                }
            }
        }
        self.frame.map_or(Ok(()), |frame| write!(f, "  (frame {frame})"))
    }
}

#[cfg(test)]
mod tests {
    use super::*;

    #[test]
    fn a_line_says_when_what_and_how_much() {
        let line = |content: MarkContent| {
            let mark = RecordedMark { id: None, host_time_ns: 1_500_000_000, frame: None, content };
            MarkReport::new(&mark, 1_000_000_000).to_string()
        };
        let caliper = |measure: &str, points_mm: &[[f64; 2]]| {
            CaliperEvent { measure: measure.into(), points_mm: points_mm.to_vec() }.content().unwrap()
        };
        assert_eq!(line(caliper("BPD", &[[0.0, 1.0], [90.0, 1.0]])), "    0.500 s  BPD 90.0 mm");
        assert_eq!(line(caliper("", &[[0.0, 1.0], [0.0, 0.0], [1.0, 0.0]])), "    0.500 s  angle 90.0°");
        let circle = [[-10.0, 0.0], [10.0, 0.0], [0.0, -10.0], [0.0, 10.0]];
        assert_eq!(line(caliper("AC", &circle)), "    0.500 s  AC 62.8 mm, 3.14 cm²");
        let text = MarkContent::Text { text: "four chambers".into(), at_mm: [0.0; 2] };
        assert_eq!(line(text), "    0.500 s  text \"four chambers\"");
        let turned = MarkContent::BodyMark { name: "abdomen".into(), turn_deg: 30.0 };
        assert_eq!(line(turned), "    0.500 s  body mark abdomen, probe turned by 30°");
    }
}
