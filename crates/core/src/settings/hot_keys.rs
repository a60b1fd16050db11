//! Keyboard keys of the live displays. The keys of a single setting are defined with the setting.

use std::sync::LazyLock;

use serde::Serialize;

use super::{
    Assignment, Kind, LiveSettings, Quality, Setting, SettingsGroup as _, StepKey, exams, live_settings, looks, preset,
};

/// Action of a key.
#[derive(Debug, Clone, Copy, PartialEq, Serialize)]
#[serde(rename_all = "snake_case")]
pub enum Action {
    /// Steps a live setting, or toggles a switch.
    Step {
        /// Key of the setting.
        setting: &'static str,
        /// Step that one press adds to the value.
        by: f64,
        /// Limit that steps don't pass; serialized as null if infinite.
        until: f64,
    },
    /// Sets every TGC slider to 0 dB.
    TgcReset,
    /// Sets the numbers of rays and layers.
    Quality {
        /// Number of rays per scanline and layer.
        rays: u32,
        /// Number of elevational layers: sections across the thickness of the beam.
        layers: u32,
    },
    /// Sets all values of a preset, by its name.
    Preset(&'static str),
    /// Switches between full screen and a window.
    FullScreen,
    /// Shows the list of keys.
    Help,
    /// Ends the session.
    Quit,
    /// Action that only the page has, by its name in `app.js`.
    Page(&'static str),
}

/// A kind of live display; some keys work on one of them only.
#[derive(Debug, Clone, Copy, PartialEq, Eq)]
pub enum Display {
    /// The page in a browser.
    Page,
    /// The native window.
    Window,
}

/// A keyboard key and its action.
#[derive(Debug, Clone, PartialEq, Serialize)]
pub struct HotKey {
    /// Names of the key as in the W3C's `KeyboardEvent.key`; letters in lower case.
    pub keys: Vec<&'static str>,
    /// Name of the key in lists, printable ASCII.
    pub shown: &'static str,
    /// Meaning of the key in lists, printable ASCII.
    pub meaning: &'static str,
    /// Action of the key.
    pub action: Action,
}

impl HotKey {
    /// Whether the key works on `display`.
    pub fn works_on(&self, display: Display) -> bool {
        match self.action {
            Action::Page(_) => display == Display::Page,
            Action::Quit => display == Display::Window,
            _ => true,
        }
    }
}

/// A quality (numbers of rays and layers) with its own key and button.
#[derive(Debug, Clone, Copy, PartialEq, Serialize)]
pub struct QualityPointKey {
    /// Name on the button.
    pub label: &'static str,
    /// Key that sets the quality.
    pub key: &'static str,
    /// Meaning of the key in lists.
    pub meaning: &'static str,
    /// Number of rays per scanline and layer.
    pub rays: u32,
    /// Number of elevational layers.
    pub layers: u32,
}

const fn point(
    label: &'static str,
    key: &'static str,
    meaning: &'static str,
    rays: u32,
    layers: u32,
) -> QualityPointKey {
    QualityPointKey { label, key, meaning, rays, layers }
}

/// Qualities that have their own key and button.
pub static QUALITY_POINTS: [QualityPointKey; 3] = [
    point("LQ", "1", "low quality, 1x1", Quality::LQ.rays, Quality::LQ.layers),
    point("Mid", "2", "4x3", 4, 3),
    point("HQ", "3", "high quality, 32x3", Quality::HQ.rays, Quality::HQ.layers),
];

fn key(keys: &[&'static str], shown: &'static str, meaning: &'static str, action: Action) -> HotKey {
    HotKey { keys: keys.to_vec(), shown, meaning, action }
}

/// All keyboard keys; keys of single settings come first.
pub fn hot_keys() -> &'static [HotKey] {
    static HOT_KEYS: LazyLock<Vec<HotKey>> = LazyLock::new(|| {
        let of_settings = live_settings().filter_map(|setting| Some((setting, setting.control.as_ref()?)));
        let steps = of_settings.flat_map(|(setting, control)| control.keys.iter().map(|step| of_step(setting, step)));
        let points = QUALITY_POINTS.iter().map(|point| {
            let &QualityPointKey { rays, layers, .. } = point;
            key(&[point.key], point.key, point.meaning, Action::Quality { rays, layers })
        });
        let others = [
            key(&["t"], "T", "TGC sliders to 0", Action::TgcReset),
            key(&["s"], "S", "tissues", Action::Page("segmentation")),
            key(&["a"], "A", "attenuation", Action::Page("attenuation")),
            key(&["c"], "C", "measure: distance, ellipse, angle", Action::Page("caliper")),
            key(&["delete"], "Del", "remove measurements and texts", Action::Page("caliper_clear")),
            key(&["backspace"], "Backspace", "remove the last measurement or text", Action::Page("mark_undo")),
            key(&["escape"], "Esc", "put the tool away", Action::Page("put_away")),
            key(&["x"], "X", "write a text on the picture", Action::Page("annotate")),
            key(&["b"], "B", "next body mark", Action::Page("body_mark")),
            key(&["g"], "G", "turn the probe on the body mark", Action::Page("body_mark_turn")),
            key(&["i"], "I", "invert left and right", Action::Page("invert_x")),
            key(&["u"], "U", "invert up and down", Action::Page("invert_y")),
            key(&["r"], "R", "record a clip, end it", Action::Page("record")),
            key(&["l"], "L", "save the cine loop as a clip", Action::Page("save_loop")),
            key(&["v"], "V", "3-D view of the scene", Action::Page("scene")),
            key(&["p"], "P", "save picture and measurements", Action::Page("save")),
            key(&["f"], "F", "full screen", Action::FullScreen),
            key(&["?", "h"], "?", "this list", Action::Help),
            key(&["q"], "Q", "end the session", Action::Quit),
        ];
        let presets = exams()
            .iter()
            .chain(looks())
            .map(|preset| key(&[preset.key], preset.key, preset.meaning, Action::Preset(preset.name)));
        steps.chain(points).chain(presets).chain(others).collect()
    });
    &HOT_KEYS
}

fn of_step(setting: &Setting, step: &StepKey) -> HotKey {
    let action = Action::Step { setting: setting.key, by: step.by, until: step.until };
    key(&[step.key], step.shown, step.meaning, action)
}

/// Action of the key called `name` on a display; `None` if it has none there. The name may have any case.
pub fn hot_key(display: Display, name: &str) -> Option<Action> {
    let found = hot_keys().iter().find(|hot| hot.keys.iter().any(|key| key.eq_ignore_ascii_case(name)));
    found.filter(|hot| hot.works_on(display)).map(|hot| hot.action)
}

impl Action {
    /// Assignments by which the action changes `settings`; empty if it changes no setting. Values are clamped to their
    /// ranges.
    pub fn assignments(self, settings: &LiveSettings) -> Vec<Assignment> {
        match self {
            Self::Step { setting: key, by, until } => {
                let found = live_settings().find(|setting| setting.key == key).zip(settings.stored(key));
                found
                    .map(|(setting, stored)| Assignment::new(key, stepped(setting, stored.get(0), by, until)))
                    .into_iter()
                    .collect()
            }
            Self::TgcReset => (0..super::TGC_SLIDERS)
                .map(|index| Assignment { index, ..Assignment::new("tgc_sliders_db", 0.0) })
                .collect(),
            Self::Quality { rays, layers } => {
                vec![Assignment::new("rays", rays.into()), Assignment::new("layers", layers.into())]
            }
            Self::Preset(name) => preset(name).map(|preset| preset.values.clone()).unwrap_or_default(),
            Self::FullScreen | Self::Help | Self::Quit | Self::Page(_) => Vec::new(),
        }
    }
}

fn stepped(setting: &Setting, value: f64, by: f64, until: f64) -> f64 {
    let next = match setting.kind {
        Kind::Switch => 1.0 - value,
        _ if by < 0.0 => (value + by).max(until),
        _ => (value + by).min(until),
    };
    next.clamp(setting.min, setting.max)
}

#[cfg(test)]
mod tests {
    use super::*;

    fn press(name: &str, settings: &mut LiveSettings) -> Vec<Assignment> {
        let assignments = hot_key(Display::Window, name).unwrap().assignments(settings);
        *settings = settings.with(&assignments).unwrap();
        assignments
    }

    #[test]
    fn keys_go_on_from_the_value_asked_for() {
        let mut settings = LiveSettings::default();
        let mut asked = Vec::new();
        for name in ["ArrowUp", "ArrowUp", " ", "PAGEDOWN"] {
            asked.extend(press(name, &mut settings));
        }
        let expected = [("gain_db", 1.0), ("gain_db", 2.0), ("frozen", 1.0), ("depth_mm", 160.0)];
        assert_eq!(asked, expected.map(|(key, value)| Assignment::new(key, value)));
        press("3", &mut settings);
        assert_eq!(settings.render.quality, Quality::HQ);
        settings.render.image.tgc_sliders_db = [3.0; 8];
        assert_eq!(press("T", &mut settings).len(), 8);
        assert_eq!(settings.render.image.tgc_sliders_db, [0.0; 8]);
    }

    #[test]
    fn every_key_keeps_its_setting_in_range() {
        for hot in hot_keys() {
            let mut settings = LiveSettings::default();
            for _ in 0..1000 {
                settings = settings.with(&hot.action.assignments(&settings)).unwrap();
            }
            settings.validate().unwrap();
        }
    }

    #[test]
    fn each_key_has_one_meaning_and_each_display_its_own() {
        let names: Vec<_> = hot_keys().iter().flat_map(|hot| &hot.keys).collect();
        for (i, name) in names.iter().enumerate() {
            assert!(!names[..i].contains(name) && name.to_ascii_lowercase().len() == name.len(), "{name}");
        }
        assert_eq!(hot_key(Display::Window, "x"), None);
        assert_eq!((hot_key(Display::Window, "s"), hot_key(Display::Page, "q")), (None, None));
        assert_eq!(hot_key(Display::Page, "Backspace"), Some(Action::Page("mark_undo")));
    }

    #[test]
    fn the_depth_stays_where_a_scale_can_show_it() {
        let mut settings = LiveSettings::default();
        (0..100).for_each(|_| drop(press("PageUp", &mut settings)));
        assert_eq!(settings.probe.depth_mm, 10.0);
    }
}
