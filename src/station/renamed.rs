//! Keys that earlier versions had under another name. They are still accepted, with a hint that names today's key.

use std::fmt;

use toml::{Table, Value};

use super::StationError;

/// Renamed keys: table, earlier name, and name today.
const RENAMED: [(&str, &str, &str); 3] = [
    ("quality", "budget_ms", "frame_budget_ms"),
    ("generator", "budget_ms", "run_budget_ms"),
    ("pipeline", "budget_ms", "deadline_ms"),
];

/// A key of a station file that is written under an earlier name.
#[derive(Debug, Clone, Copy, PartialEq, Eq)]
pub struct RenamedKey {
    /// Name of the table.
    pub table: &'static str,
    /// Name in the file.
    pub old: &'static str,
    /// Name today.
    pub new: &'static str,
}

impl fmt::Display for RenamedKey {
    fn fmt(&self, f: &mut fmt::Formatter<'_>) -> fmt::Result {
        let Self { table, old, new } = self;
        write!(f, "`{table}.{old}` is accepted, and called `{table}.{new}` now")
    }
}

/// Renames the keys of earlier versions in `root` to today's names, and returns them.
///
/// # Errors
/// A table has a key under both names.
pub(super) fn rename(root: &mut Table) -> Result<Vec<RenamedKey>, StationError> {
    let mut renamed = Vec::new();
    for (table, old, new) in RENAMED {
        let Some(Value::Table(values)) = root.get_mut(table) else { continue };
        let Some(value) = values.remove(old) else { continue };
        if values.contains_key(new) {
            let reason = format!("it is called `{table}.{new}` now, which is given, too");
            return Err(StationError::NotApplicable { key: format!("{table}.{old}"), reason });
        }
        values.insert(new.to_owned(), value);
        renamed.push(RenamedKey { table, old, new });
    }
    Ok(renamed)
}

#[cfg(test)]
mod tests {
    use super::*;
    use crate::station::keys::of_table;
    use crate::station::tests::parse;

    #[test]
    fn old_keys_mean_what_the_new_ones_mean_and_are_named() {
        let station = |quality: &str, generator: &str, pipeline: &str| {
            parse(&format!("[quality]\n{quality} = 40\n[generator]\n{generator} = 30\n[pipeline]\n{pipeline} = 70\n"))
                .unwrap()
        };
        let old = station("budget_ms", "budget_ms", "budget_ms");
        let new = station("frame_budget_ms", "run_budget_ms", "deadline_ms");
        assert!(new.renamed_keys.is_empty());
        let hints: Vec<String> = old.renamed_keys.iter().map(RenamedKey::to_string).collect();
        assert_eq!(hints[0], "`quality.budget_ms` is accepted, and called `quality.frame_budget_ms` now");
        assert_eq!(hints.len(), RENAMED.len());
        assert_eq!(crate::station::Station { renamed_keys: Vec::new(), ..old }, new);
    }

    #[test]
    fn a_key_under_both_names_is_refused() {
        let error = parse("[quality]\nbudget_ms = 40\nframe_budget_ms = 50").unwrap_err().to_string();
        assert!(error.contains("quality.budget_ms") && error.contains("quality.frame_budget_ms"), "{error}");
    }

    #[test]
    fn old_keys_are_keys_no_more_and_new_ones_are() {
        for (table, old, new) in RENAMED {
            let known = |key: &str| of_table(table).any(|doc| doc.key == key);
            assert!(known(new) && !known(old), "{table}.{old}");
        }
    }
}
