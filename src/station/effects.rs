//! `[effects]`: what is simulated whatever the plan finds.

use super::values::Values;
use crate::render::{Choice, Effect, EffectChoices};

/// The choices of checked values: every word is one of [`Choice::WORDS`], and maps are never off.
pub(super) fn choices(values: &Values) -> EffectChoices {
    let said = |effect: Effect| values.text(effect.name())?.parse::<Choice>().ok().map(|choice| (effect, choice));
    Effect::ALL
        .into_iter()
        .filter_map(said)
        .fold(EffectChoices::default(), |all, (effect, choice)| all.with(effect, choice))
}

#[cfg(test)]
mod tests {
    use std::path::Path;

    use crate::render::{Choice, Effect, EffectChoices};
    use crate::station::{Station, StationError};

    fn parse(table: &str) -> Result<EffectChoices, StationError> {
        let text = format!("[scene]\npath = \"a.glb\"\n[effects]\n{table}");
        Station::parse(&text, Path::new("/station")).map(|station| station.settings.effects)
    }

    #[test]
    fn a_station_forces_effects_by_name() {
        assert_eq!(parse("").unwrap(), EffectChoices::default());
        let choices = parse("refraction = \"off\"\nmaps = \"on\"\nmotion = \"auto\"").unwrap();
        assert_eq!(choices.of(Effect::Refraction), Choice::Off);
        assert_eq!(choices.of(Effect::Maps), Choice::On);
        assert_eq!(choices.of(Effect::Motion), Choice::Auto);
    }

    #[test]
    fn what_is_wrong_is_named_with_what_would_be_right() {
        for (line, words) in [
            ("refraktion = \"off\"", ["refraktion", "did you mean `refraction`?"]),
            ("refraction = \"of\"", ["effects.refraction", "\"off\""]),
            ("refraction = false", ["effects.refraction", "one of"]),
            ("maps = \"off\"", ["effects.maps", "one of \"auto\", \"on\""]),
        ] {
            let error = parse(line).unwrap_err().to_string();
            assert!(words.iter().all(|word| error.contains(word)), "{line}: {error}");
        }
    }
}
