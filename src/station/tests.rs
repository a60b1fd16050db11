//! What tests of single tables share.

use std::path::Path;

use super::{Station, StationError};

/// The station of `tables` in the directory `/station`; its scene is a file.
pub(super) fn parse(tables: &str) -> Result<Station, StationError> {
    Station::parse(&format!("[scene]\npath = \"a.glb\"\n{tables}"), Path::new("/station"))
}

/// Checks that each line of `table` is refused, by a message with all of its words.
#[track_caller]
pub(super) fn assert_refused<const N: usize>(table: &str, lines: &[(&str, [&str; N])]) {
    for (line, words) in lines {
        let error = parse(&format!("[{table}]\n{line}")).unwrap_err().to_string();
        assert!(words.iter().all(|word| error.contains(word)), "{line}: {error}");
    }
}
