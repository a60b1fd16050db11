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

#[cfg(test)]
mod tests {
    use std::path::Path;

    use crate::sink::LiveSinkKind::{Null, Png, Video};
    use crate::station::Station;

    #[test]
    fn sinks_are_known_and_each_comes_once() {
        let sinks = |text: &str| {
            let text = format!("[scene]\npath = \"a.glb\"\n[display]\n{text}");
            Station::parse(&text, Path::new("")).map(|station| station.sinks)
        };
        assert_eq!(sinks("").unwrap(), [Null]);
        assert_eq!(sinks("sinks = []").unwrap(), []);
        assert_eq!(sinks("sinks = [\"video\", \"png\", \"video\"]").unwrap(), [Video, Png]);
        for wrong in ["sinks = \"png\"", "sinks = [1]", "sinks = [\"web\"]"] {
            assert!(sinks(wrong).unwrap_err().to_string().contains("display.sinks"), "{wrong}");
        }
    }
}
