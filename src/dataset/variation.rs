//! Variation of phantoms and settings within a data set.

use super::SettingsRow;
use crate::phantom::{Lie, Parameters, PlacentaSite};
use crate::random::SplitMix64;
use crate::render::{ImageSettings, RenderSettings};
use crate::transducer::Probe;

/// Ranges in which settings vary about the station's: gain and dynamic range (± dB), and factors of the focal depth.
const GAIN_DB: f64 = 4.0;
const DYNAMIC_RANGE_DB: f64 = 4.0;
const FOCUS: (f64, f64) = (0.75, 1.3);

fn within(random: &mut SplitMix64, least: f64, most: f64) -> f64 {
    // Rounded to three decimals, which a manifest holds exactly.
    (1e3 * random.between(least, most)).round() / 1e3
}

/// A random whole number below 2^32.
pub(super) fn whole(random: &mut SplitMix64) -> u64 {
    (random.unit() * 4_294_967_296.0) as u64
}

/// Random phantom parameters from `seed`, within the usual range of a second-trimester pregnancy.
pub fn parameters(seed: u64) -> Parameters {
    let mut random = SplitMix64::new(seed ^ 0x0070_6861_6e74_6f6d);
    let lie = match random.unit() {
        u if u < 0.5 => Lie::Cephalic,
        u if u < 0.8 => Lie::Breech,
        u if u < 0.9 => Lie::TransverseHeadLeft,
        _ => Lie::TransverseHeadRight,
    };
    let sites = [
        PlacentaSite::Anterior,
        PlacentaSite::Posterior,
        PlacentaSite::Fundal,
        PlacentaSite::Left,
        PlacentaSite::Right,
    ];
    let placenta = sites[((random.unit() * sites.len() as f64) as usize).min(sites.len() - 1)];
    Parameters {
        gestational_weeks: within(&mut random, 18.0, 28.0),
        lie,
        roll_deg: within(&mut random, -90.0, 90.0),
        flexion: within(&mut random, 0.2, 0.8),
        placenta,
        fluid_index_mm: within(&mut random, 80.0, 200.0),
        maternal_fat_mm: within(&mut random, 8.0, 30.0),
        // Below 2^32; JSON readers hold integers up to 2^53 exactly.
        seed: whole(&mut random),
        ..Parameters::default()
    }
}

impl SettingsRow {
    /// Random settings for an exam from its `seed`, near the station's settings.
    pub fn draw(seed: u64, probe: &Probe, settings: &RenderSettings) -> Self {
        let mut random = SplitMix64::new(seed ^ 0x7365_7474_696e_6773);
        let ImageSettings { gain_db, dynamic_range_db, .. } = settings.image;
        let range_db = DYNAMIC_RANGE_DB.min(0.25 * dynamic_range_db);
        Self {
            gain_db: within(&mut random, gain_db - GAIN_DB, gain_db + GAIN_DB),
            dynamic_range_db: within(&mut random, dynamic_range_db - range_db, dynamic_range_db + range_db),
            focus_mm: within(&mut random, FOCUS.0 * probe.focus_mm, FOCUS.1 * probe.focus_mm),
        }
    }

    /// Applies these settings to a station's probe and renderer settings.
    pub fn apply(&self, probe: &Probe, settings: &RenderSettings) -> (Probe, RenderSettings) {
        let image = ImageSettings { gain_db: self.gain_db, dynamic_range_db: self.dynamic_range_db, ..settings.image };
        let settings = RenderSettings { image, maps: true, lines: false, ..*settings };
        (Probe { focus_mm: self.focus_mm, ..*probe }, settings)
    }
}
