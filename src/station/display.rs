//! `[display]`: sinks of a live session.

use std::collections::HashSet;

use super::values::Values;
use crate::sink::LiveSinkKind;

pub(super) fn sinks(values: &Values) -> Vec<LiveSinkKind> {
    let Some(words) = values.texts("sinks") else { return vec![LiveSinkKind::Null] };
    // All names are valid, because `Values::check` verified them.
    let sinks = words.into_iter().filter_map(|word| word.parse().ok());
    let mut seen = HashSet::new();
    sinks.filter(|sink| seen.insert(*sink)).collect()
}

#[cfg(test)]
mod tests {
    use crate::sink::LiveSinkKind::{Null, Png, Video};
    use crate::station::tests::{assert_refused, parse};

    #[test]
    fn sinks_are_known_and_each_comes_once() {
        let sinks = |text: &str| parse(&format!("[display]\n{text}")).unwrap().sinks;
        assert_eq!(sinks(""), [Null]);
        assert_eq!(sinks("sinks = []"), []);
        assert_eq!(sinks("sinks = [\"video\", \"png\", \"video\"]"), [Video, Png]);
        let wrong = ["sinks = \"png\"", "sinks = [1]", "sinks = [\"web\"]"];
        assert_refused("display", &wrong.map(|line| (line, ["display.sinks"])));
    }
}
