//! Helpers shared by the tests of single tables.

use std::path::Path;

use super::{Station, StationError};

/// Parses a station with `tables` in the directory `/station`; its scene is a file.
pub(super) fn parse(tables: &str) -> Result<Station, StationError> {
    Station::parse(&format!("[scene]\npath = \"a.glb\"\n{tables}"), Path::new("/station"))
}

/// Checks that each line in `table` is refused with a message that contains all of its words.
#[track_caller]
pub(super) fn assert_refused<const N: usize>(table: &str, lines: &[(&str, [&str; N])]) {
    for (line, words) in lines {
        let error = parse(&format!("[{table}]\n{line}")).unwrap_err().to_string();
        assert!(words.iter().all(|word| error.contains(word)), "{line}: {error}");
    }
}
