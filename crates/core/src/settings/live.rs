//! Settings of a running session, and the list of settings that can be changed.

use super::live_control::toggle;
use super::{ImageSettings, Kind, LookSettings, Probe, Quality, RenderSettings, Setting, SettingsGroup, settings};

settings! {
    /// Settings of a running session. Only settings with a [`LiveControl`](super::LiveControl) can be changed.
    #[derive(Debug, Clone, Copy, PartialEq)]
    pub struct LiveSettings in "session" {
        /// Whether the picture is frozen.
        frozen: bool = false, "", 0.0..=1.0, Nothing, toggle("Freeze").key(" ", "Space", "freeze, unfreeze", 1.0);

        /// Whether the generator may run.
        generator: bool = true, "", 0.0..=1.0, Nothing, toggle("Generator").key("e", "E", "generator on, off", 1.0);
    }
    nested {
        /// Probe.
        probe: Probe,
        /// Settings of the renderer.
        render: RenderSettings,
    }
}

impl LiveSettings {
    /// Whether two frames of the same pose are equal, one with these settings and one with `other`.
    pub fn same_picture(&self, other: &Self) -> bool {
        (&self.probe, &self.render) == (&other.probe, &other.render)
    }

    /// Captions of the live settings that have one, for example `Depth 15.0 cm`, then the quality, for example `8x1`.
    pub fn captions(&self) -> Vec<String> {
        let of_settings = live_settings().filter_map(|setting| {
            let control = setting.control.as_ref().filter(|control| !control.caption.is_empty())?;
            let value = self.stored(setting.key)?.get(0);
            if let Kind::Word(words) = setting.kind {
                return Some(format!("{} {}", control.caption, words.get(value as usize)?));
            }
            let value = control.scale * value;
            let unit = control.unit.unwrap_or(setting.unit);
            Some(format!("{} {value:.*} {unit}", control.caption, control.digits))
        });
        let Quality { rays, layers, .. } = self.render.quality;
        of_settings.chain([format!("{rays}x{layers}")]).collect()
    }
}

/// Settings that can be changed while a session runs, in display order. Their keys without the table are unique.
pub fn live_settings() -> impl Iterator<Item = &'static Setting> {
    let groups = [
        ImageSettings::settings(),
        LookSettings::settings(),
        Probe::settings(),
        Quality::settings(),
        RenderSettings::settings(),
        LiveSettings::settings(),
    ];
    groups.into_iter().flatten().filter(|setting| setting.control.is_some())
}

#[cfg(test)]
mod tests {
    use super::*;

    #[test]
    fn captions_show_the_values_as_the_controls_do() {
        let captions = LiveSettings::default().captions();
        let expected = [
            "Gain 0 dB",
            "DR 60 dB",
            "TGC 8.0 dB/cm",
            "Compound 1 angles",
            "Map linear",
            "Depth 15.0 cm",
            "Focus 7.0 cm",
            "1x1",
        ];
        assert_eq!(captions, expected);
    }

    #[test]
    fn pictures_differ_by_all_but_the_switches() {
        let begin = LiveSettings::default();
        for setting in live_settings() {
            let mut changed = begin;
            let stored = changed.stored_mut(setting.key).unwrap();
            stored.set(0, if setting.default == setting.min { setting.max } else { setting.min });
            assert_eq!(begin.same_picture(&changed), !setting.is_of_picture(), "{}", setting.key);
        }
    }
}
