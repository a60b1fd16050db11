//! Caliper measurements, as events of a recording.
//!
//! A caliper is the event [`CALIPER_EVENT`] with the value `{"measure": "BPD", "points_mm": [[x, z], [x, z]]}`. Two
//! image points give a length. Four give an ellipse: the ends of its first axis, then of its second. Points are (x, z)
//! in the probe frame, mm: x to the right from the image's middle line, z down from the centre of the probe's face.
//! `measure` is the name of a standard plane's caliper, or free text.

use serde::{Deserialize, Serialize};

use super::Event;

/// Name of the event.
pub const CALIPER_EVENT: &str = "caliper";

/// Largest accepted coordinate, mm.
const COORDINATE_LIMIT_MM: f64 = 1e4;

/// A measurement in the image.
#[derive(Debug, Clone, PartialEq, Serialize, Deserialize)]
#[serde(deny_unknown_fields)]
pub struct CaliperEvent {
    /// Name of the measure, for example `BPD`.
    pub measure: String,
    /// Two or four points (x, z) of the probe frame, mm.
    pub points_mm: Vec<[f64; 2]>,
}

impl CaliperEvent {
    /// Caliper measurement of `event`; `None` for other events.
    ///
    /// # Errors
    /// A caliper event with a malformed value; the text gives the fault and the correct form.
    pub(crate) fn from_event(event: &Event) -> Option<Result<Self, String>> {
        (event.name == CALIPER_EVENT).then(|| {
            let value = event.value.clone().unwrap_or_default();
            let caliper: Self = serde_json::from_value(value)
                .map_err(|e| format!("a caliper is {{\"measure\": \"BPD\", \"points_mm\": [[x, z], [x, z]]}}: {e}"))?;
            let count = caliper.points_mm.len();
            if count != 2 && count != 4 {
                return Err(format!("a caliper has 2 points, or 4 for an ellipse; this one has {count}"));
            }
            if let Some(x) =
                caliper.points_mm.iter().flatten().find(|x| !x.is_finite() || x.abs() > COORDINATE_LIMIT_MM)
            {
                return Err(format!("a caliper's point is {x}; coordinates reach ±{COORDINATE_LIMIT_MM} mm"));
            }
            Ok(caliper)
        })
    }

    /// Event of this measurement at `host_time_ns`.
    pub fn event(&self, host_time_ns: u64) -> Event {
        let value = serde_json::json!({ "measure": self.measure, "points_mm": self.points_mm });
        Event::new(host_time_ns, CALIPER_EVENT).with(value)
    }

    /// Length of the line, or circumference of the ellipse (Ramanujan's second approximation), mm.
    pub(crate) fn length_mm(&self) -> f64 {
        let lengths: Vec<f64> =
            self.points_mm.chunks_exact(2).map(|p| (p[1][0] - p[0][0]).hypot(p[1][1] - p[0][1])).collect();
        match lengths[..] {
            [a, b] => ellipse_circumference_mm(0.5 * a, 0.5 * b),
            _ => lengths.iter().sum(),
        }
    }
}

/// Circumference of an ellipse with these semi-axes, mm, by Ramanujan's second approximation; its error is below 4e-4
/// even for flat ellipses.
pub(crate) fn ellipse_circumference_mm(a_mm: f64, b_mm: f64) -> f64 {
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

    #[test]
    fn a_caliper_is_written_read_and_measured() {
        let line = CaliperEvent { measure: "FL".into(), points_mm: vec![[-12.0, 60.0], [12.0, 67.0]] };
        let event = line.event(7);
        assert_eq!(CaliperEvent::from_event(&event), Some(Ok(line.clone())));
        assert!((line.length_mm() - 25.0).abs() < 1e-12);
        let circle = [[-10.0, 0.0], [10.0, 0.0], [0.0, -10.0], [0.0, 10.0]];
        let circle = CaliperEvent { measure: "AC".into(), points_mm: circle.to_vec() };
        assert!((circle.length_mm() - 20.0 * std::f64::consts::PI).abs() < 1e-9);
        // The circumference of a flat ellipse is twice its axis.
        assert!((ellipse_circumference_mm(10.0, 0.0) / 40.0 - 1.0).abs() < 5e-4);
        assert_eq!(CaliperEvent::from_event(&Event::new(7, "gain")), None);
    }

    #[test]
    fn malformed_calipers_are_reported() {
        let error = |value: serde_json::Value| {
            CaliperEvent::from_event(&Event::new(0, CALIPER_EVENT).with(value)).unwrap().unwrap_err()
        };
        assert!(error(serde_json::json!(null)).contains("\"points_mm\""));
        assert!(error(serde_json::json!({"measure": "FL", "points_mm": [[1, 2]]})).contains("has 1"));
        let far = serde_json::json!({"measure": "FL", "points_mm": [[1e9, 2], [0, 0]]});
        assert!(error(far).contains("1000000000"));
    }
}
