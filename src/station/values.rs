//! Checked values of one table of a station file.

use std::net::IpAddr;

use toml::{Table, Value};

use super::StationError;
use super::accepts::{Accepts, LISTEN_ADDRESS};
use super::keys::{KeyDoc, of_table};
use crate::files::backslashes;
use crate::pose::{Pose, PoseError};
use crate::settings::{AUTO, Kind, SettingsGroup};
use crate::suggest::did_you_mean;

/// Checked values of one table.
pub(super) struct Values {
    table: String,
    values: Table,
}

impl Values {
    /// Checks each key of `values` against its [`KeyDoc`].
    pub(super) fn check(table: &str, values: Table) -> Result<Self, StationError> {
        for (key, value) in &values {
            let Some(doc) = of_table(table).find(|doc| doc.key == key) else {
                return Err(StationError::UnknownKey {
                    table: table.to_owned(),
                    key: key.clone(),
                    suggestion: did_you_mean(key, of_table(table).map(|doc| doc.key)),
                    known: of_table(table).map(|doc| doc.key).collect::<Vec<_>>().join(", "),
                });
            };
            check_value(table, doc, value)?;
        }
        Ok(Self { table: table.to_owned(), values })
    }

    pub(super) fn has(&self, key: &str) -> bool {
        self.values.contains_key(key)
    }

    pub(super) fn text(&self, key: &str) -> Option<&str> {
        self.values.get(key)?.as_str()
    }

    pub(super) fn texts(&self, key: &str) -> Option<Vec<&str>> {
        Some(self.values.get(key)?.as_array()?.iter().filter_map(Value::as_str).collect())
    }

    pub(super) fn number(&self, key: &str) -> Option<f64> {
        number(self.values.get(key)?)
    }

    /// A whole number; `None` if the key is absent. [`Self::check`] verified its range, which fits u32.
    pub(super) fn integer(&self, key: &str) -> Option<u32> {
        u32::try_from(self.values.get(key)?.as_integer()?).ok()
    }

    pub(super) fn numbers<const N: usize>(&self, key: &str) -> Option<[f64; N]> {
        let numbers: Vec<f64> = self.values.get(key)?.as_array()?.iter().filter_map(number).collect();
        numbers.try_into().ok()
    }

    /// Pose from two keys. If absent, the position is the origin and the rotation the identity.
    pub(super) fn pose(&self, position: &str, quaternion: &str) -> Result<Pose, PoseError> {
        let [x, y, z] = self.numbers(position).unwrap_or_default();
        let [qw, qx, qy, qz] = self.numbers(quaternion).unwrap_or([1.0, 0.0, 0.0, 0.0]);
        Pose::from_components([x, y, z, qw, qx, qy, qz])
    }

    /// Overwrites the settings in `group` whose keys are given in the table.
    pub(super) fn set_group(&self, group: &mut impl SettingsGroup) {
        for (key, value) in &self.values {
            let Some(stored) = group.stored_mut(key) else { continue };
            match value {
                Value::Array(elements) => {
                    let numbers = elements.iter().filter_map(number).enumerate();
                    numbers.for_each(|(index, number)| stored.set(index, number));
                }
                Value::Boolean(on) => stored.set(0, (*on).into()),
                Value::String(found) => match stored.kind() {
                    Kind::Word(words) => {
                        if let Some(index) = words.iter().position(|word| word == found) {
                            stored.set(0, index as f64);
                        }
                    }
                    Kind::WholeOrAuto if found == AUTO => stored.set(0, 0.0),
                    _ => {}
                },
                value => stored.set(0, number(value).unwrap_or(stored.get(0))),
            }
        }
    }

    /// A group of settings; keys that are not given have their defaults.
    pub(super) fn group<G: SettingsGroup + Default>(&self) -> G {
        let mut group = G::default();
        self.set_group(&mut group);
        group
    }

    /// Overwrites `target` with the value of `key`, if the key is given.
    pub(super) fn set(&self, key: &str, target: &mut f64) {
        *target = self.number(key).unwrap_or(*target);
    }

    /// Overwrites the listening address of a server, if it is given.
    pub(super) fn set_address(&self, address: &mut IpAddr) -> Result<(), StationError> {
        if let Some(text) = self.text("address") {
            *address = text.parse().map_err(|_| self.wrong_text("address", text, LISTEN_ADDRESS))?;
        }
        Ok(())
    }

    /// Error for a text that `key` does not accept.
    pub(super) fn wrong_text(&self, key: &str, found: &str, accepts: &'static str) -> StationError {
        StationError::Value {
            key: format!("{}.{key}", self.table),
            found: format!("\"{found}\""),
            accepts: Accepts::Text(accepts),
            suggestion: String::new(),
        }
    }

