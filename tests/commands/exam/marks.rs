//! Scores of the marks that a trainee sets on the page.

use insonify::recording::{
    CALIPER_EVENT, MarkedFrame, Marks, MeasureKind, RecordingInfo, RecordingWriter, mark_event, removal_event,
};
use insonify::settings::{Mark, MarkContent};
use serde_json::json;

use super::*;

const SECOND_NS: u64 = 1_000_000_000;

/// A mark that a page set on the frame at `frame_s` of a session. The session began with the recording.
fn mark(id: &str, frame_s: f64, pose: Option<Pose>, content: MarkContent) -> Mark {
    let pose = pose.map(|pose| pose.components());
    Mark { id: id.into(), frame: 7, sampled_ms: 1e3 * frame_s, pose, content }
}

/// Ends of a plane's caliper in the image of `pose`.
fn ends(plane: &str, caliper: &str, pose: &Pose) -> Vec<[f64; 2]> {
    let caliper = view(plane).calipers.iter().find(|c| c.name == caliper).unwrap();
    let local = caliper.points_mm.iter().map(|&p| pose.inverse().transform_point(p));
    local.map(|p| [p.x, p.z]).collect()
}

fn line(points: &[[f64; 2]], measure: &str) -> MarkContent {
    MarkContent::Distance { measure: measure.into(), points_mm: [points[0], points[1]] }
}

#[test]
fn measurements_of_the_page_are_compared_with_the_truth_of_the_phantom() {
    let pose = perfect("head");
    let poses = still(pose, 4.0);
    let bpd = ends("head", "BPD", &pose);
    let hc = ends("head", "HC", &pose);
    let circle = MarkContent::Ellipse { measure: "hc".into(), points_mm: [hc[0], hc[1], hc[2], hc[3]] };
    let corner = MarkContent::Angle { measure: String::new(), points_mm: [[0.0, 50.0], [0.0, 60.0], [9.0, 60.0]] };
    let wrong_tool = line(&hc[..2], "HC");
    let short = line(&[bpd[0], [bpd[1][0], bpd[1][1] - 10.0]], "BPD");
    let text = MarkContent::Text { text: "falx".into(), at_mm: [0.0, 50.0] };
    let turned = MarkContent::BodyMark { name: "pregnant".into(), turn_deg: 45.0 };
    let set = |s: u64, mark: &Mark| mark_event(START_TIME_NS + s * SECOND_NS, START_TIME_NS, mark);
    let events = [
        set(1, &mark("a-1", 0.5, Some(pose), short)),
        set(1, &mark("a-2", 0.5, Some(pose), circle)),
        set(1, &mark("a-3", 0.5, Some(pose), corner)),
        set(1, &mark("a-4", 0.5, Some(pose), wrong_tool)),
        set(1, &mark("a-5", 0.5, Some(pose), line(&bpd, "BPD"))),
        set(1, &mark("a-8", 0.5, Some(pose), line(&bpd, "no such"))),
        set(2, &mark("a-6", 0.5, Some(pose), text)),
        set(2, &mark("a-7", 0.5, Some(pose), turned)),
        // The first one's cross is dragged to its place, the fifth one is removed.
        set(3, &mark("a-1", 0.5, Some(pose), line(&bpd, "BPD"))),
        removal_event(START_TIME_NS + 3 * SECOND_NS, "a-5"),
    ];
    let score = scored(&poses, &events, &["abdomen"]);
    assert_eq!((score.calipers.len(), score.texts.len(), &score.calipers_refused[..]), (5, 2, &[][..]));
    let [first, circle, corner, other, unknown] = &score.calipers[..] else { panic!() };
    assert_eq!((first.name.as_str(), first.kind, first.plane.as_deref()), ("BPD", MeasureKind::Distance, Some("head")));
    assert!((first.time_s - 3.0).abs() < 0.01 && (first.picture_s - 0.5).abs() < 0.01, "{first:?}");
    assert!(first.error_mm.unwrap().abs() < 1.0 && first.error_percent.unwrap().abs() < 1.5, "{first:?}");
    let ellipse_mm2 = circle.axes_mm.unwrap().iter().product::<f64>() * std::f64::consts::FRAC_PI_4;
    assert!(
        circle.error_percent.unwrap().abs() < 2.0 && (circle.area_mm2.unwrap() - ellipse_mm2).abs() < 1e-6,
        "{circle:?}"
    );
    assert!((corner.angle_deg.unwrap() - 90.0).abs() < 1e-9 && corner.measured_mm.is_none());
    assert!(other.true_mm.is_none() && other.note.contains("ellipse"), "{other:?}");
    assert_eq!((unknown.true_mm, corner.note.as_str()), (None, ""));
    assert_eq!(unknown.note, "no standard plane of the scene has the measure no such");
    assert_eq!((score.texts[0].text.as_str(), score.texts[1].turn_deg), ("falx", Some(45.0)));
    let text = score.to_string();
    for part in ["BPD", "truly", "angle         90.0°", "\"falx\"", "body mark pregnant", "shows the plane head"] {
        assert!(text.contains(part), "{part}: {text}");
    }
    // Measured off the plane, nothing is said to be shown.
    let off = turned_picture(&bpd);
    assert_eq!(scored(&still(perfect("spine"), 1.5), &[off], &["head"]).calipers[0].plane, None);
}

