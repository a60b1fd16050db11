//! Acoustic properties of tissues.

use thiserror::Error;

use crate::acoustics;
use crate::settings::{Setting, SettingsGroup as _, settings};

settings! {
    /// Acoustic properties of one tissue. Defaults describe a soft tissue without speckle.
    #[derive(Debug, Clone, PartialEq)]
    pub struct Tissue in "tissues.NAME" {
        /// Speed of sound.
        speed_m_s: f64 = 1540.0, "m/s", 100.0..=10_000.0, Everything;

        /// Density.
        density_kg_m3: f64 = 1000.0, "kg/m3", 0.1..=25_000.0, Everything;

        /// Attenuation at 1 MHz, one way.
        attenuation_db_cm_mhz: f64 = 0.5, "dB/cm", 0.0..=100.0, Everything;

        /// Power of the frequency in the attenuation.
        attenuation_exponent: f64 = 1.0, "", 0.0..=3.0, Everything;

        /// Fraction of the cells of the scatterer lattice that contain a scatterer.
        scatterer_density: f64 = 0.0, "", 0.0..=1.0, Everything;

        /// Mean amplitude of a scatterer, relative to a perfect reflector; its sign has no effect on the image.
        scatterer_mean: f64 = 0.0, "", -10.0..=10.0, Everything;

        /// Standard deviation of a scatterer's amplitude.
        scatterer_deviation: f64 = 0.0, "", 0.0..=10.0, Everything;

        /// RMS slope of the microfacets on the tissue's surfaces; 0 is a mirror.
        roughness: f64 = 0.0, "", 0.0..=2.0, Everything;

        /// Thickness of the transition layer at the tissue's surfaces.
        thickness_mm: f64 = 0.0, "mm", 0.0..=10.0, Everything;

        /// Standard deviation of the level of the coarse texture.
        cloud_db: f64 = 0.0, "dB", 0.0..=12.0, Everything;

        /// Correlation length of the coarse texture: levels at this distance correlate by e^-0.5.
        cloud_mm: f64 = 8.0, "mm", 0.2..=200.0, Everything;

        /// Standard deviation of the level of the fine texture.
        grain_db: f64 = 0.0, "dB", 0.0..=12.0, Everything;

        /// Correlation length of the fine texture: levels at this distance correlate by e^-0.5.
        grain_mm: f64 = 1.5, "mm", 0.2..=200.0, Everything;

        /// Level of the septa, relative to the tissue between them; negative for dark septa.
        septa_db: f64 = 0.0, "dB", -20.0..=20.0, Everything;

        /// Mean distance between septa along a line.
        septa_mm: f64 = 10.0, "mm", 0.5..=200.0, Everything;

        /// Length of the texture along `fibre` over its width: above 1 for fibres, below 1 for layers across `fibre`.
        fibre_ratio: f64 = 1.0, "", 0.02..=50.0, Everything;

        /// Direction of the fibres in the scene, of any length.
        fibre: [f64; 3] = [0.0, 1.0, 0.0], "", -1.0..=1.0, Everything;
    }
}

impl Tissue {
    /// Characteristic impedance, MRayl.
    pub fn impedance_mrayl(&self) -> f64 {
        acoustics::impedance_mrayl(self.density_kg_m3, self.speed_m_s)
    }

    /// One-way attenuation, nepers/mm.
    pub fn attenuation_np_mm(&self, frequency_mhz: f64) -> f64 {
        let (a, y) = (self.attenuation_db_cm_mhz, self.attenuation_exponent);
        acoustics::attenuation::attenuation_np_mm(a, y, frequency_mhz)
    }
}

/// Errors in tissue values.
#[derive(Debug, Error, Clone, PartialEq)]
pub enum TissueError {
    /// A value outside its range.
    #[error("tissues.{tissue}.{key} is {value}; it must lie in {min}..={max}")]
    Range {
        /// Name of the tissue.
        tissue: String,
        /// Key of the value.
        key: &'static str,
        /// Value found.
        value: f64,
        /// Smallest accepted value.
        min: f64,
        /// Largest accepted value.
        max: f64,
    },
    /// An invalid built-in table.
    #[error("assets/tissues.toml: {reason}")]
    Table {
        /// Fault and its position in the file.
        reason: String,
    },
    /// More tissues than an 8-bit segmentation can number.
    #[error("{count} tissues; a segmentation map numbers at most 255")]
    TooMany {
        /// Number of tissues found.
        count: usize,
    },
}

/// Tissues of `assets/tissues_adult.toml`. They are numbered after all others: a tissue's number seeds its speckle, so
/// frames of scenes without these tissues don't depend on them.
pub(super) const LAST: [&str; 11] = [
    "capsule",
    "mucosa",
    "pancreas",
    "pericardium",
    "portal_tract",
    "prostate",
    "renal_cortex",
    "renal_sinus",
    "submucosa",
    "thyroid",
    "valve",
];

/// Name of the tissue of a tracked needle. It is numbered after all others, for the same reason.
pub const NEEDLE: &str = "needle";

/// Key by which tissues are ordered.
fn order(name: &str) -> (u8, &str) {
    match name {
        NEEDLE => (2, name),
        _ => (LAST.contains(&name).into(), name),
    }
}

/// Tissues in alphabetical order of their names, with those of adults' organs after all others, and the needle at the
/// end. A tissue's number in segmentation maps is its index + 1; 0 is "outside".
#[derive(Debug, Clone, Default, PartialEq)]
pub struct TissueTable {
    names: Vec<String>,
    tissues: Vec<Tissue>,
}

impl TissueTable {
    /// Table of `entries`; among entries of equal names, the last one is used.
    ///
    /// # Errors
    /// A value outside its range, or more than 255 tissues.
    pub fn new(entries: impl IntoIterator<Item = (String, Tissue)>) -> Result<Self, TissueError> {
        let entries: std::collections::BTreeMap<_, _> = entries.into_iter().collect();
        if entries.len() > 255 {
            return Err(TissueError::TooMany { count: entries.len() });
        }
        for (name, tissue) in &entries {
            check(name, tissue)?;
        }
        let mut sorted: Vec<(String, Tissue)> = entries.into_iter().collect();
        sorted.sort_by(|(a, _), (b, _)| order(a).cmp(&order(b)));
        let (names, tissues) = sorted.into_iter().unzip();
        Ok(Self { names, tissues })
    }

    /// Index of the tissue called `name`; `None` if the table lacks it.
    pub fn index_of(&self, name: &str) -> Option<usize> {
        self.names.binary_search_by(|n| order(n).cmp(&order(name))).ok()
    }

    /// Names of the tissues, by index.
    pub fn names(&self) -> &[String] {
        &self.names
    }

    /// Tissues, by index.
    pub fn tissues(&self) -> &[Tissue] {
        &self.tissues
    }
}

fn check(name: &str, tissue: &Tissue) -> Result<(), TissueError> {
    for setting in Tissue::settings() {
        let value = tissue.stored(setting.key).map_or(f64::NAN, |stored| stored.get(0));
        if setting.check(value).is_err() {
            let &Setting { key, min, max, .. } = setting;
            return Err(TissueError::Range { tissue: name.to_owned(), key, value, min, max });
        }
    }
    Ok(())
}
