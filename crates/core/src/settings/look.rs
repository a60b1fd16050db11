//! Post-processing ("look"): changes that a scanner makes to the picture before display.

use serde::Serialize;

use super::live_control::{choice, hidden, slider};
use super::{Probe, ProbeKind, settings, stored_word};

/// Mapping from the picture's grey levels to the grey levels on display.
#[derive(Debug, Clone, Copy, Default, PartialEq, Eq, Serialize)]
#[serde(rename_all = "snake_case")]
pub enum GreyMap {
    /// Levels unchanged.
    #[default]
    Linear,
    /// Dark tissue a little brighter.
    Soft,
    /// Dark tissue much brighter.
    Bright,
    /// Dark tissue darker.
    Dark,
    /// Dark tissue darker and bright tissue brighter.
    Contrast,
    /// Strong contrast: the full curve that `contrast` follows in part.
    Sharp,
}

crate::names::named!(GreyMap {
    Linear = "linear",
    Soft = "soft",
    Bright = "bright",
    Dark = "dark",
    Contrast = "contrast",
    Sharp = "sharp",
});

stored_word!(GreyMap);
stored_word!(LookPreset);

/// Largest number of angles of a compounded picture.
pub const ANGLES_MAX: u32 = 15;

settings! {
    /// Preset of the post-processing, by its name in `[look]`.
    #[derive(Debug, Clone, Copy, PartialEq)]
    pub struct LookBase in "look" {
        /// Preset of the post-processing; other keys of the table override its values.
        preset: LookPreset = LookPreset::Raw, "", LookPreset::RANGE, Nothing;
    }
}

settings! {
    /// The table `[look]` of a station: processing that turns scanlines into the displayed picture.
    #[derive(Debug, Clone, Copy, PartialEq, Serialize)]
    pub struct LookSettings in "look" {
        /// Steering angles of spatial compounding, rounded down to an odd number; 1: none. Not for phased arrays.
        angles: u32 = 1, "", 1.0..=f64::from(ANGLES_MAX), Tables,
            slider("Compounding", "look", 1.0..=9.0, 2.0).caption("Compound").shown("angles", 1.0, 0);

        /// Angle between the outermost directions of compounding.
        span_deg: f64 = 30.0, "degrees", 1.0..=60.0, Tables, hidden("Span");

        /// Whether earlier frames of a live compounded picture are registered to the present pose.
        registration: bool = true, "", 0.0..=1.0, Nothing, hidden("Registration");

        /// Probe displacement (with registration: across the slice only) beyond which earlier live frames are left out.
        reach_mm: f64 = 4.0, "mm", 0.0..=100.0, Nothing, hidden("Reach");

        /// Weight of the running mean in each new picture; 0: no persistence.
        persistence: f64 = 0.0, "", 0.0..=0.95, Nothing,
            slider("Persistence", "look", 0.0..=0.9, 0.1).caption("").shown("%", 100.0, 0);

        /// Strength of the speckle filter (Lee 1980); 0: none.
        speckle_reduction: f64 = 0.0, "", 0.0..=1.0, Nothing,
            slider("Smoothing", "look", 0.0..=1.0, 0.1).caption("").shown("%", 100.0, 0);

        /// Strength of the edge enhancement; 0: none.
        edge_enhancement: f64 = 0.0, "", 0.0..=2.0, Nothing,
            slider("Edges", "look", 0.0..=2.0, 0.1).caption("").shown("%", 100.0, 0);

        /// Mapping from the picture's grey levels to the display's.
        grey_map: GreyMap = GreyMap::Linear, "", GreyMap::RANGE, Nothing,
            choice("Grey map", "look", GreyMap::NAMES).caption("Map");
    }
}

impl LookSettings {
    /// Effective number of independent pictures in the mean over all steering angles: 1 + span / subtended angle. The
    /// aperture of `probe` subtends that angle at the focus (Trahey, Smith and von Ramm, IEEE Trans UFFC 33:257, 1986).
    pub fn independent_angles(&self, probe: &Probe) -> f64 {
        let aperture_deg = 2.0 * (0.5 * probe.aperture_mm / probe.focus_mm).atan().to_degrees();
        let angles = self.angles_of(probe.kind);
        if angles == 1 { 1.0 } else { (1.0 + self.span_deg / aperture_deg).min(f64::from(angles)) }
    }

    /// Number of steering angles for this kind of probe; odd.
    pub fn angles_of(&self, kind: ProbeKind) -> u32 {
        if kind.steers() { self.odd_angles() } else { 1 }
    }

    /// Number of steering angles for a probe that can be steered: `angles`, rounded down to an odd number.
    pub fn odd_angles(&self) -> u32 {
        (self.angles - 1) / 2 * 2 + 1
    }
}

/// Named presets of the post-processing: values of several settings at once.
#[derive(Debug, Clone, Copy, Default, PartialEq, Eq, Serialize)]
#[serde(rename_all = "snake_case")]
pub enum LookPreset {
    /// No post-processing: one angle, no filter, a linear map.
    #[default]
    Raw,
    /// Calm pictures for orientation: three angles, some persistence and smoothing.
    Survey,
    /// Fine structures of a resting probe: seven angles, edges enhanced.
    Detail,
}

crate::names::named!(LookPreset { Raw = "raw", Survey = "survey", Detail = "detail" });

impl LookPreset {
    /// All post-processing settings of the preset.
    pub fn settings(self) -> LookSettings {
        let raw = LookSettings::default();
        match self {
            Self::Raw => raw,
            Self::Survey => LookSettings {
                angles: 3,
                span_deg: 20.0,
                persistence: 0.3,
                speckle_reduction: 0.4,
                grey_map: GreyMap::Contrast,
                ..raw
            },
            Self::Detail => LookSettings {
                angles: 7,
                persistence: 0.2,
                speckle_reduction: 0.2,
                edge_enhancement: 0.5,
                grey_map: GreyMap::Contrast,
                ..raw
            },
        }
    }
}
