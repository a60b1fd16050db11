//! Acoustic properties of tissues.

use serde::{Deserialize, Serialize};
use thiserror::Error;

use crate::acoustics;

/// Acoustic properties of one tissue.
#[derive(Debug, Clone, PartialEq, Serialize, Deserialize)]
#[serde(deny_unknown_fields)]
pub struct Tissue {
    /// Speed of sound, m/s.
    pub speed_m_s: f64,
    /// Density, kg/m³.
    pub density_kg_m3: f64,
    /// Attenuation at 1 MHz, dB/cm.
    pub attenuation_db_cm_mhz: f64,
    /// Exponent of the frequency in the attenuation.
    pub attenuation_exponent: f64,
    /// Fraction of the scatterer lattice's cells that contain a scatterer, 0..=1.
    #[serde(default)]
    pub scatterer_density: f64,
    /// Mean amplitude of a scatterer, relative to a perfect reflector; its sign has no effect on the image.
    #[serde(default)]
    pub scatterer_mean: f64,
    /// Standard deviation of a scatterer's amplitude, relative to a perfect reflector.
    #[serde(default)]
    pub scatterer_deviation: f64,
    /// RMS slope of the microfacets of its surfaces; 0 is a mirror.
    #[serde(default)]
    pub roughness: f64,
    /// Thickness of the transition at its surfaces, mm: echoes are spread over it.
    #[serde(default)]
    pub thickness_mm: f64,
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
        /// Tissue.
        tissue: String,
        /// Key.
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
        /// Fault and its place.
        reason: String,
    },
    /// More tissues than an 8-bit segmentation can number.
    #[error("{count} tissues; a segmentation map numbers at most 255")]
    TooMany {
        /// Tissues found.
        count: usize,
    },
}

/// Tissues in alphabetical order of their names. A tissue's number in segmentation maps is its index + 1; 0 is
/// "outside".
#[derive(Debug, Clone, Default, PartialEq)]
pub struct TissueTable {
    names: Vec<String>,
    tissues: Vec<Tissue>,
}

impl TissueTable {
    /// Table of `entries`; of equal names the later entry is used.
    ///
    /// # Errors
    /// A value outside its range, or more than 255 tissues.
    pub fn new(entries: impl IntoIterator<Item = (String, Tissue)>) -> Result<Self, TissueError> {
        let sorted: std::collections::BTreeMap<_, _> = entries.into_iter().collect();
        if sorted.len() > 255 {
            return Err(TissueError::TooMany { count: sorted.len() });
        }
        for (name, tissue) in &sorted {
            check(name, tissue)?;
        }
        let (names, tissues) = sorted.into_iter().unzip();
        Ok(Self { names, tissues })
    }

    /// Index of the tissue called `name`.
    pub fn index_of(&self, name: &str) -> Option<usize> {
        self.names.binary_search_by(|n| n.as_str().cmp(name)).ok()
    }

    /// Names, by index.
    pub fn names(&self) -> &[String] {
        &self.names
    }

    /// Tissues, by index.
    pub fn tissues(&self) -> &[Tissue] {
        &self.tissues
    }
}

fn check(name: &str, tissue: &Tissue) -> Result<(), TissueError> {
    let ranges = [
        ("speed_m_s", tissue.speed_m_s, 100.0, 10_000.0),
        ("density_kg_m3", tissue.density_kg_m3, 0.1, 25_000.0),
        ("attenuation_db_cm_mhz", tissue.attenuation_db_cm_mhz, 0.0, 100.0),
        ("attenuation_exponent", tissue.attenuation_exponent, 0.0, 3.0),
        ("scatterer_density", tissue.scatterer_density, 0.0, 1.0),
        ("scatterer_mean", tissue.scatterer_mean, -10.0, 10.0),
        ("scatterer_deviation", tissue.scatterer_deviation, 0.0, 10.0),
        ("roughness", tissue.roughness, 0.0, 2.0),
        ("thickness_mm", tissue.thickness_mm, 0.0, 10.0),
    ];
    for (key, value, min, max) in ranges {
        if !(value >= min && value <= max) {
            return Err(TissueError::Range { tissue: name.to_owned(), key, value, min, max });
        }
    }
    Ok(())
}
