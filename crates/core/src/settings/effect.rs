//! Effects of the simulation by name, and a station's choice for each.

use std::fmt;
use std::str::FromStr;

use serde::{Serialize, Serializer};

use crate::suggest::did_you_mean;

macro_rules! effects {
    ($( #[doc = $doc:literal] $effect:ident = $name:literal; )*) => {
        /// An effect of the simulation, which a frame may or may not need.
        #[derive(Debug, Clone, Copy, PartialEq, Eq, Hash)]
        pub enum Effect {
            $( #[doc = $doc] $effect, )*
        }

        crate::names::named!(Effect { $( $effect = $name ),* });

        impl Effect {
            /// Number of effects.
            pub const COUNT: usize = Self::ALL.len();
            const DOCS: [&'static str; Self::COUNT] = [$( $doc, )*];
        }
    };
}

effects! {
    /// Paths bend where the speed of sound changes (Snell's law), and turn back beyond the critical angle.
    Refraction = "refraction";
    /// Displacement behind slow or fast tissue: time of flight by each medium's speed, not by 1540 m/s.
    SpeedDisplacement = "speed_displacement";
    /// Echoes from the boundaries between media.
    InterfaceEchoes = "interface_echoes";
    /// Microfacets of rough interfaces, which spread their echoes and reflections.
    Roughness = "roughness";
    /// Echoes spread over the thickness of an interface.
    Thickness = "thickness";
    /// Paths that reflect: mirror images, reverberation.
    Reflections = "reflections";
    /// Several rays per scanline and layer; off: one.
    Rays = "rays";
    /// Several elevational layers across the thickness of the slice; off: one.
    Layers = "layers";
    /// A film of gel on the skin, and air beyond it: parts of the face without contact show the probe's reverberation.
    Contact = "contact";
    /// Loss along the path, in the image and in its map.
    Attenuation = "attenuation";
    /// Attenuation proportional to a power of the frequency other than 1.
    FrequencyExponent = "frequency_exponent";
    /// Shadows of a focused aperture, which sees past small obstacles; off: the loss of each path by itself.
    Aperture = "aperture";
    /// Speckle.
    Scatterers = "scatterers";
    /// Scattering that varies within a tissue: clouds, grain, septa.
    Texture = "texture";
    /// Speckle that changes gradually as the probe slides across its slice.
    ElevationalSpeckle = "elevational_speckle";
    /// Clutter near the face.
    Clutter = "clutter";
    /// Multiples: echoes that the face reflects back into the body, which return again deeper.
    Multiples = "multiples";
    /// Noise of the receiver.
    Noise = "noise";
    /// Echo and shadow of the tracked needle.
    Needle = "needle";
    /// Relative motion of parts, and drift of the whole scene.
    Motion = "motion";
    /// Maps of segmentation and attenuation; auto: if a sink or a generator reads them.
    Maps = "maps";
}

impl Effect {
    /// Effects of a body in air and of a scanner. In scenes of specimens, they are off unless the station switches them
    /// on.
    pub const OF_BODIES: [Self; 5] = [Self::Contact, Self::Texture, Self::Clutter, Self::Multiples, Self::Noise];

    /// Documentation of the effect: one sentence.
    pub const fn doc(self) -> &'static str {
        Self::DOCS[self as usize].trim_ascii()
    }

    /// Words that a station file accepts as the choice for the effect; `maps` cannot be off.
    pub fn words(self) -> &'static [&'static str] {
        match self {
            Self::Maps => &["auto", "on"],
            _ => Choice::NAMES,
        }
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
        Self::named(text).ok_or_else(|| {
            let suggestion = did_you_mean(text, Self::NAMES.iter().copied());
            format!("`{text}` is no effect{suggestion}; effects are {}", Self::NAMES.join(", "))
        })
    }
}

impl Serialize for Effect {
    fn serialize<S: Serializer>(&self, serializer: S) -> Result<S::Ok, S::Error> {
        serializer.serialize_str(self.name())
    }
}

/// A station's choice for an effect.
#[derive(Debug, Clone, Copy, Default, PartialEq, Eq, Serialize)]
#[serde(rename_all = "lowercase")]
pub enum Choice {
    /// The effect is simulated if the scene calls for it.
    #[default]
    Auto,
    /// The effect is always simulated.
    On,
    /// The effect is never simulated.
    Off,
}

crate::names::named!(Choice { Auto = "auto", On = "on", Off = "off" });

impl FromStr for Choice {
    type Err = String;

    fn from_str(text: &str) -> Result<Self, String> {
        Self::named(text).ok_or_else(|| format!("`{text}` is none of {}", Self::NAMES.join(", ")))
    }
}

/// A station's choices for all effects.
#[derive(Debug, Clone, Copy, Default, PartialEq, Eq)]
pub struct EffectChoices([Choice; Effect::COUNT]);

impl EffectChoices {
    /// Every effect forced on, except those in [`Effect::OF_BODIES`], which keep [`Choice::Auto`].
    pub const ALL_ON: Self = {
        let mut choices = [Choice::On; Effect::COUNT];
        let mut i = 0;
        while i < Effect::OF_BODIES.len() {
            choices[Effect::OF_BODIES[i] as usize] = Choice::Auto;
            i += 1;
        }
        Self(choices)
    };

    /// Choice for `effect`.
    pub const fn of(&self, effect: Effect) -> Choice {
        self.0[effect as usize]
    }

    /// Sets the choice for `effect`.
    ///
    /// # Errors
    /// `maps` off: maps are omitted automatically if nothing reads them.
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

    /// These choices with `choice` for `effect`; unchanged if [`EffectChoices::set`] refuses it.
    #[must_use]
    pub fn with(mut self, effect: Effect, choice: Choice) -> Self {
        let _ = self.set(effect, choice);
        self
    }
}

/// A set of effects.
#[derive(Debug, Clone, Copy, Default, PartialEq, Eq)]
pub struct EffectSet(u32);

impl EffectSet {
    /// Whether the set has `effect`.
    pub const fn has(self, effect: Effect) -> bool {
        self.0 >> effect as u32 & 1 == 1
    }

    /// This set with `effect`.
    #[must_use]
    pub const fn and(self, effect: Effect) -> Self {
        Self(self.0 | 1 << effect as u32)
    }

    /// This set without `effect`.
    #[must_use]
    pub const fn without(self, effect: Effect) -> Self {
        Self(self.0 & !(1 << effect as u32))
    }

    /// Effects of the set, in the order of [`Effect::ALL`].
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
