//! Keys of the live station's displays. The page has the same (assets/browser/keys.js).

use super::control::{DEPTH_MM, DYNAMIC_RANGE_DB, FOCUS_MM, GAIN_DB, TGC_SLIDERS};
use super::live::{Control, LiveSettings};
use crate::render::Quality;

/// What a key does.
#[derive(Debug, Clone, Copy, PartialEq)]
pub enum Action {
    /// Freezes or goes on.
    Freeze,
    /// Adds to the gain, dB.
    Gain(f64),
    /// Adds to the dynamic range, dB.
    DynamicRange(f64),
    /// Adds to the depth, mm.
    Depth(f64),
    /// Adds to the focal depth, mm.
    Focus(f64),
    /// Sets every TGC slider to 0 dB.
    TgcReset,
    /// Sets rays and layers.
    Quality(u32, u32),
    /// Lets the generator run, or not.
    Enhance,
    /// Full screen or not.
    FullScreen,
    /// Shows the list of keys.
    Help,
    /// Ends the session.
    Quit,
}

/// A key and what it does.
#[derive(Debug, Clone, Copy, PartialEq)]
pub struct HotKey {
    /// Name of the key as in the W3C's `KeyboardEvent.key`; letters in lower case.
    pub key: &'static str,
    /// How it is shown, printable ASCII.
    pub shown: &'static str,
    /// What it does, in words.
    pub meaning: &'static str,
    /// What it does.
    pub action: Action,
}

const fn key(key: &'static str, shown: &'static str, meaning: &'static str, action: Action) -> HotKey {
    HotKey { key, shown, meaning, action }
}

/// Every key.
pub const HOT_KEYS: &[HotKey] = &[
    key(" ", "Space", "freeze, unfreeze", Action::Freeze),
    key("ArrowUp", "Up", "more gain", Action::Gain(1.0)),
    key("ArrowDown", "Down", "less gain", Action::Gain(-1.0)),
    key("ArrowRight", "Right", "more dynamic range", Action::DynamicRange(2.0)),
    key("ArrowLeft", "Left", "less dynamic range", Action::DynamicRange(-2.0)),
    key("PageDown", "Page down", "deeper", Action::Depth(10.0)),
    key("PageUp", "Page up", "shallower", Action::Depth(-10.0)),
    key("End", "End", "focus deeper", Action::Focus(5.0)),
    key("Home", "Home", "focus nearer", Action::Focus(-5.0)),
    key("t", "T", "TGC sliders to 0", Action::TgcReset),
    key("1", "1", "low quality, 1x1", Action::Quality(Quality::LQ.rays, Quality::LQ.layers)),
    key("2", "2", "4x3", Action::Quality(4, 3)),
    key("3", "3", "high quality, 32x3", Action::Quality(Quality::HQ.rays, Quality::HQ.layers)),
    key("e", "E", "generator on, off", Action::Enhance),
    key("f", "F", "full screen", Action::FullScreen),
    key("?", "?", "this list", Action::Help),
    key("q", "Q", "end the session", Action::Quit),
];

/// The action of a key by its name, in any case.
pub fn action(name: &str) -> Option<Action> {
    HOT_KEYS.iter().find(|hot| hot.key.eq_ignore_ascii_case(name)).map(|hot| hot.action)
}

/// Hands the controls of an action to `each` and makes `settings` what they ask for, so that the next key goes on from
/// there. Values stay in their ranges.
pub fn controls(action: Action, settings: &mut LiveSettings, mut each: impl FnMut(Control)) {
    let step = |value: &mut f64, by: f64, [min, max]: [f64; 2]| {
        *value = (*value + by).clamp(min, max);
        *value
    };
    match action {
        Action::Freeze => {
            settings.frozen = !settings.frozen;
            each(Control::Freeze(settings.frozen));
        }
        Action::Enhance => {
            settings.enhance = !settings.enhance;
            each(Control::Enhance(settings.enhance));
        }
        Action::Gain(by) => each(Control::GainDb(step(&mut settings.image.gain_db, by, GAIN_DB))),
        Action::DynamicRange(by) => {
            each(Control::DynamicRangeDb(step(&mut settings.image.dynamic_range_db, by, DYNAMIC_RANGE_DB)));
        }
        // No shallower than what a scale can show.
        Action::Depth(by) => each(Control::DepthMm(step(&mut settings.depth_mm, by, [10.0, DEPTH_MM[1]]))),
        Action::Focus(by) => each(Control::FocusMm(step(&mut settings.focus_mm, by, FOCUS_MM))),
        Action::TgcReset => {
            settings.image.tgc_sliders_db = [0.0; TGC_SLIDERS];
            (0..TGC_SLIDERS).for_each(|index| each(Control::TgcSlider { index, db: 0.0 }));
        }
        Action::Quality(rays, layers) => {
            (settings.rays, settings.layers) = (rays, layers);
            each(Control::Quality { rays, layers });
        }
        Action::Quit => each(Control::Quit),
        Action::FullScreen | Action::Help => {}
    }
}

#[cfg(test)]
mod tests {
    use super::*;

    #[test]
    fn the_page_has_the_same_keys() {
        let page = include_str!("../../assets/browser/keys.js");
        for hot in HOT_KEYS.iter().filter(|hot| hot.action != Action::Quit) {
            let meaning = hot.meaning.replace("x1", "×1").replace("x3", "×3");
            let line = page.lines().find(|line| line.contains(&format!("[\"{}\"", hot.key)));
            let line = line.unwrap_or_else(|| panic!("keys.js has no {}", hot.key));
            assert!(line.contains(hot.meaning) || line.contains(&meaning), "{line}");
        }
    }

    #[test]
    fn keys_go_on_from_what_was_asked_for_and_stay_in_range() {
        let mut settings = LiveSettings::default();
        let mut asked = Vec::new();
        for name in ["ArrowUp", "ArrowUp", " ", "PAGEDOWN", "3", "T"] {
            controls(action(name).unwrap(), &mut settings, |control| asked.push(control));
        }
        assert_eq!(asked[..3], [Control::GainDb(1.0), Control::GainDb(2.0), Control::Freeze(true)]);
        assert_eq!(asked[3..5], [Control::DepthMm(160.0), Control::Quality { rays: 32, layers: 3 }]);
        assert_eq!(asked.len(), 5 + TGC_SLIDERS);
        for _ in 0..1000 {
            for hot in HOT_KEYS {
                controls(hot.action, &mut settings, |control| control.validate().unwrap());
            }
            controls(Action::Depth(-10.0), &mut settings, |control| control.validate().unwrap());
        }
        assert_eq!(action("x"), None);
    }
}
