//! Controls: requests of a running session's watchers.

use serde::{Deserialize, Serialize};

use super::{LiveSettings, Mark, Setting, SettingsError, SettingsGroup as _, live_settings};

/// A request by a watcher to a running session.
#[derive(Debug, Clone, PartialEq)]
pub enum Control {
    /// Changes settings, all at once.
    Set(Vec<Assignment>),
    /// Puts a mark on a picture, or replaces the mark with the same identifier. The mark has already been checked.
    Mark(Box<Mark>),
    /// Removes marks by their identifiers.
    Unmark(Vec<String>),
    /// Ends the session.
    Quit,
}

/// A new value of a live setting.
#[derive(Debug, Clone, PartialEq, Serialize, Deserialize)]
#[serde(deny_unknown_fields)]
pub struct Assignment {
    /// Key of the setting, without its table.
    pub key: String,
    /// Index of an element in a list, from 0; 0 for single values.
    #[serde(default)]
    pub index: usize,
    /// New value; 0 or 1 for a switch.
    pub value: f64,
}

impl Assignment {
    /// Assigns `value` to the setting `key`.
    pub fn new(key: &str, value: f64) -> Self {
        Self { key: key.to_owned(), index: 0, value }
    }

    /// Checks the assignment and returns its setting.
    ///
    /// # Errors
    /// No live setting with that key; an index or a value out of range.
    pub fn check(&self) -> Result<&'static Setting, SettingsError> {
        let found = live_settings().find(|setting| setting.key == self.key).ok_or_else(|| SettingsError::NotLive {
            key: self.key.clone(),
            known: live_settings().map(|setting| setting.key).collect::<Vec<_>>().join(", "),
        })?;
        if self.index >= found.count() {
            return Err(SettingsError::Element { key: found.path, index: self.index, last: found.count() - 1 });
        }
        found.check(self.value)?;
        Ok(found)
    }
}

impl Control {
    /// Request that sets one setting.
    pub fn set(key: &str, value: impl Into<f64>) -> Self {
        Self::Set(vec![Assignment::new(key, value.into())])
    }
}

impl LiveSettings {
    /// These settings after `assignments`.
    ///
    /// # Errors
    /// The first error of [`Assignment::check`]; then nothing is assigned.
    pub fn with(mut self, assignments: &[Assignment]) -> Result<Self, SettingsError> {
        for assignment in assignments {
            let setting = assignment.check()?;
            if let Some(stored) = self.stored_mut(setting.key) {
                stored.set(assignment.index, assignment.value);
            }
        }
        Ok(self)
    }
}

#[cfg(test)]
mod tests {
    use super::*;

    #[test]
    fn values_out_of_range_are_refused_by_key() {
        let slider = |index, value| Assignment { index, ..Assignment::new("tgc_sliders_db", value) };
        let wrong = [
            (Assignment::new("gain_db", f64::NAN), "image.gain_db"),
            (Assignment::new("dynamic_range_db", 0.0), "image.dynamic_range_db"),
            (Assignment::new("tgc_db_per_cm", -1.0), "image.tgc_db_per_cm"),
            (slider(8, 0.0), "image.tgc_sliders_db"),
            (slider(7, 101.0), "image.tgc_sliders_db"),
            (Assignment::new("depth_mm", f64::INFINITY), "probe.depth_mm"),
            (Assignment::new("focus_mm", 0.0), "probe.focus_mm"),
            (Assignment::new("rays", 0.0), "quality.rays"),
            (Assignment::new("rays", 1.5), "quality.rays"),
            (Assignment::new("layers", 34.0), "quality.layers"),
            (Assignment::new("frozen", 2.0), "session.frozen"),
            (Assignment::new("width", 100.0), "`width`"),
            (Assignment::new("gain", 1.0), "`gain`"),
        ];
        for (assignment, key) in wrong {
            let error = assignment.check().unwrap_err().to_string();
            assert!(error.starts_with(key), "{assignment:?}: {error}");
        }
    }

    #[test]
    fn assignments_take_effect_together_or_not_at_all() {
        let settings = LiveSettings::default();
        let good = [Assignment::new("rays", 4.0), Assignment { index: 7, ..Assignment::new("tgc_sliders_db", -6.0) }];
        let changed = settings.with(&good).unwrap();
        assert_eq!((changed.render.quality.rays, changed.render.image.tgc_sliders_db[7]), (4, -6.0));
        assert!(settings.with(&[good[0].clone(), Assignment::new("layers", 0.0)]).is_err());
    }
}
