//! Settings that trade accuracy against time.

use serde::{Deserialize, Serialize};

use crate::render::{Quality, RenderSettings};
use crate::settings::{Choice, Effect, EffectChoices, LookSettings};
use crate::transducer::Probe;

/// The quality knobs of a frame; see the keys of `[quality]` and `[probe]`.
#[derive(Debug, Clone, Copy, PartialEq, Eq, Serialize, Deserialize)]
pub struct Knobs {
    /// Rays per scanline and elevational layer.
    pub rays: u32,
    /// Elevational layers.
    pub layers: u32,
    /// Maximum number of reflections along a path.
    pub reflections_max: u32,
    /// Share of a scanline's paths that follow reflections, percent.
    pub reflecting_percent: u32,
    /// Number of scanlines.
    pub scanlines: u32,
    /// Samples per scanline.
    pub samples: u32,
    /// Largest number of taps of the lateral beam kernel.
    pub beam_taps_max: u32,
    /// Largest number of taps of the pulse kernel.
    pub pulse_taps_max: u32,
    /// Steering angles of spatial compounding; odd.
    pub angles: u32,
    /// True as in a live session: each frame adds one angle, and the picture is the mean of a moving probe's last
    /// frames. False if each frame takes all angles.
    pub rolling: bool,
    /// True if every effect is simulated; false if the station's effect plan chooses the effects.
    pub all_effects: bool,
    /// Whether the effect `aperture` may be simulated. If not, each path casts its own shadow.
    pub aperture: bool,
}

impl Knobs {
    /// Knobs of a station's probe and settings.
    pub fn of(probe: &Probe, settings: &RenderSettings) -> Self {
        Self {
            rays: settings.quality.rays,
            layers: settings.quality.layers,
            reflections_max: settings.reflections_max,
            reflecting_percent: (100.0 * settings.reflecting_share).round() as u32,
            scanlines: probe.scanlines,
            samples: probe.sampled(settings.coarse_samples).sample_count(),
            beam_taps_max: settings.beam_taps_max,
            pulse_taps_max: settings.pulse_taps_max,
            angles: settings.look.odd_angles(),
            rolling: false,
            all_effects: settings.effects == EffectChoices::ALL_ON,
            aperture: settings.effects.of(Effect::Aperture) != Choice::Off,
        }
    }

    /// These knobs with other rays and layers.
    pub fn with(self, rays: u32, layers: u32) -> Self {
        Self { rays, layers, ..self }
    }

    /// These knobs with every effect simulated.
    pub(crate) fn with_all_effects(self) -> Self {
        Self { all_effects: true, ..self }
    }

    /// These knobs with `angles` steering angles. With `rolling`, frames are compounded as in a live session.
    pub fn compounded(self, angles: u32, rolling: bool) -> Self {
        Self { angles, rolling, ..self }
    }

    /// These knobs without the effect `aperture`.
    pub(crate) fn without_aperture(self) -> Self {
        Self { aperture: false, ..self }
    }

    /// These knobs with the samples of `probe` that are coarse if `coarse`.
    pub(crate) fn sampled(self, probe: &Probe, coarse: bool) -> Self {
        Self { samples: probe.sampled(coarse).sample_count(), ..self }
    }

    /// Applies these knobs and `seed` to `probe` and `settings`.
    pub fn apply(&self, probe: &Probe, settings: &RenderSettings, seed: u32) -> (Probe, RenderSettings) {
        let probe = Probe { scanlines: self.scanlines, samples: self.samples.into(), ..*probe };
        let mut effects = if self.all_effects { EffectChoices::ALL_ON } else { settings.effects };
        if !self.aperture {
            effects = effects.with(Effect::Aperture, Choice::Off);
        }
        let settings = RenderSettings {
            quality: Quality { rays: self.rays, layers: self.layers, seed },
            reflections_max: self.reflections_max,
            reflecting_share: f64::from(self.reflecting_percent) / 100.0,
            beam_taps_max: self.beam_taps_max,
            pulse_taps_max: self.pulse_taps_max,
            look: LookSettings { angles: self.angles, ..settings.look },
            effects,
            ..*settings
        };
        (probe, settings)
    }

    /// Names and values of the knobs, in the order of the tables' columns.
    pub fn values(&self) -> [(&'static str, u32); 12] {
        [
            ("rays", self.rays),
            ("layers", self.layers),
            ("reflections_max", self.reflections_max),
            ("reflecting_percent", self.reflecting_percent),
            ("scanlines", self.scanlines),
            ("samples", self.samples),
            ("beam_taps_max", self.beam_taps_max),
            ("pulse_taps_max", self.pulse_taps_max),
            ("angles", self.angles),
            ("rolling", u32::from(self.rolling)),
            ("all_effects", u32::from(self.all_effects)),
            ("aperture", u32::from(self.aperture)),
        ]
    }
}

#[cfg(test)]
mod tests {
    use super::*;

    #[test]
    fn knobs_come_back_as_they_went() {
        let knobs = Knobs {
            rays: 3,
            layers: 5,
            reflections_max: 1,
            reflecting_percent: 40,
            scanlines: 17,
            samples: 99,
            beam_taps_max: 9,
            pulse_taps_max: 11,
            angles: 13,
            rolling: false,
            all_effects: true,
            aperture: true,
        };
        let (probe, settings) = knobs.apply(&Probe::default(), &RenderSettings::default(), 7);
        assert_eq!((Knobs::of(&probe, &settings), settings.quality.seed), (knobs, 7));
        let mut values = knobs.values().map(|(_, value)| value);
        values.sort_unstable();
        assert_eq!(values, [0, 1, 1, 1, 3, 5, 9, 11, 13, 17, 40, 99]);
        let planned = Knobs { all_effects: false, ..knobs };
        let (_, settings) = planned.apply(&Probe::default(), &RenderSettings::default(), 7);
        assert_eq!(settings.effects, EffectChoices::default());
        let (probe, settings) = planned.without_aperture().apply(&Probe::default(), &RenderSettings::default(), 7);
        assert_eq!(settings.effects.of(Effect::Aperture), Choice::Off);
        assert!(!Knobs::of(&probe, &settings).aperture);
    }
}
