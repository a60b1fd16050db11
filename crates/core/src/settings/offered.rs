//! Values that live displays offer for settings: by sliders, switches, buttons and presets.

use super::{Assignment, Kind, LiveSettings, QUALITY_POINTS, SettingsError, SettingsGroup as _, exams, looks};

/// Keys of the settings that a quality button sets together.
const QUALITY_KEYS: [&str; 2] = ["rays", "layers"];

/// Checks that some control of a display offers `assignments`. A slider's range is extended to the values in `shown`,
/// the settings that displays have shown so far.
///
/// # Errors
/// The first error of [`Assignment::check`]; a value within its range that no control of a display sets.
pub fn check_offered(assignments: &[Assignment], shown: &[LiveSettings]) -> Result<(), SettingsError> {
    for assignment in assignments {
        check_value(assignment, shown)?;
    }
    let last = |key: &str| assignments.iter().rev().find(|a| a.key == key).map(|a| a.value);
    let asked = QUALITY_KEYS.map(last);
    let of = |rays: u32, layers: u32| [Some(rays.into()), Some(layers.into())];
    let shown = shown.iter().map(|settings| settings.render.quality);
    let is_offered = asked == [None, None]
        || QUALITY_POINTS.iter().any(|point| of(point.rays, point.layers) == asked)
        || shown.map(|quality| of(quality.rays, quality.layers)).any(|quality| quality == asked);
    if is_offered {
        return Ok(());
    }
    let points: Vec<String> = QUALITY_POINTS.iter().map(|point| format!("{}x{}", point.rays, point.layers)).collect();
    let [rays, layers] = asked.map(|value| value.map_or_else(|| "?".to_owned(), |value| value.to_string()));
    let value = format!("{rays}x{layers}");
    Err(SettingsError::NotOffered { key: "quality.rays x quality.layers", value, offered: points.join(", ") })
}

/// Checks one value. Rays and layers are checked only against their ranges.
fn check_value(assignment: &Assignment, shown: &[LiveSettings]) -> Result<(), SettingsError> {
    let setting = assignment.check()?;
    let &Assignment { ref key, index, value } = assignment;
    if setting.kind == Kind::Switch || QUALITY_KEYS.contains(&&**key) {
        return Ok(());
    }
    let was_shown = shown.iter().filter_map(|settings| Some(settings.stored(key)?.get(index)));
    let of_presets = looks().iter().chain(exams()).flat_map(|preset| &preset.values);
    let of_presets = of_presets.filter(|preset| preset.key == *key && preset.index == index).map(|preset| preset.value);
    let values = was_shown.chain(of_presets);
    let (is_offered, offered) = match setting.control.as_ref().and_then(|control| control.slider) {
        Some(slider) => {
            let (min, max) =
                values.fold((slider.min, slider.max), |(min, max), value| (min.min(value), max.max(value)));
            ((min..=max).contains(&value), format!("{min}..={max}"))
        }
        None => {
            let values: Vec<f64> = values.collect();
            (values.contains(&value), values.iter().map(f64::to_string).collect::<Vec<_>>().join(", "))
        }
    };
    let refused = || SettingsError::NotOffered { key: setting.path, value: value.to_string(), offered };
    if is_offered { Ok(()) } else { Err(refused()) }
}

#[cfg(test)]
mod tests {
    use super::*;
    use crate::settings::{Action, Display, hot_keys, live_settings};

    fn check(values: &[(&str, f64)], shown: &[LiveSettings]) -> Result<(), String> {
        let assignments: Vec<_> = values.iter().map(|&(key, value)| Assignment::new(key, value)).collect();
        check_offered(&assignments, shown).map_err(|error| error.to_string())
    }

    #[test]
    fn every_control_of_the_page_is_offered() {
        for preset in looks().iter().chain(exams()) {
            check_offered(&preset.values, &[]).unwrap();
        }
        let begin = LiveSettings::default();
        for hot in hot_keys().iter().filter(|hot| hot.works_on(Display::Page)) {
            // The page stops steps at the ends of its sliders, so steps are not checked here.
            if !matches!(hot.action, Action::Step { .. }) {
                check_offered(&hot.action.assignments(&begin), &[]).unwrap();
            }
        }
        for (setting, slider) in live_settings().filter_map(|s| Some((s, s.control.as_ref()?.slider?))) {
            check(&[(setting.key, slider.min)], &[]).unwrap();
            check(&[(setting.key, slider.max)], &[]).unwrap();
        }
        check(&[("frozen", 1.0), ("generator", 0.0)], &[]).unwrap();
    }

    #[test]
    fn what_no_control_sets_is_refused_by_key() {
        let text = check(&[("rays", 256.0), ("layers", 33.0), ("angles", 9.0)], &[]).unwrap_err();
        assert_eq!(text, "quality.rays x quality.layers is 256x33; the page offers 1x1, 4x3, 32x3");
        assert!(check(&[("rays", 32.0)], &[]).unwrap_err().contains("32x?"), "the buttons set both");
        assert_eq!(check(&[("angles", 15.0)], &[]).unwrap_err(), "look.angles is 15; the page offers 1..=9");
        assert!(check(&[("span_deg", 60.0)], &[]).unwrap_err().starts_with("look.span_deg is 60; the page offers"));
        assert!(check(&[("gain_db", 1e9)], &[]).unwrap_err().contains("-200..=200"), "the range comes first");
    }

    #[test]
    fn a_session_beyond_the_controls_can_be_gone_back_to() {
        let mut station = LiveSettings::default();
        (station.render.quality.rays, station.render.quality.layers) = (64, 5);
        (station.render.look.angles, station.render.look.span_deg) = (15, 50.0);
        check(&[("rays", 64.0), ("layers", 5.0)], &[station]).unwrap();
        check(&[("angles", 13.0), ("span_deg", 50.0)], &[station]).unwrap();
        assert!(check(&[("rays", 64.0), ("layers", 3.0)], &[station]).is_err());
    }
}
