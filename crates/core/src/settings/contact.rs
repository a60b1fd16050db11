//! Contact of the probe's face with the skin, and the receiver's noise, clutter, multiples and reverberation.

use serde::Serialize;

use super::settings;

settings! {
    /// The `[contact]` of a station.
    #[derive(Debug, Clone, Copy, PartialEq, Serialize)]
    pub struct ContactSettings in "contact" {
        /// Thickness of the film of gel; skin farther from the face is not coupled, since air lies between.
        gel_mm: f64 = 3.0, "mm", 0.0..=10.0, Nothing;

        /// Registration error to correct: a probe that hovers or sinks by less is put on the skin.
        tolerance_mm: f64 = 0.0, "mm", 0.0..=10.0, Nothing;
    }
}

settings! {
    /// The `[receiver]` of a station. Levels are relative to the echo of a perfect reflector, before gain and TGC.
    #[derive(Debug, Clone, Copy, PartialEq, Serialize)]
    pub struct ReceiverSettings in "receiver" {
        /// Level of the receiver's noise before TGC, equal at every depth; TGC makes it rise with depth.
        noise_db: f64 = -165.0, "dB", -400.0..=0.0, Nothing;

        /// Level of the clutter at the face, where the body is coupled; it falls by 20 dB per cm.
        clutter_db: f64 = -55.0, "dB", -400.0..=0.0, Nothing;

        /// Level of the probe's own reverberation at the face, where the body is not coupled; it falls by 35 dB per cm.
        reverberation_db: f64 = -30.0, "dB", -400.0..=0.0, Nothing;

        /// Level at which the probe's face reflects returning echoes, for the effect `multiples`.
        face_reflection_db: f64 = -14.0, "dB", -400.0..=0.0, Nothing;
    }
}
