//! What a probe is: its face, its beam and how it samples.

use glam::DVec3;
use thiserror::Error;

use crate::acoustics::{self, beam, pulse};

/// Shape of a transducer's face.
#[derive(Debug, Clone, Copy, PartialEq)]
pub enum ProbeKind {
    /// A curved array: scanlines leave an arc of `radius_mm` at angles over `fov_deg`.
    Convex {
        /// Radius of curvature of the face, mm.
        radius_mm: f64,
        /// Angle between the first and the last edge of the sector, degrees.
        fov_deg: f64,
    },
    /// A flat array: parallel scanlines over `width_mm`.
    Linear {
        /// Width of the face, mm.
        width_mm: f64,
    },
    /// A phased array: scanlines leave the centre of the face at angles over `fov_deg`.
    Phased {
        /// Angle between the first and the last edge of the sector, degrees.
        fov_deg: f64,
    },
}

/// A probe value outside its range.
#[derive(Debug, Error, Clone, PartialEq)]
#[error("probe.{key} is {value}; it must lie in {min}..={max}")]
pub struct ProbeError {
    /// Key in the station file's `[probe]`.
    pub key: &'static str,
    /// Value found.
    pub value: f64,
    /// Least accepted.
    pub min: f64,
    /// Greatest accepted.
    pub max: f64,
}

/// A probe. Defaults are the paper's: convex, 40 mm, 70°, 8 MHz, 150 mm, 256 scanlines of 3072 samples.
#[derive(Debug, Clone, Copy, PartialEq)]
pub struct Probe {
    /// Face.
    pub kind: ProbeKind,
    /// Centre frequency, MHz.
    pub frequency_mhz: f64,
    /// Two-way −6 dB bandwidth over the centre frequency.
    pub fractional_bandwidth: f64,
    /// Image depth from the face, mm at 1540 m/s.
    pub depth_mm: f64,
    /// Scanlines.
    pub scanlines: u32,
    /// Complex baseband samples a scanline.
    pub samples: u32,
    /// Depth of the transmit focus, mm.
    pub focus_mm: f64,
    /// Widest active aperture, mm.
    pub aperture_mm: f64,
    /// Height of the elevational lens, mm.
    pub elevational_height_mm: f64,
    /// Focal depth of the elevational lens, mm.
    pub elevational_focus_mm: f64,
}

impl Default for Probe {
    fn default() -> Self {
        Self {
            kind: ProbeKind::Convex { radius_mm: 40.0, fov_deg: 70.0 },
            frequency_mhz: 8.0,
            fractional_bandwidth: 0.6,
            depth_mm: 150.0,
            scanlines: 256,
            samples: 3072,
            focus_mm: 70.0,
            aperture_mm: 20.0,
            elevational_height_mm: 12.0,
            elevational_focus_mm: 70.0,
        }
    }
}

impl Probe {
    /// Checks every value against its range.
    ///
    /// # Errors
    /// The first value outside its range, NaN included.
    pub fn validate(&self) -> Result<(), ProbeError> {
        let check = |key, value: f64, min: f64, max: f64| {
            if value >= min && value <= max { Ok(()) } else { Err(ProbeError { key, value, min, max }) }
        };
        match self.kind {
            ProbeKind::Convex { radius_mm, fov_deg } => {
                check("radius_mm", radius_mm, 1.0, 1000.0)?;
                check("fov_deg", fov_deg, 0.1, 180.0)?;
            }
            ProbeKind::Linear { width_mm } => check("width_mm", width_mm, 0.1, 1000.0)?,
            ProbeKind::Phased { fov_deg } => check("fov_deg", fov_deg, 0.1, 180.0)?,
        }
        check("frequency_mhz", self.frequency_mhz, 0.5, 40.0)?;
        check("fractional_bandwidth", self.fractional_bandwidth, 0.05, 1.5)?;
        check("depth_mm", self.depth_mm, 1.0, 500.0)?;
        check("scanlines", self.scanlines.into(), 1.0, 1024.0)?;
        check("samples", self.samples.into(), 1.0, 8192.0)?;
        check("focus_mm", self.focus_mm, 1.0, 1000.0)?;
        check("aperture_mm", self.aperture_mm, 0.5, 200.0)?;
        check("elevational_height_mm", self.elevational_height_mm, 0.5, 100.0)?;
        check("elevational_focus_mm", self.elevational_focus_mm, 1.0, 1000.0)
    }