    /// Refuses the first of `keys` that is given. `reason` says why it does not apply.
    pub(super) fn refuse(&self, keys: &[&str], reason: &str) -> Result<(), StationError> {
        match keys.iter().find(|key| self.has(key)) {
            Some(key) => {
                Err(StationError::NotApplicable { key: format!("{}.{key}", self.table), reason: reason.to_owned() })
            }
            None => Ok(()),
        }
    }
}

/// Removes a table from the file and returns it; `None` if absent.
pub(super) fn take(root: &mut Table, name: &str) -> Result<Option<Table>, StationError> {
    match root.remove(name) {
        None => Ok(None),
        Some(Value::Table(table)) => Ok(Some(table)),
        Some(other) => Err(wrong_type(name.to_owned(), &other, Accepts::Table)),
    }
}

/// Checked values of a table; empty if absent.
pub(super) fn section(root: &mut Table, name: &str) -> Result<Values, StationError> {
    Values::check(name, take(root, name)?.unwrap_or_default())
}

/// Checked values of a table; `None` if the table is absent.
pub(super) fn optional(root: &mut Table, name: &str) -> Result<Option<Values>, StationError> {
    take(root, name)?.map(|values| Values::check(name, values)).transpose()
}

pub(super) fn number(value: &Value) -> Option<f64> {
    value.as_float().or_else(|| value.as_integer().map(|i| i as f64))
}

pub(super) fn wrong_type(key: String, found: &Value, accepts: Accepts) -> StationError {
    StationError::Value { key, found: shown(found), accepts, suggestion: String::new() }
}

/// A value as TOML. Tables and long texts are replaced by the name of their type.
fn shown(value: &Value) -> String {
    let text = value.to_string();
    if value.is_table() || text.chars().count() > 60 { format!("a {}", value.type_str()) } else { text }
}

/// Refuses a path with control characters. For example, the TOML text `"C:\temp"` in double quotes holds a tab.
fn check_path(key: &str, what: &str, text: &str) -> Result<(), StationError> {
    if !what.starts_with("a path") || !text.contains(char::is_control) {
        return Ok(());
    }
    let written: String = text.chars().flat_map(char::escape_default).collect();
    let short = key.rsplit('.').next().unwrap_or(key);
    let reason = format!("it holds a control character; {}", backslashes(short, &written));
    Err(StationError::Text { key: key.to_owned(), reason })
}

fn check_value(table: &str, doc: &KeyDoc, value: &Value) -> Result<(), StationError> {
    let key = || format!("{table}.{}", doc.key);
    let wrong = || wrong_type(key(), value, doc.range);
    let mut suggestion = String::new();
    let accepted = match doc.range {
        // No range contains NaN, so NaN is refused.
        Accepts::Number { min, max } => (min..=max).contains(&number(value).ok_or_else(wrong)?),
        Accepts::Integer { min, max } => (min..=max).contains(&value.as_integer().ok_or_else(wrong)?),
        Accepts::IntegerOrAuto { min, max } => match value.as_str() {
            Some(word) => {
                suggestion = did_you_mean(word, [AUTO]);
                word == AUTO
            }
            None => (min..=max).contains(&value.as_integer().ok_or_else(wrong)?),
        },
        Accepts::Numbers { count, limit } => {
            let array = value.as_array().ok_or_else(wrong)?;
            let numbers = array.iter().map(number).collect::<Option<Vec<_>>>().ok_or_else(wrong)?;
            numbers.len() == count && numbers.iter().all(|n| n.abs() <= limit)
        }
        Accepts::OneOf(words) => {
            let word = value.as_str().ok_or_else(wrong)?;
            suggestion = did_you_mean(word, words.iter().copied());
            words.contains(&word)
        }
        Accepts::AnyOf(words) => {
            let found = value.as_array().ok_or_else(wrong)?;
            let found = found.iter().map(Value::as_str).collect::<Option<Vec<_>>>().ok_or_else(wrong)?;
            let unknown = found.iter().find(|word| !words.contains(word));
            suggestion = unknown.map_or_else(String::new, |word| did_you_mean(word, words.iter().copied()));
            unknown.is_none()
        }
        Accepts::Text(what) => {
            let text = value.as_str().ok_or_else(wrong)?;
            check_path(&key(), what, text)?;
            !text.is_empty()
        }
        Accepts::Texts(what) => {
            let texts = value.as_array().ok_or_else(wrong)?.iter().map(Value::as_str);
            let texts = texts.collect::<Option<Vec<_>>>().ok_or_else(wrong)?;
            texts.iter().try_for_each(|text| check_path(&key(), what, text))?;
            texts.iter().all(|text| !text.is_empty())
        }
        Accepts::Bool => value.is_bool(),
        Accepts::Table => value.is_table(),
    };
    if accepted {
        return Ok(());
    }
    Err(StationError::Value { key: key(), found: shown(value), accepts: doc.range, suggestion })
}
