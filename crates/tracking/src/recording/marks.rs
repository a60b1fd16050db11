//! Marks of a session on its pictures, as events of a recording: measurements, texts, body marks.
//!
//! | event | value |
//! |---|---|
//! | [`CALIPER_EVENT`](super::CALIPER_EVENT) | `measure`, `points_mm`, and for other readers `kind`, `value`, `unit`, `area_mm2` |
//! | [`TEXT_EVENT`] | `text`, `at_mm` |
//! | [`BODY_MARK_EVENT`] | `name`, `turn_deg` |
//! | [`REMOVAL_EVENT`] | `id` |
//!
//! Marks that were set by a page also have `id`, and the marked frame's number `frame`, time `frame_time_ns` (ns since
//! 1970, UTC) and `pose` (`scene_from_probe`: x, y, z in mm, qw, qx, qy, qz). A later event with the same `id` replaces
//! the earlier one.

use insonify_core::settings::{Mark, MarkContent};
use serde_json::{Value, json};

use super::Event;
use super::caliper::{CALIPER_EVENT, CaliperEvent};
use super::marked::{Marked, MarkedFrame};

/// Name of the event of a text on a picture.
pub const TEXT_EVENT: &str = "text";

/// Name of the event of a body mark.
pub const BODY_MARK_EVENT: &str = "body-mark";

/// Name of the event that removes a mark.
pub const REMOVAL_EVENT: &str = "mark-removed";

/// Final state of a mark.
#[derive(Debug, Clone, PartialEq)]
pub struct RecordedMark {
    /// Identifier; `None` for marks that can't be replaced.
    pub id: Option<String>,
    /// Time of its last change, ns since 1970 (UTC).
    pub host_time_ns: u64,
    /// The marked frame; `None` if the event names none.
    pub frame: Option<MarkedFrame>,
    /// Content. The name of a measurement may be longer than a page allows.
    pub content: MarkContent,
}

impl RecordedMark {
    /// Time of the marked frame, or of the event if no frame is named; ns since 1970 (UTC).
    pub fn picture_time_ns(&self) -> u64 {
        self.frame.map_or(self.host_time_ns, |frame| frame.time_ns)
    }
}

/// Final state of a session's marks.
#[derive(Debug, Clone, PartialEq, Default)]
pub struct Marks {
    /// Marks that were not removed, in the order in which they were set.
    pub all: Vec<RecordedMark>,
    /// Number of changes to existing marks.
    pub changed: usize,
    /// Number of removed marks.
    pub removed: usize,
    /// Events that could not be read: time, ns since 1970 (UTC), and reason.
    pub refused: Vec<(u64, String)>,
}

impl Marks {
    /// Final state of the marks in `events`.
    pub fn of(events: &[Event]) -> Self {
        let mut marks = Self::default();
        let mut events: Vec<&Event> = events.iter().collect();
        events.sort_by_key(|event| event.host_time_ns);
        for event in events {
            if event.name == REMOVAL_EVENT {
                marks.remove(event);
                continue;
            }
            match content(event) {
                Some(Ok((content, Marked { id, frame }))) => {
                    marks.set(RecordedMark { id, host_time_ns: event.host_time_ns, frame, content });
                }
                Some(Err(reason)) => marks.refused.push((event.host_time_ns, reason)),
                None => {}
            }
        }
        marks
    }

    fn set(&mut self, mark: RecordedMark) {
        match self.all.iter_mut().find(|old| old.id.is_some() && old.id == mark.id) {
            Some(old) => {
                *old = mark;
                self.changed += 1;
            }
            None => self.all.push(mark),
        }
    }

    fn remove(&mut self, event: &Event) {
        let id = event.value.as_ref().and_then(|value| value.get("id")).and_then(Value::as_str);
        let found = id.and_then(|id| self.all.iter().position(|mark| mark.id.as_deref() == Some(id)));
        let reason = match (found, id) {
            (Some(at), _) => {
                self.all.remove(at);
                self.removed += 1;
                return;
            }
            (None, Some(id)) => {
                format!("`{REMOVAL_EVENT}` names the mark `{}`, which the recording lacks", id.escape_debug())
            }
            (None, None) => format!("`{REMOVAL_EVENT}` needs the `id` of a mark"),
        };
        self.refused.push((event.host_time_ns, reason));
    }

