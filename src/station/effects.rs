//! `[effects]`: effects that are switched on, off, or left to the effect plan.

use super::values::Values;
use crate::render::{Choice, Effect, EffectChoices};

/// Choices from checked values: every word is one of [`Choice::NAMES`], and maps are never off.
pub(super) fn choices(values: &Values) -> EffectChoices {
    let said = |effect: Effect| values.text(effect.name())?.parse::<Choice>().ok().map(|choice| (effect, choice));
    Effect::ALL
        .into_iter()
        .filter_map(said)
        .fold(EffectChoices::default(), |all, (effect, choice)| all.with(effect, choice))
}

#[cfg(test)]
mod tests {
    use crate::render::{Choice, Effect, EffectChoices};
    use crate::station::tests::{assert_refused, parse};

    #[test]
    fn a_station_forces_effects_by_name() {
        let choices = |lines: &str| parse(&format!("[effects]\n{lines}")).unwrap().settings.effects;
        assert_eq!(choices(""), EffectChoices::default());
        let choices = choices("refraction = \"off\"\nmaps = \"on\"\nmotion = \"auto\"");
        assert_eq!(choices.of(Effect::Refraction), Choice::Off);
        assert_eq!(choices.of(Effect::Maps), Choice::On);
        assert_eq!(choices.of(Effect::Motion), Choice::Auto);
    }

    #[test]
    fn mistakes_are_named_with_what_would_be_right() {
        let lines = [
            ("refraktion = \"off\"", ["refraktion", "did you mean `refraction`?"]),
            ("refraction = \"of\"", ["effects.refraction", "\"off\""]),
            ("refraction = false", ["effects.refraction", "one of"]),
            ("maps = \"off\"", ["effects.maps", "one of \"auto\", \"on\""]),
        ];
        assert_refused("effects", &lines);
    }
}
