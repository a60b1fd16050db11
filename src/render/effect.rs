//! Effects by name, and what a station says of each.

use std::fmt;
use std::str::FromStr;

use serde::{Serialize, Serializer};

use crate::suggest::did_you_mean;

/// What a frame may or may not need.
#[derive(Debug, Clone, Copy, PartialEq, Eq, Hash)]
pub enum Effect {
    /// Snell's law: paths bend, and turn back beyond the critical angle, where the speed of sound changes.
    Refraction,
    /// A slow or fast medium displaces what lies behind it: time of flight by each medium's speed, not by 1540 m/s.
    SpeedDisplacement,
    /// Echoes of the places where the medium changes.
    InterfaceEchoes,
    /// Microfacets of rough interfaces, which spread their echoes and reflections.
    Roughness,
    /// Echoes spread over the thickness of an interface.
    Thickness,
    /// Paths that reflect: mirror images, reverberation.
    Reflections,
    /// Several rays for each scanline and layer.
    Rays,
    /// Several planes across the thickness of the slice.
    Layers,
    /// Loss along the path.
    Attenuation,
    /// Attenuation by a power of the frequency other than 1.
    FrequencyExponent,
    /// Speckle.
    Scatterers,
    /// Parts that move against each other, and drift of the whole scene.
    Motion,
    /// Segmentation and attenuation beside the image.
    Maps,
}

impl Effect {
    /// How many there are.
    pub const COUNT: usize = 13;

    /// Every effect, in the order of tables.
    pub const ALL: [Self; Self::COUNT] = [
        Self::Refraction,
        Self::SpeedDisplacement,
        Self::InterfaceEchoes,
        Self::Roughness,
        Self::Thickness,
        Self::Reflections,
        Self::Rays,
        Self::Layers,
        Self::Attenuation,
        Self::FrequencyExponent,
        Self::Scatterers,
        Self::Motion,
        Self::Maps,
    ];

    /// Names of all, in their order.
    pub const NAMES: [&'static str; Self::COUNT] = [
        "refraction",
        "speed_displacement",
        "interface_echoes",
        "roughness",
        "thickness",
        "reflections",
        "rays",
        "layers",
        "attenuation",
        "frequency_exponent",
        "scatterers",
        "motion",
        "maps",
    ];

    /// Its name in station files and on the command line.
    pub const fn name(self) -> &'static str {
        Self::NAMES[self as usize]
    }
}

impl fmt::Display for Effect {
    fn fmt(&self, f: &mut fmt::Formatter<'_>) -> fmt::Result {
        f.pad(self.name())
    }
}

impl FromStr for Effect {
    type Err = String;

    fn from_str(text: &str) -> Result<Self, String> {
        Self::ALL.into_iter().find(|effect| effect.name() == text).ok_or_else(|| {
            let suggestion = did_you_mean(text, Self::NAMES);
            format!("`{text}` is no effect{suggestion}; effects are {}", Self::NAMES.join(", "))
        })
    }
}

impl Serialize for Effect {
    fn serialize<S: Serializer>(&self, serializer: S) -> Result<S::Ok, S::Error> {
        serializer.serialize_str(self.name())
    }
}

/// What a station says of an effect.
#[derive(Debug, Clone, Copy, Default, PartialEq, Eq, Serialize)]
#[serde(rename_all = "lowercase")]
pub enum Choice {
    /// As the scene calls for.
    #[default]
    Auto,
    /// Simulated in any case.
    On,
    /// Left out in any case.
    Off,
}

impl Choice {
    /// The words of the choices.
    pub const WORDS: &'static [&'static str] = &["auto", "on", "off"];
}

impl FromStr for Choice {
    type Err = String;

    fn from_str(text: &str) -> Result<Self, String> {
        match text {
            "auto" => Ok(Self::Auto),
            "on" => Ok(Self::On),
            "off" => Ok(Self::Off),
            _ => Err(format!("`{text}` is none of auto, on, off")),
        }
    }
}

/// What a station says of every effect.
#[derive(Debug, Clone, Copy, Default, PartialEq, Eq)]
pub struct EffectChoices([Choice; Effect::COUNT]);

impl EffectChoices {
    /// Every effect simulated, whether the scene calls for it or not.
    pub const ALL_ON: Self = Self([Choice::On; Effect::COUNT]);

    /// What is said of `effect`.
    pub const fn of(&self, effect: Effect) -> Choice {
        self.0[effect as usize]
    }

    /// Says `choice` of `effect`.
    ///
    /// # Errors
    /// `maps` off: the maps are left out wherever nothing reads them, and needed wherever something does.
    pub fn set(&mut self, effect: Effect, choice: Choice) -> Result<(), String> {
        if (effect, choice) == (Effect::Maps, Choice::Off) {
            return Err(
                "maps can be `auto` or `on`: they are left out by themselves wherever no sink and no generator \
                        reads them"
                    .to_owned(),
            );
        }
        self.0[effect as usize] = choice;
        Ok(())
    }

    /// These with `choice` for `effect`; as [`EffectChoices::set`], a refused one is left as it was.
    #[must_use]
    pub fn with(mut self, effect: Effect, choice: Choice) -> Self {
        let _ = self.set(effect, choice);
        self
    }
}

/// A set of effects.
#[derive(Debug, Clone, Copy, Default, PartialEq, Eq)]
pub struct EffectSet(u16);

impl EffectSet {
    /// Whether `effect` is in it.
    pub const fn has(self, effect: Effect) -> bool {
        self.0 >> effect as u16 & 1 == 1
    }

    /// This set and `effect`.
    #[must_use]
    pub const fn and(self, effect: Effect) -> Self {
        Self(self.0 | 1 << effect as u16)
    }

    /// This set without `effect`.
    #[must_use]
    pub const fn without(self, effect: Effect) -> Self {
        Self(self.0 & !(1 << effect as u16))
    }

    /// The effects in it, in their order.
    pub fn iter(self) -> impl Iterator<Item = Effect> {
        Effect::ALL.into_iter().filter(move |&effect| self.has(effect))
    }
}

impl FromIterator<Effect> for EffectSet {
    fn from_iter<T: IntoIterator<Item = Effect>>(effects: T) -> Self {
        effects.into_iter().fold(Self::default(), Self::and)
    }
}

#[cfg(test)]
mod tests {
    use super::*;

    #[test]
    fn every_effect_has_its_name_and_its_place() {
        for (i, effect) in Effect::ALL.into_iter().enumerate() {
            assert_eq!(effect as usize, i);
            assert_eq!(effect.name().parse(), Ok(effect));
        }
        assert!("refractoin".parse::<Effect>().unwrap_err().contains("did you mean `refraction`?"));
    }

    #[test]
    fn maps_are_never_forced_off() {
        let mut choices = EffectChoices::default();
        assert!(choices.set(Effect::Maps, Choice::Off).is_err());
        assert_eq!(choices.of(Effect::Maps), Choice::Auto);
        assert_eq!(choices.set(Effect::Maps, Choice::On), Ok(()));
        assert_eq!(choices.of(Effect::Maps), Choice::On);
    }
}
