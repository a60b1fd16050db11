//! Settings of the pose estimator.

use super::one_euro::Cutoffs;
use super::{Calibration, Pose};

/// Filtering, prediction and tracking states: `[filter]` of a station file.
#[derive(Debug, Clone, Copy, PartialEq)]
pub struct FilterSettings {
    /// Cutoff of the position filter at rest, Hz.
    pub min_cutoff_hz: f64,
    /// Increase of that cutoff with speed, Hz per mm/s.
    pub beta: f64,
    /// Cutoff of the rotation filter at rest, Hz.
    pub rotation_min_cutoff_hz: f64,
    /// Increase of that cutoff with angular speed, Hz per degree/s.
    pub rotation_beta: f64,
    /// Cutoff of the speed filters, Hz.
    pub speed_cutoff_hz: f64,
    /// Longest prediction towards the time of display, ms; 0 switches prediction off.
    pub prediction_ms: f64,
    /// Age of the last measurement above which the pose is held, ms.
    pub held_ms: f64,
    /// Age above which the pose is stale, ms; at least `held_ms`.
    pub stale_ms: f64,
    /// Age above which the pose is lost, ms; at least `stale_ms`.
    pub lost_ms: f64,
    /// Duration of exactly equal readings that counts as stuck, ms; 0 switches the check off.
    pub stuck_ms: f64,
    /// Fastest motion of a hand, mm/s; a faster measurement is dropped unless the next one confirms it.
    pub max_speed_mm_s: f64,
    /// Fastest rotation of a hand, degrees/s.
    pub max_speed_deg_s: f64,
    /// Speed of a puck at full deflection, mm/s.
    pub puck_mm_s: f64,
    /// Angular speed of a puck at full deflection, degrees/s.
    pub puck_deg_s: f64,
}

impl Default for FilterSettings {
    /// For a tracker of about 60 measurements a second with noise of 0.1 to 0.2 mm and degrees: the compromise between
    /// noise at rest and error at display time measured by the estimator's tests.
    fn default() -> Self {
        Self {
            min_cutoff_hz: 1.0,
            beta: 0.5,
            rotation_min_cutoff_hz: 1.0,
            rotation_beta: 0.5,
            speed_cutoff_hz: 1.5,
            prediction_ms: 30.0,
            held_ms: 100.0,
            stale_ms: 500.0,
            lost_ms: 2000.0,
            stuck_ms: 2000.0,
            max_speed_mm_s: 3000.0,
            max_speed_deg_s: 2000.0,
            puck_mm_s: 80.0,
            puck_deg_s: 45.0,
        }
    }
}

impl FilterSettings {
    /// Cutoffs of the One-Euro filter.
    pub fn cutoffs(&self) -> Cutoffs {
        Cutoffs {
            min_cutoff_hz: self.min_cutoff_hz,
            beta: self.beta,
            rotation_min_cutoff_hz: self.rotation_min_cutoff_hz,
            rotation_beta: self.rotation_beta,
            speed_cutoff_hz: self.speed_cutoff_hz,
        }
    }
}

/// Settings of an [`Estimator`](super::Estimator).
#[derive(Debug, Clone, PartialEq)]
pub struct Settings {
    /// Filter, prediction, tracking states.
    pub filter: FilterSettings,
    /// Calibration of tracker, sensor and probe.
    pub calibration: Calibration,
    /// `scene_from_probe` at which a puck starts. Its position is used for devices that measure only orientation.
    pub initial_pose: Pose,
}

impl Default for Settings {
    fn default() -> Self {
        Self { filter: FilterSettings::default(), calibration: Calibration::default(), initial_pose: Pose::IDENTITY }
    }
}
