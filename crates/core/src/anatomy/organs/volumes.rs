//! Table of volumes, `assets/organs.toml`.

use std::sync::LazyLock;

use serde::Deserialize;

use super::fact::matches;

/// Volumes of an organ in humans.
#[derive(Debug, Clone, PartialEq)]
pub(super) struct Range {
    /// Usual volumes, ml: smallest and largest.
    pub(super) usual_ml: [f64; 2],
    /// Largest volume possible in a human, ml; `None` if only usual volumes are known.
    pub(super) most_ml: Option<f64>,
    /// Whether most scans cut the organ.
    pub(super) is_often_cut: bool,
}

#[derive(Debug, Deserialize)]
#[serde(deny_unknown_fields)]
struct File {
    organ: Vec<Entry>,
}

#[derive(Debug, Deserialize)]
#[serde(deny_unknown_fields)]
struct Entry {
    names: Vec<String>,
    usual_ml: [f64; 2],
    most_ml: Option<f64>,
    extent: Option<Extent>,
}

#[derive(Debug, Deserialize)]
#[serde(rename_all = "lowercase")]
enum Extent {
    Cut,
}

/// Entries of the table: patterns of names, and volumes. Empty if the built-in table is damaged, which a test excludes.
static ENTRIES: LazyLock<Vec<(Vec<String>, Range)>> = LazyLock::new(|| {
    let file = toml::from_str::<File>(include_str!("../../../assets/organs.toml"));
    let entry = |entry: Entry| {
        let Entry { names, usual_ml, most_ml, extent } = entry;
        (names, Range { usual_ml, most_ml, is_often_cut: extent.is_some() })
    };
    file.map(|file| file.organ.into_iter().map(entry).collect()).unwrap_or_default()
});

/// Volumes of the organ called `name`; `None` if the table lacks it.
pub(super) fn range_of(name: &str) -> Option<&'static Range> {
    let is_it = |(names, _): &&(Vec<String>, Range)| names.iter().any(|pattern| matches(pattern, name));
    ENTRIES.iter().find(is_it).map(|(_, range)| range)
}

#[cfg(test)]
mod tests {
    use super::*;

    #[test]
    fn the_table_is_whole_and_its_ranges_ascend() {
        assert!(toml::from_str::<File>(include_str!("../../../assets/organs.toml")).is_ok());
        assert!(ENTRIES.len() > 50);
        for (names, Range { usual_ml: [least, usual], most_ml, .. }) in ENTRIES.iter() {
            assert!(0.0 <= *least && least < usual && most_ml.is_none_or(|most| *usual < most), "{names:?}");
            // The first matching entry counts, so no later entry may match the same name.
            for name in names {
                let name = name.replace('*', "1");
                assert_eq!(ENTRIES.iter().filter(|(n, _)| n.iter().any(|p| matches(p, &name))).count(), 1, "{name}");
            }
        }
        assert_eq!(range_of("Vertebrae L3").map(|range| (range.usual_ml[1], range.most_ml)), Some((150.0, None)));
        assert_eq!(range_of("liver").and_then(|range| range.most_ml), Some(16000.0));
        assert_eq!(range_of("gallstone"), None);
    }
}
