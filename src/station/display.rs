//! `[display]`: where a live session's frames go.

use super::values::Values;
use crate::sink::LiveSinkKind;

pub(super) fn sinks(values: &Values) -> Vec<LiveSinkKind> {
    let Some(words) = values.texts("sinks") else { return vec![LiveSinkKind::Null] };
    // The parser saw to it that each is a known name.
    let mut sinks: Vec<LiveSinkKind> = words.into_iter().filter_map(|word| word.parse().ok()).collect();
    let mut seen = Vec::new();
    sinks.retain(|sink| {
        !seen.contains(sink) && {
            seen.push(*sink);
            true
        }
    });
    sinks
}
