//! Tables of numbers with a header, comments after `#`.

use std::collections::BTreeMap;
use std::path::Path;

/// A row: its numbers by column.
pub(crate) type Row = BTreeMap<String, f64>;

/// Rows of tests/truth/`name`; columns that are words are left out.
pub(crate) fn rows(name: &str) -> Vec<Row> {
    let path = Path::new(env!("CARGO_MANIFEST_DIR")).join("tests/truth").join(name);
    let text = std::fs::read_to_string(&path).unwrap_or_else(|error| panic!("{}: {error}", path.display()));
    let mut lines = text.lines().filter(|line| !line.starts_with('#') && !line.is_empty());
    let columns: Vec<&str> = lines.next().unwrap().split(',').collect();
    let row = |line: &str| {
        let numbers = columns.iter().zip(line.split(','));
        numbers.filter_map(|(&column, text)| Some((column.to_owned(), text.parse().ok()?))).collect()
    };
    lines.map(row).collect()
}
