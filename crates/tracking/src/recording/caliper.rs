//! Caliper measurements, as events of a recording.
//!
//! A caliper is the event [`CALIPER_EVENT`] with the value `{"measure": "BPD", "points_mm": [[x, z], [x, z]]}`. Two
//! points give a length; three give an angle: end, corner, end; four give an ellipse: the ends of one axis, then of the
//! other. Points are (x, z) in the probe frame, mm: x to the right from the image's middle line, z down from the centre
//! of the probe's face. `measure` is the name of a standard plane's caliper, or free text.
//!
//! Calipers that were set on a live page also name their frame ([`Marks`](super::Marks)).

use insonify_core::settings::MarkContent;
use insonify_core::settings::mark::{COORDINATE_LIMIT_MM, NAME_CHARS_MAX, clean};
use serde::Serialize;

use super::Event;
use super::marked::Marked;

/// Name of the event.
pub const CALIPER_EVENT: &str = "caliper";

/// Correct form of the event's value.
const FORM: &str = r#"a caliper is {"measure": "BPD", "points_mm": [[x, z], [x, z]]}"#;

/// Largest number of characters that is read from a measure's name; longer names are cut.
const READ_CHARS_MAX: usize = 4 * NAME_CHARS_MAX;

/// A measurement in the image.
#[derive(Debug, Clone, PartialEq, Serialize)]
pub struct CaliperEvent {
    /// Name of the measure, for example `BPD`; may be empty.
    pub measure: String,
    /// Two, three or four points (x, z) of the probe frame, mm.
    pub points_mm: Vec<[f64; 2]>,
}

/// Kind of a measurement in the image.
#[derive(Debug, Clone, Copy, PartialEq, Eq, Serialize)]
#[serde(rename_all = "snake_case")]
pub enum MeasureKind {
    /// Distance between two points.
    Distance,
    /// Angle at a corner.
    Angle,
    /// Ellipse with circumference and area.
    Ellipse,
}

impl MeasureKind {
    /// Name in files and messages.
    pub fn name(self) -> &'static str {
        match self {
            Self::Distance => "distance",
            Self::Angle => "angle",
            Self::Ellipse => "ellipse",
        }
    }
}

impl CaliperEvent {
    /// Measurement of a mark; `None` for a text or a body mark.
    pub fn of(content: &MarkContent) -> Option<Self> {
        let measure = match content {
            MarkContent::Distance { measure, .. }
            | MarkContent::Angle { measure, .. }
            | MarkContent::Ellipse { measure, .. } => measure.clone(),
            MarkContent::Text { .. } | MarkContent::BodyMark { .. } => return None,
        };
        Some(Self { measure, points_mm: content.points_mm().to_vec() })
    }

    /// The measurement as content of a mark; `None` unless it has 2 to 4 points.
    pub(super) fn content(self) -> Option<MarkContent> {
        let Self { measure, points_mm } = self;
        match points_mm[..] {
            [a, b] => Some(MarkContent::Distance { measure, points_mm: [a, b] }),
            [a, b, c] => Some(MarkContent::Angle { measure, points_mm: [a, b, c] }),
            [a, b, c, d] => Some(MarkContent::Ellipse { measure, points_mm: [a, b, c, d] }),
            _ => None,
        }
    }

    /// Measurement and marked frame of `event`; `None` for other events.
    ///
    /// # Errors
    /// A caliper event with a malformed value; the text gives the fault and the correct form.
    pub(super) fn marked(event: &Event) -> Option<Result<(Self, Marked), String>> {
        (event.name == CALIPER_EVENT).then(|| {
            let mut value = event.value.clone().unwrap_or_default();
            let marked = Marked::take(&mut value, &["kind", "value", "unit", "area_mm2"])?;
            let read: Value = serde_json::from_value(value).map_err(|e| format!("{FORM}: {e}"))?;
            let measure = clean(&read.measure).chars().take(READ_CHARS_MAX).collect();
            let caliper = Self { measure, points_mm: read.points_mm };
            caliper.check()?;
            Ok((caliper, marked))
        })
    }

    fn check(&self) -> Result<(), String> {
        let count = self.points_mm.len();
        if !(2..=4).contains(&count) {
            return Err(format!(
                "a caliper has 2 points, 3 for an angle or 4 for an ellipse; this one has {count}. {FORM}"
            ));
        }
        let beyond = self.points_mm.iter().flatten().find(|x| !x.is_finite() || x.abs() > COORDINATE_LIMIT_MM);
        match beyond {
            Some(x) => Err(format!("a caliper's point is {x}; coordinates reach ±{COORDINATE_LIMIT_MM} mm")),
            None => Ok(()),
        }
    }

    /// Event of this measurement at `host_time_ns`.
    pub fn event(&self, host_time_ns: u64) -> Event {
        let value = serde_json::json!({ "measure": self.measure, "points_mm": self.points_mm });
        Event::new(host_time_ns, CALIPER_EVENT).with(value)
    }

    /// Kind of the measurement, by the number of its points.
    pub fn kind(&self) -> MeasureKind {
        match self.points_mm.len() {
            2 => MeasureKind::Distance,
            3 => MeasureKind::Angle,
            _ => MeasureKind::Ellipse,
        }
    }

