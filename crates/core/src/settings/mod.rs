//! All settings of probe, image, quality, effects and live session, each defined once.
//!
//! A block of `settings!` in `probe.rs`, `image.rs`, `quality.rs`, `scene.rs`, `tracker.rs`, … defines a setting: its
//! key, type, default, unit, range, documentation, the work that a change needs, and its control on live displays.
//! Everything else is derived from these blocks: station keys and their checks, `insonify station-keys`, the page's
//! controls, hot keys, live controls, recorded settings and their replay, and the parts that a renderer rebuilds.

mod apodization;
mod backend;
mod browser;
mod contact;
mod control;
mod effect;
mod filter;
mod generator;
mod group;
mod hot_keys;
mod image;
mod live;
mod live_control;
mod look;
pub mod mark;
mod needle;
mod offered;
mod origin;
mod pipeline;
mod precision;
mod presets;
mod probe;
mod provider;
mod quality;
mod recorded;
mod samples;
mod scene;
mod setting;
mod tracker;
mod uniform;
mod window;

pub use apodization::Apodization;
pub use backend::{BackendChoice, BackendSettings, UnknownBackend, UnknownBackendVariable};
pub use browser::{BrowserSettings, TOKEN_CHARS_MIN};
pub use contact::{ContactSettings, ReceiverSettings};
pub use control::{Assignment, Control};
pub use effect::{Choice, Effect, EffectChoices, EffectSet};
pub use filter::FilterSettings;
pub use generator::GeneratorSettings;
pub use group::SettingsGroup;
pub use group::{check_own, settings};
pub use hot_keys::QUALITY_POINTS;
pub use hot_keys::{Action, Display, HotKey, QualityPointKey, hot_key, hot_keys};
pub use image::TGC_SLIDERS;
pub use image::{ImageSettings, ImageUniforms};
pub use live::LiveSettings;
pub use live::live_settings;
pub use live_control::{LiveControl, Slider, StepKey};
pub use look::{ANGLES_MAX, GreyMap, LookBase, LookPreset, LookSettings};
pub use mark::{Mark, MarkContent, MarkError};
pub use needle::{NeedleKind, NeedleSettings};
pub use offered::check_offered;
pub use origin::{NotAnOrigin, Origin};
pub use pipeline::{ChoiceSettings, PipelineSettings};
pub use precision::Precision;
pub use presets::{Preset, exams, looks, preset};
pub use probe::{Face, Probe, ProbeKind, SAMPLES_MAX};
pub use provider::Provider;
pub use quality::{BEAM_TAPS_MAX, PULSE_TAPS_MAX};
pub use quality::{Quality, RenderSettings};
pub use samples::Samples;
pub use scene::{
    FAT_RANGE_MM, FLEXION_RANGE, FLUID_INDEX_RANGE_MM, Lie, PlacentaSite, ROLL_RANGE_DEG, SCALE_RANGE, SceneSettings,
    WEEKS_RANGE, Wall,
};
pub(crate) use setting::stored_word;
pub use setting::{AUTO, Change, Kind, Setting, SettingsError, Stored};
pub use tracker::PUCK_RANGE;
pub use tracker::{Repeat, ReplyFormat, TrackerSettings};
pub use uniform::{Uniform, wgsl_readers};
pub use window::WindowSettings;

#[cfg(test)]
mod tests {
    use super::*;

    #[test]
    fn live_keys_are_unique_and_defaults_lie_in_their_ranges() {
        let live: Vec<_> = live_settings().collect();
        let default = LiveSettings::default();
        for (i, setting) in live.iter().enumerate() {
            assert!(live[..i].iter().all(|other| other.key != setting.key), "{}", setting.path);
            setting.check_stored(default.stored(setting.key).unwrap()).unwrap();
            assert!(setting.doc.ends_with('.') && !setting.doc.contains('\n'), "{}: one sentence", setting.path);
        }
        default.validate().unwrap();
    }

    #[test]
    fn sliders_lie_in_the_ranges_of_their_settings() {
        for setting in live_settings() {
            let control = setting.control.as_ref().unwrap();
            let Some(slider) = control.slider else { continue };
            assert!(
                setting.min <= slider.min && slider.min < slider.max && slider.max <= setting.max,
                "{}",
                setting.path
            );
            assert!(slider.min <= setting.default && setting.default <= slider.max, "{}", setting.path);
            let steps = (setting.default - slider.min) / slider.step;
            assert!((steps - steps.round()).abs() < 1e-9, "{}: the default is no step", setting.path);
            assert!(!control.label.is_empty());
        }
    }

    #[test]
    fn a_change_needs_the_most_that_any_setting_of_it_needs() {
        let begin = LiveSettings::default();
        assert_eq!(begin.change_to(&begin), Change::Nothing);
        for setting in live_settings() {
            let mut changed = begin;
            let stored = changed.stored_mut(setting.key).unwrap();
            stored.set(setting.count() - 1, if setting.default == setting.min { setting.max } else { setting.min });
            assert_eq!(begin.change_to(&changed), setting.change, "{}", setting.path);
        }
        let mut changed = begin;
        (changed.render.image.gain_db, changed.probe.depth_mm) = (3.0, 90.0);
        assert_eq!(begin.change_to(&changed), Change::Tables);
        changed.render.lines = true;
        assert_eq!(begin.change_to(&changed), Change::Everything);
    }
}