    /// Depth between two samples, mm at 1540 m/s. Sample j lies at depth (j + ½)·spacing.
    pub fn sample_spacing_mm(&self) -> f64 {
        self.depth_mm / f64::from(self.samples)
    }

    /// Radius of the face, mm: 0 for a phased array, none for a linear one.
    pub fn face_radius_mm(&self) -> Option<f64> {
        match self.kind {
            ProbeKind::Convex { radius_mm, .. } => Some(radius_mm),
            ProbeKind::Phased { .. } => Some(0.0),
            ProbeKind::Linear { .. } => None,
        }
    }

    /// Half the lateral extent of the sector: radians, or mm of a linear face.
    pub fn half_extent(&self) -> f64 {
        match self.kind {
            ProbeKind::Convex { fov_deg, .. } | ProbeKind::Phased { fov_deg } => 0.5 * fov_deg.to_radians(),
            ProbeKind::Linear { width_mm } => 0.5 * width_mm,
        }
    }

    /// Lateral coordinate (radians, or mm of a linear face) at `fraction` (0..=1) of the sector's extent.
    ///
    /// Scanline i of n lies at fraction (i + ½)/n.
    pub fn lateral_coordinate(&self, fraction: f64) -> f64 {
        (2.0 * fraction - 1.0) * self.half_extent()
    }

    /// Origin on the face (mm) and unit direction of the ray at a lateral coordinate, in the probe frame.
    pub fn ray(&self, lateral: f64) -> (DVec3, DVec3) {
        match self.face_radius_mm() {
            Some(radius) => {
                let (sin, cos) = lateral.sin_cos();
                // radius·(cos − 1) without cancellation at small angles.
                let sag = -2.0 * radius * (0.5 * lateral).sin().powi(2);
                (DVec3::new(radius * sin, 0.0, sag), DVec3::new(sin, 0.0, cos))
            }
            None => (DVec3::new(lateral, 0.0, 0.0), DVec3::Z),
        }
    }

    /// Lateral distance between neighbouring scanlines at `depth_mm`, mm.
    pub fn line_spacing_mm(&self, depth_mm: f64) -> f64 {
        let step = 2.0 * self.half_extent() / f64::from(self.scanlines);
        self.face_radius_mm().map_or(step, |radius| step * (radius + depth_mm))
    }

    /// Standard deviation of the axial pulse-echo envelope, mm.
    pub fn axial_sigma_mm(&self) -> f64 {
        pulse::axial_sigma_mm(self.frequency_mhz, self.fractional_bandwidth)
    }

    /// Standard deviation of the two-way lateral beam at `depth_mm`, mm.
    pub fn lateral_sigma_mm(&self, depth_mm: f64) -> f64 {
        beam::lateral_width_mm(self.frequency_mhz, self.aperture_mm, self.focus_mm, depth_mm) / pulse::FWHM_PER_SIGMA
    }

    /// Standard deviation of the two-way elevational beam at `depth_mm`, mm.
    pub fn elevational_sigma_mm(&self, depth_mm: f64) -> f64 {
        let (height, focus) = (self.elevational_height_mm, self.elevational_focus_mm);
        beam::elevational_width_mm(self.frequency_mhz, height, focus, depth_mm) / pulse::FWHM_PER_SIGMA
    }

    /// Turns of baseband phase a mm of depth: 2f/c₀. An echo at depth z carries e^(−i2π·turns·z).
    pub fn phase_turns_per_mm(&self) -> f64 {
        2.0 / acoustics::wavelength_mm(self.frequency_mhz)
    }
}
