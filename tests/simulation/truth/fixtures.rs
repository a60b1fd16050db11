//! Reference tables in text files with a header line and comments after `#`.

use std::collections::BTreeMap;
use std::path::Path;

/// A row of a table: its texts by column name.
#[derive(Debug)]
pub(crate) struct Row(BTreeMap<String, String>);

#[allow(dead_code, reason = "each test reads other columns")]
impl Row {
    /// Text of a column.
    pub(crate) fn text(&self, column: &str) -> &str {
        self.0.get(column).unwrap_or_else(|| panic!("no column {column}"))
    }

    /// Number in a column; `None` if the table has no such column.
    pub(crate) fn optional(&self, column: &str) -> Option<f64> {
        self.0.get(column).map(|text| text.parse().unwrap_or_else(|_| panic!("{column} is {text}")))
    }

    /// Number in a column.
    pub(crate) fn number(&self, column: &str) -> f64 {
        self.optional(column).unwrap_or_else(|| panic!("no column {column}"))
    }

    /// Texts of all columns except `columns`.
    pub(crate) fn without(&self, columns: &[&str]) -> Vec<&str> {
        self.0.iter().filter(|(name, _)| !columns.contains(&name.as_str())).map(|(_, text)| text.as_str()).collect()
    }
}

/// Rows of tests/truth/`name`.
pub(crate) fn rows(name: &str) -> Vec<Row> {
    let path = Path::new(env!("CARGO_MANIFEST_DIR")).join("tests/truth").join(name);
    let text = std::fs::read_to_string(&path).unwrap_or_else(|error| panic!("{}: {error}", path.display()));
    let mut lines = text.lines().filter(|line| !line.starts_with('#') && !line.is_empty());
    let columns: Vec<&str> = lines.next().unwrap().split(',').collect();
    let row = |line: &str| {
        let texts: Vec<&str> = line.split(',').collect();
        assert_eq!(texts.len(), columns.len(), "{name}: {line}");
        Row(columns.iter().zip(texts).map(|(&column, text)| (column.to_owned(), text.to_owned())).collect())
    };
    lines.map(row).collect()
}
