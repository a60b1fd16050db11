//! Registration of tracker and scene by named landmarks, as text for people and as JSON.

use std::fmt;

use glam::DVec3;
use serde::Serialize;
use thiserror::Error;

use super::csv::Named;
use super::mix_up::MixUp;
use super::registration::{PointPair, RegistrationError, register};
use super::{Fitted, Pose};

/// Fit of named landmarks. [`Display`](fmt::Display) shows landmarks, residuals and transform.
#[derive(Debug, Clone, Serialize)]
pub struct LandmarkFit {
    scene_from_tracker: Transform,
    rms_mm: f64,
    /// Whether all landmarks are near one plane: a mirrored tracker axis then cannot be detected.
    pub coplanar: bool,
    /// Likely mix-up of landmarks in words, although the fit is accepted; `None` if none is likely.
    #[serde(skip_serializing_if = "Option::is_none")]
    pub likely: Option<String>,
    landmarks: Vec<Row>,
    #[serde(skip)]
    pose: Pose,
}

#[derive(Debug, Clone, Serialize)]
struct Transform {
    position_mm: [f64; 3],
    /// Rotation of the transform, `[qw, qx, qy, qz]`.
    quaternion: [f64; 4],
}

#[derive(Debug, Clone, Serialize)]
struct Row {
    name: String,
    scene_mm: DVec3,
    tracker_mm: DVec3,
    residual_mm: f64,
}

/// Reason for refusing a fit.
#[derive(Debug, Error)]
pub enum LandmarkFitError {
    /// The landmarks determine no transform.
    #[error(transparent)]
    Registration(#[from] RegistrationError),
    /// The landmarks determine no transform, and a mix-up is the likely reason.
    #[error("{source}; {likely}")]
    MixedUp {
        /// Reason why they determine none.
        source: RegistrationError,
        /// Likely mix-up in words.
        likely: String,
    },
    /// The RMS residual of the fit is too large.
    #[error(
        "the landmarks fit with an RMS residual of {rms_mm:.2} mm, more than --max-rms {max_rms_mm}; the worst is `{worst}`, off by {worst_mm:.2} mm{likely}\n{table}"
    )]
    TooFar {
        /// RMS residual, mm.
        rms_mm: f64,
        /// Largest accepted RMS residual, mm.
        max_rms_mm: f64,
        /// Landmark with the largest residual.
        worst: String,
        /// Residual of that landmark, mm.
        worst_mm: f64,
        /// Likely explanation as text to append, or empty.
        likely: String,
        /// Table of the landmarks, as text.
        table: String,
    },
}

impl LandmarkFit {
    /// Fits named landmarks; refuses an RMS residual above `max_rms_mm`.
    ///
    /// # Errors
    /// The errors of [`register`], or a residual above the limit.
    pub fn of(pairs: &[Named<PointPair>], max_rms_mm: f64) -> Result<Self, LandmarkFitError> {
        let points: Vec<PointPair> = pairs.iter().map(|p| p.value).collect();
        let found = register(&points).map_err(|source| match (&source, MixUp::of(&points)) {
            (RegistrationError::TooFew { .. } | RegistrationError::Coordinate { .. }, _) | (_, None) => source.into(),
            (_, Some(mix_up)) => LandmarkFitError::MixedUp { source, likely: mix_up.describe(pairs) },
        })?;
        let row = |(pair, &residual_mm): (&Named<PointPair>, &f64)| {
            let PointPair { scene_mm, tracker_mm } = pair.value;
            Row { name: pair.name.clone(), scene_mm, tracker_mm, residual_mm }
        };
        let landmarks: Vec<Row> = pairs.iter().zip(&found.residuals_mm).map(row).collect();
        let [x, y, z, qw, qx, qy, qz] = found.scene_from_tracker.components();
        let scene_from_tracker = Transform { position_mm: [x, y, z], quaternion: [qw, qx, qy, qz] };
        let (pose, rms_mm, coplanar) = (found.scene_from_tracker, found.rms_mm, found.coplanar);
        let likely = MixUp::of(&points).map(|mix_up| mix_up.describe(pairs));
        let fit = Self { scene_from_tracker, rms_mm, coplanar, likely, landmarks, pose };
        let worst = fit.landmarks.iter().max_by(|a, b| a.residual_mm.total_cmp(&b.residual_mm));
        match worst.filter(|_| rms_mm > max_rms_mm) {
            None => Ok(fit),
            Some(Row { name, residual_mm, .. }) => {
                let (worst, worst_mm, table) = (name.clone(), *residual_mm, fit.table());
                let likely = fit.likely.as_ref().map_or_else(String::new, |likely| format!("; {likely}"));
                Err(LandmarkFitError::TooFar { rms_mm, max_rms_mm, worst, worst_mm, likely, table })
            }
        }
    }

    /// The transform with its residual, for a [`Calibration`](super::Calibration).
    pub fn fitted(&self) -> Fitted<Pose> {
        Fitted { value: self.pose, rms_mm: Some(self.rms_mm) }
    }

    fn table(&self) -> String {
        let width = self.landmarks.iter().map(|r| r.name.chars().count()).max().unwrap_or(0).max("landmark".len());
        let mut text = format!("{:width$} {:>11} {:>26} {:>29}", "landmark", "residual mm", "scene mm", "tracker mm");
        for Row { name, scene_mm: s, tracker_mm: t, residual_mm } in &self.landmarks {
            let scene = format!("{:8.1} {:8.1} {:8.1}", s.x, s.y, s.z);
            text += &format!("\n{name:width$} {residual_mm:>11.3} {scene:>26}  {:>9.1} {:>8.1} {:>8.1}", t.x, t.y, t.z);
        }
        text
    }
}

/// Smallest number of landmarks whose residuals are informative.
const RESIDUALS_FROM: usize = 4;

/// Lines of text about the fit of the landmarks touched so far: residuals if there are at least four landmarks, and a
/// likely mix-up.
pub fn fit_so_far(pairs: &[Named<PointPair>]) -> Vec<String> {
    let points: Vec<PointPair> = pairs.iter().map(|pair| pair.value).collect();
    let mut lines = Vec::new();
    if points.len() >= RESIDUALS_FROM {
        match register(&points) {
            Ok(found) => {
                let each = pairs.iter().zip(&found.residuals_mm).map(|(pair, mm)| format!("{} {mm:.1}", pair.name));
                let each = each.collect::<Vec<_>>().join(", ");
                lines.push(format!("residuals {each} mm; RMS {:.2} mm", found.rms_mm));
            }
            Err(reason) => lines.push(reason.to_string()),
        }
    }
    lines.extend(MixUp::of(&points).map(|mix_up| mix_up.describe(pairs)));
    lines
}

impl fmt::Display for LandmarkFit {
    fn fmt(&self, f: &mut fmt::Formatter<'_>) -> fmt::Result {
        writeln!(f, "{}", self.table())?;
        writeln!(f, "RMS residual {:.3} mm over {} landmarks", self.rms_mm, self.landmarks.len())?;
        let Transform { position_mm: [x, y, z], quaternion: [qw, qx, qy, qz] } = self.scene_from_tracker;
        writeln!(f, "scene_from_tracker: position_mm = [{x:.4}, {y:.4}, {z:.4}]")?;
        writeln!(f, "                    quaternion = [{qw:.6}, {qx:.6}, {qy:.6}, {qz:.6}]")
    }
}
