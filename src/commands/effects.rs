//! Option `--effect`.

use std::str::FromStr;

use insonify::render::{Choice, Effect, EffectChoices, RenderSettings};

/// Effects that are forced on or off, regardless of the effect plan.
#[derive(Debug, clap::Args)]
pub(crate) struct EffectArgs {
    /// Simulate an effect or omit it, regardless of the effect plan: NAME=on, NAME=off or NAME=auto; may be repeated.
    /// `insonify plan` lists the effects [default: the station's]
    #[arg(long = "effect", value_name = "NAME=CHOICE")]
    effects: Vec<Said>,
}

impl EffectArgs {
    /// Overrides the effect choices in `settings` with the user's.
    pub(crate) fn apply(&self, settings: &mut RenderSettings) {
        for Said { effect, choice } in &self.effects {
            settings.effects = settings.effects.with(*effect, *choice);
        }
    }
}

/// The user's choice for one effect.
#[derive(Debug, Clone, Copy, PartialEq, Eq)]
struct Said {
    effect: Effect,
    choice: Choice,
}

impl FromStr for Said {
    type Err = String;

    fn from_str(text: &str) -> Result<Self, String> {
        let (name, choice) =
            text.split_once('=').ok_or("expected NAME=on, NAME=off or NAME=auto, as `refraction=off`")?;
        let (effect, choice) = (name.trim().parse()?, choice.trim().parse()?);
        EffectChoices::default().set(effect, choice)?;
        Ok(Self { effect, choice })
    }
}

#[cfg(test)]
mod tests {
    use super::*;

    #[test]
    fn an_effect_is_said_by_name() {
        let said = |text: &str| text.parse::<Said>();
        assert_eq!(said("refraction=off"), Ok(Said { effect: Effect::Refraction, choice: Choice::Off }));
        assert_eq!(said("maps = on"), Ok(Said { effect: Effect::Maps, choice: Choice::On }));
        for (wrong, words) in [
            ("refraction", "refraction=off"),
            ("refractoin=off", "did you mean `refraction`?"),
            ("refraction=no", "none of auto, on, off"),
            ("maps=off", "no sink and no generator"),
        ] {
            assert!(said(wrong).unwrap_err().contains(words), "{wrong}");
        }
    }
}
