//! Request for a data set.

use std::path::PathBuf;

use super::{CompoundingRow, DatasetError, Shard, Wishes};
use crate::render::Quality;
use crate::settings::{LookSettings, SettingsGroup};
use crate::station::{SceneSource, Station};

/// If no number of phantoms is requested: frames per phantom, and least number of phantoms.
const FRAMES_PER_PHANTOM: usize = 40;
const PHANTOMS_LEAST: usize = 4;

/// Request for a data set: stations, size, variety and qualities. Equal requests give equal tuples.
#[derive(Debug, Clone, PartialEq)]
pub struct Recipe {
    /// Stations, each loaded from a file, with probe, image, tissues and scene. The frames are divided evenly among
    /// them.
    pub stations: Vec<Station>,
    /// Number of tuples, at least 2.
    pub frames: usize,
    /// Seed of phantoms, sessions, settings and key frames.
    pub seed: u64,
    /// Number of phantoms per station with a phantom scene; 0 keeps the station's own phantom. `None`: one phantom for
    /// every 40 frames, at least 4.
    pub phantoms: Option<usize>,
    /// Number of tuples per session, at least 1.
    pub frames_per_exam: usize,
    /// Share of test tuples, above 0 and below 1.
    pub test_share: f64,
    /// Rays and layers of each low quality, at least one. If there are several, successive tuples take them in turn.
    pub lq: Vec<[u32; 2]>,
    /// Rays and layers of the high quality.
    pub hq: [u32; 2],
    /// Steering angles of the low quality, at least 1; even numbers are rounded down.
    pub lq_angles: u32,
    /// Steering angles of the high quality, at least 1; even numbers are rounded down.
    pub hq_angles: u32,
    /// Angle between the outermost steering directions of compounding, degrees. `None`: as in the first station.
    pub span_deg: Option<f64>,
    /// Directory of a data set with the same plan, from which the high quality is copied instead of rendered.
    pub hq_from: Option<PathBuf>,
    /// Part of the data set to make.
    pub shard: Shard,
}

/// Rays and layers of `quality`.
fn pair(quality: Quality) -> [u32; 2] {
    [quality.rays, quality.layers]
}

/// Rays and layers of the first low quality, of the further low qualities, and of the high quality.
pub(super) struct Qualities {
    pub(super) lq: [u32; 2],
    pub(super) lq_more: Vec<[u32; 2]>,
    pub(super) hq: [u32; 2],
}

impl Recipe {
    /// Request with defaults: 600 tuples, 8 per session, a tenth of them for the test. Low quality has 1 ray and 1
    /// layer, high quality 32 rays and 3 layers, each with one steering angle.
    pub fn new(stations: Vec<Station>) -> Self {
        Self {
            stations,
            frames: 600,
            seed: 1,
            phantoms: None,
            frames_per_exam: 8,
            test_share: 0.1,
            lq: vec![pair(Quality::LQ)],
            hq: pair(Quality::HQ),
            lq_angles: 1,
            hq_angles: 1,
            span_deg: None,
            hq_from: None,
            shard: Shard { number: 1, of: 1 },
        }
    }

    /// Requested size and variety, in the form that the plan needs.
    pub(super) fn wishes(&self) -> Wishes {
        let share = self.frames / self.stations.len().max(1);
        let is_phantom = |station: &Station| matches!(station.scene, SceneSource::ObstetricPhantom(_));
        Wishes {
            frames: self.frames,
            seed: self.seed,
            phantoms: self.phantoms.unwrap_or((share / FRAMES_PER_PHANTOM).max(PHANTOMS_LEAST)),
            frames_per_exam: self.frames_per_exam,
            test_share: self.test_share,
            stations: self.stations.iter().map(is_phantom).collect(),
        }
    }

    /// Checked qualities, in the form that the header needs.
    pub(super) fn qualities(&self) -> Result<Qualities, DatasetError> {
        for &[rays, layers] in self.lq.iter().chain([&self.hq]) {
            Quality { rays, layers, seed: 0 }.validate()?;
        }
        let Some((first, more)) = self.lq.split_first() else {
            return Err(DatasetError::Plan("a data set needs a low quality, and none is given".to_owned()));
        };
        Ok(Qualities { lq: *first, lq_more: more.to_vec(), hq: self.hq })
    }

    /// Numbers of steering angles of low and of high quality, and the compounding settings that both share.
    pub(super) fn compounding(&self) -> Result<CompoundingRow, DatasetError> {
        let look = self.stations.first().map(|station| station.settings.look).unwrap_or_default();
        let span_deg = self.span_deg.unwrap_or(look.span_deg);
        let odd = |angles| {
            let look = LookSettings { angles, span_deg, ..LookSettings::default() };
            look.validate().map(|()| look.odd_angles())
        };
        Ok(CompoundingRow {
            lq_angles: odd(self.lq_angles)?,
            hq_angles: odd(self.hq_angles)?,
            span_deg,
            reach_mm: look.reach_mm,
            registration: look.registration,
        })
    }
}
