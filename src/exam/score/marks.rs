//! Marks that the session itself holds: measurements with their true values, texts and body marks.

use serde::Serialize;

use super::{Reference, error_percent, true_length_mm};
use crate::anatomy::planes::{Caliper, CaliperKind, View};
use crate::exam::offset::Offset;
use crate::pose::{Pose, TimedPose};
use crate::recording::{CaliperEvent, Event, Marks, MeasureKind, RecordedMark};
use crate::settings::MarkContent;

/// A measurement made in the session itself.
#[derive(Debug, Clone, PartialEq, Serialize)]
pub struct CaliperScore {
    /// Time of its last change, s since the start.
    pub time_s: f64,
    /// Time of the measured picture, s since the start.
    pub picture_s: f64,
    /// Plane that the picture showed; `None` if it showed none within its tolerances.
    #[serde(skip_serializing_if = "Option::is_none")]
    pub plane: Option<String>,
    /// Name of the measure; empty if it has none.
    pub name: String,
    /// Kind of the measure.
    pub kind: MeasureKind,
    /// Measured length or circumference, mm; `None` for an angle.
    #[serde(skip_serializing_if = "Option::is_none")]
    pub measured_mm: Option<f64>,
    /// Measured angle, degrees; `None` for other measures.
    #[serde(skip_serializing_if = "Option::is_none")]
    pub angle_deg: Option<f64>,
    /// Area of a measured ellipse, mm²; `None` for other measures.
    #[serde(skip_serializing_if = "Option::is_none")]
    pub area_mm2: Option<f64>,
    /// Axes of a measured ellipse, mm; `None` for other measures.
    #[serde(skip_serializing_if = "Option::is_none")]
    pub axes_mm: Option<[f64; 2]>,
    /// True length, mm; `None` if no plane has this measure.
    pub true_mm: Option<f64>,
    /// Error, measured minus true, mm; `None` without a true length.
    pub error_mm: Option<f64>,
    /// Relative error: measured value over true value, minus one, percent; `None` without a true length.
    pub error_percent: Option<f64>,
    /// Reason why a named measure is not compared with a true value; empty if it is compared.
    #[serde(skip_serializing_if = "String::is_empty")]
    pub note: String,
}

/// A text or a body mark in the session.
#[derive(Debug, Clone, PartialEq, Serialize)]
pub struct TextScore {
    /// Time of its picture, s since the start.
    pub picture_s: f64,
    /// Plane that the picture showed; `None` if it showed none within its tolerances.
    #[serde(skip_serializing_if = "Option::is_none")]
    pub plane: Option<String>,
    /// The text, or the name of the body mark.
    pub text: String,
    /// Rotation of the probe on a body mark, degrees; `None` for a text.
    #[serde(skip_serializing_if = "Option::is_none")]
    pub turn_deg: Option<f64>,
}

/// Scores of the session's marks.
#[derive(Debug, Clone, PartialEq, Default)]
pub(super) struct MarkScores {
    pub(super) calipers: Vec<CaliperScore>,
    pub(super) texts: Vec<TextScore>,
    pub(super) refused: Vec<String>,
}

/// Scores the marks in `events`.
pub(super) fn marks(poses: &[TimedPose], events: &[Event], reference: &Reference<'_>) -> MarkScores {
    let start_ns = poses.first().map_or(0, |p| p.host_time_ns);
    let seconds = |time_ns: u64| (i128::from(time_ns) - i128::from(start_ns)) as f64 * 1e-9;
    let read = Marks::of(events);
    let mut scores = MarkScores::default();
    for mark in &read.all {
        let (time_s, picture_s) = (seconds(mark.host_time_ns), seconds(mark.picture_time_ns()));
        let plane = plane_shown(poses, mark, reference);
        if let Some(caliper) = CaliperEvent::of(&mark.content) {
            scores.calipers.push(caliper_score(&caliper, [time_s, picture_s], plane, reference));
            continue;
        }
        let (text, turn_deg) = match &mark.content {
            MarkContent::Text { text, .. } => (text, None),
            MarkContent::BodyMark { name, turn_deg } => (name, Some(*turn_deg)),
            _ => continue,
        };
        scores.texts.push(TextScore { picture_s, plane, text: text.clone(), turn_deg });
    }
    scores.refused = read.refused.iter().map(|(ns, reason)| format!("{:.2} s: {reason}", seconds(*ns))).collect();
    scores
}

/// Name of the plane that the picture of `mark` shows within its tolerances; `None` if there is none.
fn plane_shown(poses: &[TimedPose], mark: &RecordedMark, reference: &Reference<'_>) -> Option<String> {
    let time_ns = mark.picture_time_ns();
    let index = poses.partition_point(|p| p.host_time_ns <= time_ns).checked_sub(1);
    let own: Option<Pose> = mark.frame.and_then(|frame| frame.pose);
    let pose = own.or_else(|| Some(poses.get(index?)?.pose))?;
    // A picture before the first pose has the depth of the first pose.
    let probe = reference.probe_at(index.unwrap_or(0));
    let shown = reference.scene_planes.iter().filter_map(|plane| {
        let (_, offset) = Offset::nearest(plane, &probe, &pose)?;
        offset.is_within().then_some((offset.cost, plane))
    });
    shown.min_by(|a, b| a.0.total_cmp(&b.0)).map(|(_, plane)| plane.name.clone())
}

fn caliper_score(
    caliper: &CaliperEvent,
    [time_s, picture_s]: [f64; 2],
    plane: Option<String>,
    reference: &Reference<'_>,
) -> CaliperScore {
    let measured_mm = caliper.length_mm();
    let known = find(&caliper.measure, reference);
    let expected = known.map(|(known, _)| match known.kind {
        CaliperKind::Line => MeasureKind::Distance,
        CaliperKind::Ellipse => MeasureKind::Ellipse,
    });
    let true_mm =
        known.filter(|_| expected == Some(caliper.kind())).and_then(|(c, view)| true_length_mm(c, view, reference));
    let note = match expected {
        Some(expected) if expected != caliper.kind() => {
            format!("{} is measured with the tool {}", caliper.measure, expected.name())
        }
        Some(_) if true_mm.is_none() => "its true size is not known".to_owned(),
        None if !caliper.measure.is_empty() => {
            format!("no standard plane of the scene has the measure {}", caliper.measure)
        }
        _ => String::new(),
    };
    CaliperScore {
        time_s,
        picture_s,
        plane,
        name: caliper.measure.clone(),
        kind: caliper.kind(),
        measured_mm,
        angle_deg: caliper.angle_deg(),
        area_mm2: caliper.area_mm2(),
        axes_mm: caliper.axes_mm(),
        true_mm,
        error_mm: measured_mm.zip(true_mm).map(|(measured, correct)| measured - correct),
        error_percent: error_percent(measured_mm, true_mm),
        note,
    }
}

/// Caliper with this name, regardless of case, and its view; `None` if no plane has it.
fn find<'a>(name: &str, reference: &Reference<'a>) -> Option<(&'a Caliper, &'a View)> {
    let views = reference.scene_planes.iter().flat_map(|plane| &plane.views);
    let mut known = views.flat_map(|view| view.calipers.iter().map(move |caliper| (caliper, view)));
    known.find(|(caliper, _)| caliper.name.eq_ignore_ascii_case(name))
}