    /// Length of the line, or circumference of the ellipse (Ramanujan's second approximation), mm; `None` for an angle.
    pub fn length_mm(&self) -> Option<f64> {
        match (self.kind(), &self.points_mm[..]) {
            (MeasureKind::Distance, [a, b]) => Some(distance(*a, *b)),
            _ => self.axes_mm().map(|[a, b]| ellipse_circumference_mm(0.5 * a, 0.5 * b)),
        }
    }

    /// Axes of the ellipse, mm; `None` for other measurements.
    pub fn axes_mm(&self) -> Option<[f64; 2]> {
        let [a, b, c, d] = self.points_mm[..] else { return None };
        Some([distance(a, b), distance(c, d)])
    }

    /// Area of the ellipse, mm²; `None` for other measurements.
    pub fn area_mm2(&self) -> Option<f64> {
        self.axes_mm().map(|[a, b]| 0.25 * std::f64::consts::PI * a * b)
    }

    /// Angle at the corner, degrees, 0..=180; `None` for other measurements.
    pub fn angle_deg(&self) -> Option<f64> {
        let [a, corner, b] = self.points_mm[..] else { return None };
        let direction = |p: [f64; 2]| (p[1] - corner[1]).atan2(p[0] - corner[0]).to_degrees();
        let turn = (direction(a) - direction(b)).abs();
        Some(if turn > 180.0 { 360.0 - turn } else { turn })
    }

    /// Value with its unit: a length or circumference in mm, or an angle in degrees.
    pub fn value(&self) -> (f64, &'static str) {
        match self.length_mm() {
            Some(mm) => (mm, "mm"),
            None => (self.angle_deg().unwrap_or_default(), "deg"),
        }
    }
}

/// Value of the event.
#[derive(serde::Deserialize)]
#[serde(deny_unknown_fields)]
struct Value {
    measure: String,
    points_mm: Vec<[f64; 2]>,
}

fn distance(a: [f64; 2], b: [f64; 2]) -> f64 {
    (b[0] - a[0]).hypot(b[1] - a[1])
}

/// Circumference of an ellipse with these semi-axes, mm, by Ramanujan's second approximation; its error is below 4e-4
/// even for flat ellipses.
pub fn ellipse_circumference_mm(a_mm: f64, b_mm: f64) -> f64 {
    let sum = a_mm + b_mm;
    if sum <= 0.0 {
        return 0.0;
    }
    let h = ((a_mm - b_mm) / sum).powi(2);
    std::f64::consts::PI * sum * (1.0 + 3.0 * h / (10.0 + (4.0 - 3.0 * h).sqrt()))
}

#[cfg(test)]
mod tests {
    use super::*;

    fn read(event: &Event) -> Option<Result<CaliperEvent, String>> {
        CaliperEvent::marked(event).map(|read| read.map(|(caliper, _)| caliper))
    }

    #[test]
    fn a_caliper_is_written_read_and_measured() {
        let line = CaliperEvent { measure: "FL".into(), points_mm: vec![[-12.0, 60.0], [12.0, 67.0]] };
        assert_eq!(read(&line.event(7)), Some(Ok(line.clone())));
        assert!((line.length_mm().unwrap() - 25.0).abs() < 1e-12 && line.value().1 == "mm");
        let circle = [[-10.0, 0.0], [10.0, 0.0], [0.0, -10.0], [0.0, 10.0]];
        let circle = CaliperEvent { measure: "AC".into(), points_mm: circle.to_vec() };
        assert!((circle.length_mm().unwrap() - 20.0 * std::f64::consts::PI).abs() < 1e-9);
        assert!((circle.area_mm2().unwrap() - 100.0 * std::f64::consts::PI).abs() < 1e-9);
        let corner = CaliperEvent { measure: String::new(), points_mm: vec![[-5.0, 1.0], [0.0, 1.0], [0.0, 9.0]] };
        assert_eq!((corner.length_mm(), corner.kind()), (None, MeasureKind::Angle));
        assert!((corner.angle_deg().unwrap() - 90.0).abs() < 1e-9);
        // The circumference of a flat ellipse is twice its axis.
        assert!((ellipse_circumference_mm(10.0, 0.0) / 40.0 - 1.0).abs() < 5e-4);
        assert_eq!(read(&Event::new(7, "gain")), None);
    }

    #[test]
    fn malformed_calipers_are_reported() {
        let error = |value: serde_json::Value| read(&Event::new(0, CALIPER_EVENT).with(value)).unwrap().unwrap_err();
        assert!(error(serde_json::json!(null)).contains("\"points_mm\""));
        assert!(error(serde_json::json!({"measure": "FL", "points_mm": [[1, 2]]})).contains("has 1"));
        assert!(error(serde_json::json!({"measure": "FL", "points_mm": [[1, 2], [3, 4]], "m": 1})).contains("`m`"));
        let far = serde_json::json!({"measure": "FL", "points_mm": [[1e9, 2], [0, 0]]});
        assert!(error(far).contains("1000000000"));
    }
}
