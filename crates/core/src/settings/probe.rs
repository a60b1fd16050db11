//! Probe: face, beam and sampling.

use serde::{Deserialize, Serialize};

use super::live_control::{choice, slider, toggle};
use super::{Apodization, Change, Samples, Setting, SettingsError, SettingsGroup, Stored, check_own, settings};

/// Largest number of samples per scanline.
pub const SAMPLES_MAX: u32 = 8192;

/// Shape of a transducer's face.
#[derive(Debug, Clone, Copy, PartialEq, Serialize, Deserialize)]
#[serde(tag = "kind", rename_all = "lowercase")]
pub enum ProbeKind {
    /// A curved array: scanlines leave an arc of `radius_mm` at angles over `fov_deg`.
    Convex {
        /// Radius of curvature of the face, mm.
        radius_mm: f64,
        /// Angle of the sector between its two outer edges, degrees.
        fov_deg: f64,
    },
    /// A flat array: parallel scanlines over `width_mm`.
    Linear {
        /// Width of the face, mm.
        width_mm: f64,
    },
    /// A phased array: scanlines leave the centre of the face at angles over `fov_deg`.
    Phased {
        /// Angle of the sector between its two outer edges, degrees.
        fov_deg: f64,
    },
}

settings! {
    /// Sizes of faces, each for some kinds of probe.
    #[derive(Debug, Clone, Copy, PartialEq)]
    pub struct Face in "probe" {
        /// Radius of curvature of the face (convex).
        radius_mm: f64 = 40.0, "mm", 1.0..=1000.0, Everything;

        /// Angle of the sector (convex, phased).
        fov_deg: f64 = 70.0, "degrees", 0.1..=180.0, Everything;

        /// Width of the face (linear).
        width_mm: f64 = 40.0, "mm", 0.1..=1000.0, Everything;
    }
}

impl ProbeKind {
    /// Whether the scanlines can be steered for spatial compounding. The scanlines of a phased array can't, since they
    /// all leave one point.
    pub fn steers(&self) -> bool {
        !matches!(self, Self::Phased { .. })
    }
}

impl Default for ProbeKind {
    fn default() -> Self {
        let Face { radius_mm, fov_deg, .. } = Face::default();
        Self::Convex { radius_mm, fov_deg }
    }
}

impl SettingsGroup for ProbeKind {
    fn settings() -> &'static [Setting] {
        Face::settings()
    }

    fn stored(&self, key: &str) -> Option<&dyn Stored> {
        match (self, key) {
            (Self::Convex { radius_mm, .. }, "radius_mm") => Some(radius_mm),
            (Self::Convex { fov_deg, .. } | Self::Phased { fov_deg }, "fov_deg") => Some(fov_deg),
            (Self::Linear { width_mm }, "width_mm") => Some(width_mm),
            _ => None,
        }
    }

    fn stored_mut(&mut self, key: &str) -> Option<&mut dyn Stored> {
        match (self, key) {
            (Self::Convex { radius_mm, .. }, "radius_mm") => Some(radius_mm),
            (Self::Convex { fov_deg, .. } | Self::Phased { fov_deg }, "fov_deg") => Some(fov_deg),
            (Self::Linear { width_mm }, "width_mm") => Some(width_mm),
            _ => None,
        }
    }

    fn validate(&self) -> Result<(), SettingsError> {
        check_own(self)
    }

    fn change_to(&self, other: &Self) -> Change {
        if self == other { Change::Nothing } else { Change::Everything }
    }
}

settings! {
    /// A probe. Defaults as in Zhang et al. 2020: convex, 40 mm, 70°, 8 MHz, 150 mm, 256 scanlines.
    #[derive(Debug, Clone, Copy, PartialEq, Serialize)]
    pub struct Probe in "probe" {
        /// Centre frequency.
        frequency_mhz: f64 = 8.0, "MHz", 0.5..=40.0, Tables;

        /// Two-way -6 dB bandwidth over the centre frequency.
        fractional_bandwidth: f64 = 0.6, "", 0.05..=1.5, Tables;

        /// Image depth from the face, at 1540 m/s.
        depth_mm: f64 = 150.0, "mm", 1.0..=500.0, Tables,
            slider("Depth", "image", 30.0..=240.0, 5.0)
                .shown("cm", 0.1, 1)
                .key("PageDown", "Page down", "deeper", 10.0)
                // The depth is never less than the depth scale can show.
                .key_until("PageUp", "Page up", "shallower", -10.0, 10.0);

        /// Number of scanlines.
        scanlines: u32 = 256, "", 1.0..=1024.0, Everything;

        /// Number of complex baseband samples per scanline; "auto": as many as the pulse needs.
        samples: Samples = Samples::Auto, "", 1.0..=f64::from(SAMPLES_MAX), Everything;

        /// Depth of the transmit focus.
        focus_mm: f64 = 70.0, "mm", 1.0..=1000.0, Tables,
            slider("Focus", "image", 10.0..=200.0, 5.0)
                .shown("cm", 0.1, 1)
                .key("End", "End", "focus deeper", 5.0)
                .key("Home", "Home", "focus nearer", -5.0);

        /// Width of the widest active aperture.
        aperture_mm: f64 = 20.0, "mm", 0.5..=200.0, Tables;

        /// Weights across the aperture and across the elevational lens, in transmission and reception.
        apodization: Apodization = Apodization::Gaussian, "", Apodization::RANGE, Tables,
            choice("Apodization", "image", Apodization::NAMES).caption("");

        /// Tissue harmonics: reception at twice the transmitted frequency.
        harmonics: bool = false, "", 0.0..=1.0, Tables, toggle("Harmonics").key("n", "N", "harmonics on, off", 1.0);

        /// Height of the elevational lens.
        elevational_height_mm: f64 = 12.0, "mm", 0.5..=100.0, Tables;

        /// Focal depth of the elevational lens.
        elevational_focus_mm: f64 = 70.0, "mm", 1.0..=1000.0, Tables;
    }
    nested {
        /// Shape of the face.
        #[serde(flatten)]
        kind: ProbeKind,
    }
}