    /// Marks with a measurement, each with its caliper event.
    pub fn calipers(&self) -> impl Iterator<Item = (&RecordedMark, CaliperEvent)> {
        self.all.iter().filter_map(|mark| Some((mark, CaliperEvent::of(&mark.content)?)))
    }
}

/// Content of `event`; `None` for events that set no mark.
fn content(event: &Event) -> Option<Result<(MarkContent, Marked), String>> {
    if let Some(read) = CaliperEvent::marked(event) {
        return read.map(|(caliper, marked)| Some((caliper.content()?, marked))).transpose();
    }
    let (kind, form) = match event.name.as_str() {
        TEXT_EVENT => ("text", r#"a text is {"text": "...", "at_mm": [x, z]}"#),
        BODY_MARK_EVENT => ("body_mark", r#"a body mark is {"name": "abdomen", "turn_deg": 0}"#),
        _ => return None,
    };
    let read = || {
        let mut value = event.value.clone().unwrap_or_default();
        let marked = Marked::take(&mut value, &["kind"])?;
        if let Some(table) = value.as_object_mut() {
            table.insert("kind".to_owned(), kind.into());
        }
        let content: MarkContent = serde_json::from_value(value).map_err(|e| format!("{form}: {e}"))?;
        Ok((content.checked().map_err(|e| e.to_string())?, marked))
    };
    Some(read())
}

/// Event of a mark that a page set at `host_time_ns`, in a session that began at `start_unix_ns`.
pub fn mark_event(host_time_ns: u64, start_unix_ns: u64, mark: &Mark) -> Event {
    // `sampled_ms` was checked: finite and at most a year. Negative times don't occur; the cast saturates.
    let frame_time_ns = start_unix_ns.saturating_add((1e6 * mark.sampled_ms) as u64);
    let mut value = json!({
        "id": mark.id, "frame": mark.frame, "frame_time_ns": frame_time_ns, "kind": mark.content.kind(),
    });
    if let Some(pose) = mark.pose {
        value["pose"] = json!(pose);
    }
    let name = match &mark.content {
        MarkContent::Distance { measure, .. }
        | MarkContent::Ellipse { measure, .. }
        | MarkContent::Angle { measure, .. } => {
            let caliper = CaliperEvent { measure: measure.clone(), points_mm: mark.content.points_mm().to_vec() };
            let (amount, unit) = caliper.value();
            value["measure"] = json!(caliper.measure);
            value["points_mm"] = json!(caliper.points_mm);
            (value["value"], value["unit"]) = (json!(amount), json!(unit));
            if let Some(area_mm2) = caliper.area_mm2() {
                value["area_mm2"] = json!(area_mm2);
            }
            CALIPER_EVENT
        }
        MarkContent::Text { text, at_mm } => {
            (value["text"], value["at_mm"]) = (json!(text), json!(at_mm));
            TEXT_EVENT
        }
        MarkContent::BodyMark { name, turn_deg } => {
            (value["name"], value["turn_deg"]) = (json!(name), json!(turn_deg));
            BODY_MARK_EVENT
        }
    };
    Event::new(host_time_ns, name).with(value)
}

/// Event of the removal of a mark.
pub fn removal_event(host_time_ns: u64, id: &str) -> Event {
    Event::new(host_time_ns, REMOVAL_EVENT).with(json!({ "id": id }))
}

#[cfg(test)]
mod tests {
    use super::*;

    const START_NS: u64 = 1_000_000_000;

    fn mark(id: &str, content: MarkContent) -> Mark {
        let pose = Some([1.0, 2.0, 3.0, 1.0, 0.0, 0.0, 0.0]);
        Mark { id: id.into(), frame: 12, sampled_ms: 500.0, pose, content }.checked().unwrap()
    }

    fn line(id: &str, length_mm: f64) -> Mark {
        mark(id, MarkContent::Distance { measure: "BPD".into(), points_mm: [[0.0, 40.0], [length_mm, 40.0]] })
    }

    #[test]
    fn a_mark_keeps_its_frame_and_its_value() {
        let text = MarkContent::Text { text: "four chambers".into(), at_mm: [1.0, 50.0] };
        let turned = MarkContent::BodyMark { name: "abdomen".into(), turn_deg: 30.0 };
        let events: Vec<Event> = [line("a", 90.0), mark("b", text), mark("c", turned)]
            .iter()
            .map(|mark| mark_event(2 * START_NS, START_NS, mark))
            .collect();
        let value = events[0].value.as_ref().unwrap();
        assert_eq!((&value["value"], &value["unit"], &value["kind"]), (&json!(90.0), &json!("mm"), &json!("distance")));
        let marks = Marks::of(&events);
        assert_eq!((marks.all.len(), &marks.refused[..]), (3, &[][..]));
        let frame = marks.all[0].frame.unwrap();
        assert_eq!((frame.number, frame.time_ns, frame.pose.unwrap().position_mm.z), (12, 1_500_000_000, 3.0));
    }

    #[test]
    fn a_later_event_with_the_same_id_replaces_and_a_removal_removes() {
        let at = |time_ns, mark: &Mark| mark_event(time_ns, START_NS, mark);
        let events = [at(5, &line("a", 80.0)), at(6, &line("b", 70.0)), at(7, &line("a", 91.0)), removal_event(8, "b")];
        let marks = Marks::of(&events);
        assert_eq!((marks.all.len(), marks.changed, marks.removed), (1, 1, 1));
        assert_eq!(marks.calipers().next().unwrap().1.length_mm(), Some(91.0));
        // Calipers without an id are independent.
        let plain = CaliperEvent { measure: "FL".into(), points_mm: vec![[0.0, 1.0], [5.0, 1.0]] };
        assert_eq!(Marks::of(&[plain.event(1), plain.event(2)]).all.len(), 2);
        let unknown = Marks::of(&[removal_event(8, "z")]);
        assert!(unknown.refused[0].1.contains("`z`"), "{unknown:?}");
        // The name of a measurement is cut, not refused.
        let long = CaliperEvent { measure: "x".repeat(200), points_mm: vec![[0.0, 1.0], [5.0, 1.0]] };
        assert_eq!(Marks::of(&[long.event(1)]).calipers().next().unwrap().1.measure.len(), 96);
    }

    #[test]
    fn malformed_marks_are_refused_and_control_characters_dropped() {
        let read = |name: &str, value: Value| Marks::of(&[Event::new(1, name).with(value)]);
        let text = read(TEXT_EVENT, json!({"text": "a\u{1b}[2Jb", "at_mm": [0, 1]}));
        assert_eq!(text.all[0].content, MarkContent::Text { text: "a [2Jb".into(), at_mm: [0.0, 1.0] });
        for (name, value, part) in [
            (TEXT_EVENT, json!({"text": "a"}), "at_mm"),
            (TEXT_EVENT, json!("a"), "a text is"),
            (TEXT_EVENT, json!({"text": "a", "at_mm": [0, 1e9]}), "`at_mm`"),
            (BODY_MARK_EVENT, json!({"name": "x", "turn_deg": 1000}), "turn_deg"),
            (CALIPER_EVENT, json!({"measure": "FL", "points_mm": [[0, 1], [1, 1]], "id": ""}), "id"),
            (CALIPER_EVENT, json!({"measure": "FL", "points_mm": [[0, 1], [1, 1]], "pose": [0, 0]}), "frame of a mark"),
            // An incomplete frame would otherwise be dropped silently.
            (TEXT_EVENT, json!({"text": "a", "at_mm": [0, 1], "frame": 7}), "given without `frame_time_ns`"),
            (TEXT_EVENT, json!({"text": "a", "at_mm": [0, 1], "frame_time_ns": 7}), "given without `frame`"),
            (
                TEXT_EVENT,
                json!({"text": "a", "at_mm": [0, 1], "pose": [0, 0, 0, 1, 0, 0, 0]}),
                "`pose` is given without",
            ),
            (REMOVAL_EVENT, json!({}), "`mark-removed` needs the `id` of a mark"),
        ] {
            let marks = read(name, value);
            assert!(marks.all.is_empty() && marks.refused[0].1.contains(part), "{name} {part}: {:?}", marks.refused);
        }
    }
}
