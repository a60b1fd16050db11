//! Quality of a live frame: rays, layers, steering angles, samples and the effect `aperture`.

use std::fmt;

use serde::{Deserialize, Serialize};

use insonify_core::settings::{Choice, Effect, Quality, RenderSettings};

/// Rendering settings of a live frame that the controller of operating points may change.
#[derive(Debug, Clone, Copy, PartialEq, Eq, Hash, Serialize, Deserialize)]
#[serde(deny_unknown_fields)]
pub struct FrameQuality {
    /// Rays per scanline and layer.
    pub rays: u32,
    /// Elevational layers.
    pub layers: u32,
    /// Number of steering angles of a compounded picture; 1 without compounding. Each live frame renders one angle and
    /// shows the mean of the latest pictures of all angles.
    #[serde(default = "one", skip_serializing_if = "is_one")]
    pub angles: u32,
    /// Whether an automatic number of samples is two thirds of the usual one.
    #[serde(default, skip_serializing_if = "is_no")]
    pub coarse: bool,
    /// Whether obstacles shadow the aperture as a whole; if false, they shadow each path alone.
    #[serde(default = "yes", skip_serializing_if = "is_yes")]
    pub aperture: bool,
}

fn one() -> u32 {
    1
}

fn is_one(angles: &u32) -> bool {
    *angles == 1
}

fn yes() -> bool {
    true
}

fn is_yes(aperture: &bool) -> bool {
    *aperture
}

fn is_no(coarse: &bool) -> bool {
    !*coarse
}

impl FrameQuality {
    /// Low quality: 1 ray × 1 layer.
    pub const LQ: Self = Self::new(1, 1);
    /// High quality: 32 rays × 3 layers.
    pub const HQ: Self = Self::new(32, 3);

    /// Quality with one steering angle, all samples and the effect `aperture`.
    pub const fn new(rays: u32, layers: u32) -> Self {
        Self { rays, layers, angles: 1, coarse: false, aperture: true }
    }

    /// Quality of these settings.
    pub fn of(settings: &RenderSettings) -> Self {
        Self {
            rays: settings.quality.rays,
            layers: settings.quality.layers,
            angles: settings.look.odd_angles(),
            coarse: settings.coarse_samples,
            aperture: settings.effects.of(Effect::Aperture) != Choice::Off,
        }
    }

    /// Returns `settings` at this quality, with the same seed. `aperture` is the station's choice for the effect of
    /// that name.
    pub fn apply(&self, settings: &RenderSettings, aperture: Choice) -> RenderSettings {
        let mut next = *settings;
        (next.quality.rays, next.quality.layers, next.look.angles) = (self.rays, self.layers, self.angles);
        next.coarse_samples = self.coarse;
        next.effects = next.effects.with(Effect::Aperture, if self.aperture { aperture } else { Choice::Off });
        next
    }

    /// Render quality with these rays and layers, and a seed.
    pub const fn with_seed(&self, seed: u32) -> Quality {
        Quality { rays: self.rays, layers: self.layers, seed }
    }

    /// Paths per scanline: rays × layers.
    pub const fn paths(&self) -> u32 {
        self.rays * self.layers
    }
}

impl fmt::Display for FrameQuality {
    fn fmt(&self, f: &mut fmt::Formatter<'_>) -> fmt::Result {
        let Self { rays, layers, angles, coarse, aperture } = self;
        write!(f, "{rays}x{layers}")?;
        if *angles > 1 {
            write!(f, " of {angles} angles")?;
        }
        if *coarse {
            write!(f, " with coarse samples")?;
        }
        if *aperture { Ok(()) } else { write!(f, " without aperture") }
    }
}

#[cfg(test)]
mod tests {
    use super::*;

    #[test]
    fn settings_take_a_quality_and_give_it_back() {
        let settings = RenderSettings::default();
        let seeded =
            RenderSettings { quality: insonify_core::settings::Quality { seed: 7, ..settings.quality }, ..settings };
        for quality in [
            FrameQuality::LQ,
            FrameQuality { angles: 3, ..FrameQuality::new(4, 3) },
            FrameQuality { aperture: false, ..FrameQuality::new(2, 5) },
            FrameQuality { coarse: true, ..FrameQuality::LQ },
        ] {
            let applied = quality.apply(&seeded, Choice::Auto);
            assert_eq!((FrameQuality::of(&applied), applied.quality.seed), (quality, 7));
            // Going back to a quality with the aperture restores the station's choice.
            let back = FrameQuality::LQ.apply(&applied, Choice::On);
            assert_eq!(back.effects.of(Effect::Aperture), Choice::On);
            let text = toml::to_string(&quality).unwrap();
            assert_eq!(toml::from_str::<FrameQuality>(&text).unwrap(), quality);
        }
        assert_eq!(toml::to_string(&FrameQuality::new(2, 3)).unwrap(), "rays = 2\nlayers = 3\n");
        let text = FrameQuality { angles: 3, aperture: false, ..FrameQuality::new(1, 3) }.to_string();
        assert_eq!(text, "1x3 of 3 angles without aperture");
        assert_eq!(FrameQuality { coarse: true, ..FrameQuality::LQ }.to_string(), "1x1 with coarse samples");
    }
}
