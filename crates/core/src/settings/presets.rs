//! Presets: values of several live settings at once, by name.

use std::sync::LazyLock;

use serde::Serialize;

use super::{Assignment, LookPreset, LookSettings, SettingsGroup as _, TGC_SLIDERS};

/// A preset: values of several live settings at once.
#[derive(Debug, Clone, PartialEq, Serialize)]
pub struct Preset {
    /// Name of the preset, one word.
    pub name: &'static str,
    /// Name on the preset's button.
    pub label: &'static str,
    /// Keyboard key of the preset.
    pub key: &'static str,
    /// Meaning of the key in lists, printable ASCII.
    pub meaning: &'static str,
    /// Values that the preset sets.
    pub values: Vec<Assignment>,
}

/// Presets of the post-processing; each sets every setting of `[look]`.
pub fn looks() -> &'static [Preset] {
    static LOOKS: LazyLock<Vec<Preset>> = LazyLock::new(|| {
        let of = |look: LookPreset, label, key, meaning| Preset {
            name: look.name(),
            label,
            key,
            meaning,
            values: values_of(&look.settings()),
        };
        vec![
            of(LookPreset::Raw, "Raw", "7", "look: what the lines hold"),
            of(LookPreset::Survey, "Survey", "8", "look: calm, for finding one's way"),
            of(LookPreset::Detail, "Detail", "9", "look: fine structures at rest"),
        ]
    });
    &LOOKS
}

/// Presets for exams; each sets depth, focus, contrast, TGC and post-processing.
pub fn exams() -> &'static [Preset] {
    static EXAMS: LazyLock<Vec<Preset>> = LazyLock::new(|| {
        let deep = [-4.0, 4.0, 12.0, 12.0, 8.0, 0.0, -8.0, -14.0];
        vec![
            exam(
                "obstetric",
                "OB",
                "4",
                "exam: obstetric",
                (150.0, 70.0, 66.0, 7.0),
                deep,
                LookPreset::Survey.settings(),
            ),
            exam(
                "fetal_heart",
                "Fetal heart",
                "5",
                "exam: fetal heart",
                (110.0, 60.0, 54.0, 7.0),
                [-2.0, 4.0, 10.0, 12.0, 10.0, 6.0, 0.0, -4.0],
                LookSettings { persistence: 0.0, edge_enhancement: 0.3, ..LookPreset::Survey.settings() },
            ),
            exam(
                "near",
                "Near",
                "6",
                "exam: near structures",
                (60.0, 25.0, 60.0, 7.0),
                [0.0; TGC_SLIDERS],
                LookPreset::Detail.settings(),
            ),
        ]
    });
    &EXAMS
}

/// Preset called `name`; `None` if there is none.
pub fn preset(name: &str) -> Option<&'static Preset> {
    looks().iter().chain(exams()).find(|preset| preset.name == name)
}

/// Preset for an exam. The numbers are depth and focus (mm), dynamic range (dB) and TGC slope (dB/cm); `look` is the
/// post-processing.
fn exam(
    name: &'static str,
    label: &'static str,
    key: &'static str,
    meaning: &'static str,
    (depth_mm, focus_mm, dynamic_range_db, tgc_db_per_cm): (f64, f64, f64, f64),
    sliders_db: [f64; TGC_SLIDERS],
    look: LookSettings,
) -> Preset {
    let mut values = vec![
        Assignment::new("depth_mm", depth_mm),
        Assignment::new("focus_mm", focus_mm),
        Assignment::new("dynamic_range_db", dynamic_range_db),
        Assignment::new("tgc_db_per_cm", tgc_db_per_cm),
    ];
    let slider = |(index, db): (usize, f64)| Assignment { index, ..Assignment::new("tgc_sliders_db", db) };
    values.extend(sliders_db.into_iter().enumerate().map(slider));
    values.extend(values_of(&look));
    Preset { name, label, key, meaning, values }
}

fn values_of(look: &LookSettings) -> Vec<Assignment> {
    let value = |key: &str| Some(Assignment::new(key, look.stored(key)?.get(0)));
    LookSettings::settings().iter().filter_map(|setting| value(setting.key)).collect()
}

#[cfg(test)]
mod tests {
    use super::*;
    use crate::settings::LiveSettings;

    #[test]
    fn presets_are_within_the_ranges_and_change_something() {
        let mut names = Vec::new();
        for preset in looks().iter().chain(exams()) {
            let settings = LiveSettings::default().with(&preset.values).unwrap();
            settings.validate().unwrap();
            assert!(!names.contains(&preset.name), "{}", preset.name);
            names.push(preset.name);
        }
        let survey = LiveSettings::default().with(&preset("survey").unwrap().values).unwrap();
        assert_eq!(survey.render.look, LookPreset::Survey.settings());
        let raw = survey.with(&preset("raw").unwrap().values).unwrap();
        assert_eq!(raw.render.look, LookSettings::default());
        assert_eq!(preset("other"), None);
    }
}
