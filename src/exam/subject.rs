//! Standard planes that a recorded session is to show.

use serde_json::Value;
use thiserror::Error;

use super::session::TRUTH_EVENT;
use crate::recording::{EXAM_EVENT, Event};

/// A malformed [`EXAM_EVENT`].
#[derive(Debug, Clone, PartialEq, Eq, Error)]
#[error("the event `{EXAM_EVENT}` is {found}; it must be a list of names of planes")]
pub struct SubjectError {
    /// Value found, as JSON.
    found: String,
}

/// Names of the planes that a session is to show, each once: the names in its [`EXAM_EVENT`], or else the planes that a
/// generated hand searched for. Empty if the recording names none.
///
/// # Errors
/// An [`EXAM_EVENT`] does not hold a list of names.
pub fn planes_of(events: &[Event]) -> Result<Vec<String>, SubjectError> {
    let mut names: Vec<String> = Vec::new();
    let mut add = |name: &str| {
        if !names.iter().any(|known| known == name) {
            names.push(name.to_owned());
        }
    };
    if let Some(event) = events.iter().find(|event| event.name == EXAM_EVENT) {
        let value = event.value.clone().unwrap_or_default();
        let listed: Vec<String> =
            serde_json::from_value(value.clone()).map_err(|_| SubjectError { found: value.to_string() })?;
        listed.iter().for_each(|name| add(name));
        return Ok(names);
    }
    let truths = events.iter().filter(|event| event.name == TRUTH_EVENT).filter_map(|event| event.value.as_ref());
    truths.filter_map(|value| value.get("plane").and_then(Value::as_str)).for_each(add);
    Ok(names)
}

#[cfg(test)]
mod tests {
    use serde_json::json;

    use super::*;

    #[test]
    fn the_event_comes_first_then_what_the_hand_looked_for() {
        let truth = |plane: &str| Event::new(2, TRUTH_EVENT).with(json!({"plane": plane, "phase": "search"}));
        let survey = Event::new(3, TRUTH_EVENT).with(json!({"phase": "survey"}));
        assert_eq!(planes_of(&[truth("head"), truth("femur"), truth("head"), survey]).unwrap(), ["head", "femur"]);
        let named = Event::new(1, EXAM_EVENT).with(json!(["spine"]));
        assert_eq!(planes_of(&[named, truth("head")]).unwrap(), ["spine"]);
        assert_eq!(planes_of(&[Event::new(1, "head")]).unwrap(), [] as [&str; 0]);
        let error = planes_of(&[Event::new(1, EXAM_EVENT).with("head")]).unwrap_err();
        assert!(error.to_string().contains("\"head\""), "{error}");
    }
}
