//! Live settings as JSON, as in recordings and network messages.

use serde_json::{Map, Value};

use super::{LiveSettings, SettingsGroup as _, live_settings};

/// Keys that recordings of earlier builds have, each with its current name.
const RENAMED: [(&str, &str); 1] = [("enhance", "generator")];

impl LiveSettings {
    /// Values of all live settings, by their keys without the table.
    pub fn to_json(&self) -> Map<String, Value> {
        let values = live_settings().filter_map(|setting| {
            let stored = self.stored(setting.key)?;
            Some((setting.key.to_owned(), setting.to_json(stored)))
        });
        values.collect()
    }

    /// Sets the live setting `key`, which may be its former key in recordings of earlier builds. `None` if there is no
    /// such setting.
    ///
    /// # Errors
    /// A value of another type. The value's range is not checked.
    pub fn read_json(&mut self, key: &str, value: &Value) -> Option<Result<(), String>> {
        let key = RENAMED.iter().find(|(old, _)| *old == key).map_or(key, |(_, new)| new);
        let setting = live_settings().find(|setting| setting.key == key)?;
        Some(setting.read_json(value, self.stored_mut(key)?))
    }

    /// Values of all live settings, in the order of the settings; a switch is 0 or 1.
    pub fn values(&self) -> impl Iterator<Item = f64> {
        live_settings().flat_map(|setting| {
            let stored = self.stored(setting.key);
            (0..setting.count()).map(move |index| stored.map_or(0.0, |stored| stored.get(index)))
        })
    }
}

#[cfg(test)]
mod tests {
    use super::*;

    #[test]
    fn settings_come_back_from_json() {
        let mut settings = LiveSettings { frozen: true, ..LiveSettings::default() };
        settings.render.quality.rays = 7;
        settings.render.image.tgc_sliders_db[2] = -3.25;
        settings.probe.focus_mm = 55.5;
        let mut read = LiveSettings::default();
        for (key, value) in settings.to_json() {
            read.read_json(&key, &value).unwrap().unwrap();
        }
        assert_eq!(read, settings);
        assert_eq!(settings.values().count(), live_settings().map(super::super::Setting::count).sum::<usize>());
    }

    #[test]
    fn keys_of_earlier_builds_are_read() {
        let mut settings = LiveSettings::default();
        settings.read_json("enhance", &false.into()).unwrap().unwrap();
        assert!(!settings.generator);
        for (old, new) in RENAMED {
            let known = |key: &str| live_settings().any(|setting| setting.key == key);
            assert!(known(new) && !known(old), "{old}");
        }
    }

    #[test]
    fn values_of_another_type_change_nothing() {
        let mut settings = LiveSettings::default();
        for (key, value) in [
            ("gain_db", serde_json::json!("3")),
            ("rays", serde_json::json!(1.5)),
            ("rays", serde_json::json!(-1)),
            ("tgc_sliders_db", serde_json::json!([1, 2, 3])),
            ("frozen", serde_json::json!(1)),
        ] {
            assert!(settings.read_json(key, &value).unwrap().unwrap_err().contains(key));
        }
        assert_eq!(settings, LiveSettings::default());
        assert!(settings.read_json("width", &serde_json::json!(100)).is_none(), "no live setting");
    }
}