#[test]
fn a_picture_before_the_first_pose_shows_the_plane_of_its_own_pose() {
    let pose = perfect("head");
    let bpd = ends("head", "BPD", &pose);
    let late: Vec<TimedPose> = still(pose, 3.0).split_off(60);
    let plane = |own: Option<Pose>| {
        let event = mark_event(START_TIME_NS + 2 * SECOND_NS, START_TIME_NS, &mark("a-1", 0.5, own, line(&bpd, "BPD")));
        scored(&late, &[event], &["head"]).calipers[0].plane.clone()
    };
    assert_eq!(plane(Some(pose)).as_deref(), Some("head"));
    assert_eq!(plane(None), None, "its pose is not known");
}

/// A caliper for the BPD, set on a picture far from the head's standard plane.
fn turned_picture(points: &[[f64; 2]]) -> Event {
    let pose = turned("head", DVec3::X, 60.0);
    mark_event(START_TIME_NS + SECOND_NS, START_TIME_NS, &mark("b-1", 0.5, Some(pose), line(points, "BPD")))
}

#[test]
fn marks_survive_a_recording_and_those_of_other_programs_are_read_as_before() {
    let dir = tempfile::tempdir().unwrap();
    let path = dir.path().join("marks.mcap");
    let info = RecordingInfo { start_time_ns: START_TIME_NS, ..RecordingInfo::default() };
    let mut writer = RecordingWriter::create(&path, &info).unwrap();
    let pose = perfect("head");
    let own = mark("a-1", 0.5, Some(pose), line(&[[-45.0, 70.0], [45.0, 70.0]], "BPD"));
    writer.event(&mark_event(START_TIME_NS + SECOND_NS, START_TIME_NS, &own)).unwrap();
    // The form of recordings before marks had frames.
    let old = json!({"measure": "FL", "points_mm": [[-20, 60], [20, 60]]});
    writer.event(&Event::new(START_TIME_NS + SECOND_NS, CALIPER_EVENT).with(old)).unwrap();
    writer.finish().unwrap();
    let (_, summary) = read_all(RecordingReader::open(&path).unwrap()).unwrap();
    let marks = Marks::of(&summary.events);
    assert_eq!(marks.refused, []);
    let frames: Vec<Option<MarkedFrame>> = marks.all.iter().map(|mark| mark.frame).collect();
    assert!(frames[1].is_none() && frames[0].unwrap().time_ns == START_TIME_NS + SECOND_NS / 2);
    assert!(frames[0].unwrap().pose.unwrap().position_mm.distance(pose.position_mm) < 1e-9);
    let lengths: Vec<_> = marks.calipers().map(|(_, caliper)| caliper.length_mm()).collect();
    assert_eq!(lengths, [Some(90.0), Some(40.0)]);
}
