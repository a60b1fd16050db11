//! Acoustic properties of tissues.

use serde::{Deserialize, Serialize};
use thiserror::Error;

use crate::acoustics;

/// Acoustic properties of one tissue: numbers, or a `V` for each.
#[derive(Debug, Clone, PartialEq, Serialize, Deserialize)]
#[serde(deny_unknown_fields)]
pub struct Tissue<V = f64> {
    /// Speed of sound, m/s.
    pub speed_m_s: V,
    /// Density, kg/m³.
    pub density_kg_m3: V,
    /// Attenuation at 1 MHz, dB/cm.
    pub attenuation_db_cm_mhz: V,
    /// Exponent of the frequency in the attenuation.
    pub attenuation_exponent: V,
    /// Fraction of the scatterer lattice's cells that contain a scatterer, 0..=1.
    #[serde(default)]
    pub scatterer_density: V,
    /// Mean amplitude of a scatterer, relative to a perfect reflector; its sign has no effect on the image.
    #[serde(default)]
    pub scatterer_mean: V,
    /// Standard deviation of a scatterer's amplitude, relative to a perfect reflector.
    #[serde(default)]
    pub scatterer_deviation: V,
    /// RMS slope of the microfacets of its surfaces; 0 is a mirror.
    #[serde(default)]
    pub roughness: V,
    /// Thickness of the transition at its surfaces, mm: echoes are spread over it.
    #[serde(default)]
    pub thickness_mm: V,
}

impl<V> Tissue<V> {
    /// All properties by key, physical ones first.
    pub fn properties(&self) -> [(&'static str, &V); 9] {
        [
            ("speed_m_s", &self.speed_m_s),
            ("density_kg_m3", &self.density_kg_m3),
            ("attenuation_db_cm_mhz", &self.attenuation_db_cm_mhz),
            ("attenuation_exponent", &self.attenuation_exponent),
            ("scatterer_density", &self.scatterer_density),
            ("scatterer_mean", &self.scatterer_mean),
            ("scatterer_deviation", &self.scatterer_deviation),
            ("roughness", &self.roughness),
            ("thickness_mm", &self.thickness_mm),
        ]
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

/// Smallest and largest accepted values.
const RANGES: Tissue<[f64; 2]> = Tissue {
    speed_m_s: [100.0, 10_000.0],
    density_kg_m3: [0.1, 25_000.0],
    attenuation_db_cm_mhz: [0.0, 100.0],
    attenuation_exponent: [0.0, 3.0],
    scatterer_density: [0.0, 1.0],
    scatterer_mean: [-10.0, 10.0],
    scatterer_deviation: [0.0, 10.0],
    roughness: [0.0, 2.0],
    thickness_mm: [0.0, 10.0],
};

fn check(name: &str, tissue: &Tissue) -> Result<(), TissueError> {
    for ((key, &value), (_, &[min, max])) in tissue.properties().into_iter().zip(RANGES.properties()) {
        if !(value >= min && value <= max) {
            return Err(TissueError::Range { tissue: name.to_owned(), key, value, min, max });
        }
    }
    Ok(())
}
