//! Helpers shared by the tests of single tables.

use std::path::Path;

use super::{Station, StationError};

/// Parses a station that has `tables` and is in the directory `/station`. Its scene is a file.
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

#[test]
fn paths_with_backslashes_in_double_quotes_are_refused_with_the_way_out() {
    for (tables, words) in [
        ("[calibration]\npath = \"C:\\Users\\me\\c.toml\"", ["path = 'C:\\Users\\me\\c.toml'", "forward slashes"]),
        // The escapes are valid TOML, but the text is no path.
        (
            "[calibration]\npath = \"C:\\temp\\new.toml\"",
            ["`calibration.path`: it holds a control character", "C:/temp/new.toml"],
        ),
        ("[generator]\nmodels = [\"D:\\new\\best.onnx\"]", ["`generator.models`", "single quotes"]),
        ("[tracker]\ntransport = \"recording\"\nrecording = \"\\rec.mcap\"", ["`tracker.recording`", "single quotes"]),
    ] {
        let error = parse(tables).unwrap_err().to_string();
        assert!(words.iter().all(|word| error.contains(word)), "{tables}: {error}");
    }
    assert!(parse("[calibration]\npath = 'C:\\temp\\c.toml'").is_ok());
}
