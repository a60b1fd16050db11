//! Built-in tissues, with the source of each value.

use std::collections::BTreeMap;

use serde::{Deserialize, Serialize};

use super::{Tissue, TissueError, TissueTable};

/// Texts of the files of tissues.
const TISSUES: [&str; 2] = [include_str!("../../assets/tissues.toml"), include_str!("../../assets/tissues_adult.toml")];

/// A value of a tissue with its source.
#[derive(Debug, Clone, PartialEq, Serialize, Deserialize)]
#[serde(deny_unknown_fields)]
pub struct Property {
    /// Value of the property, in the unit that the property's key names.
    pub value: f64,
    /// Range of published values: lowest and highest.
    #[serde(default, skip_serializing_if = "Option::is_none")]
    pub range: Option<[f64; 2]>,
    /// Publication of the value; for an assumed value, its justification.
    #[serde(default, skip_serializing_if = "Option::is_none")]
    pub source: Option<String>,
    /// Whether the value is assumed: it has no source, or is set for appearance rather than as a physical quantity.
    #[serde(default)]
    pub assumed: bool,
}

/// Texture of a tissue with its source. Each key combines two to four values of [`Tissue`].
#[derive(Debug, Clone, PartialEq, Serialize, Deserialize)]
#[serde(deny_unknown_fields)]
pub struct SourcedTexture {
    /// Coarse texture: standard deviation of its level (dB), and its correlation length (mm).
    #[serde(default, skip_serializing_if = "Option::is_none")]
    pub cloud: Option<[f64; 2]>,
    /// Fine texture: standard deviation of its level (dB), and its correlation length (mm).
    #[serde(default, skip_serializing_if = "Option::is_none")]
    pub grain: Option<[f64; 2]>,
    /// Septa, the thin walls in a tissue: level relative to the tissue between them (dB), and mean distance (mm).
    #[serde(default, skip_serializing_if = "Option::is_none")]
    pub septa: Option<[f64; 2]>,
    /// Direction of the fibres in the scene (3 values), then length over width of the texture along that direction. The
    /// ratio is below 1 for layers perpendicular to it.
    #[serde(default, skip_serializing_if = "Option::is_none")]
    pub fibres: Option<[f64; 4]>,
    /// Publication of the texture; for an assumed texture, its justification.
    pub source: String,
    /// Whether the texture is assumed.
    #[serde(default)]
    pub assumed: bool,
}

/// A tissue with the sources of its values; keys as in [`Tissue`].
#[derive(Debug, Clone, PartialEq, Serialize, Deserialize)]
#[serde(deny_unknown_fields)]
pub struct SourcedTissue {
    /// Echogenicity in sonographers' terms: anechoic, hypo-, iso- or hyperechoic, and the texture.
    pub echogenicity: String,
    /// Speed of sound, m/s.
    pub speed_m_s: Property,
    /// Density, kg/m³.
    pub density_kg_m3: Property,
    /// Attenuation at 1 MHz, dB/cm.
    pub attenuation_db_cm_mhz: Property,
    /// Power of the frequency in the attenuation.
    pub attenuation_exponent: Property,
    /// Fraction of the cells of the scatterer lattice that contain a scatterer.
    pub scatterer_density: Property,
    /// Mean amplitude of a scatterer, relative to a perfect reflector.
    pub scatterer_mean: Property,
    /// Standard deviation of a scatterer's amplitude, relative to a perfect reflector.
    pub scatterer_deviation: Property,
    /// RMS slope of the microfacets on the tissue's surfaces.
    pub roughness: Property,
    /// Thickness of the transition layer at the tissue's surfaces, mm.
    pub thickness_mm: Property,
    /// Texture; `None` for a uniform tissue.
    #[serde(default, skip_serializing_if = "Option::is_none")]
    pub texture: Option<SourcedTexture>,
}

impl SourcedTexture {
    fn set(&self, tissue: &mut Tissue) {
        if let Some([db, mm]) = self.cloud {
            (tissue.cloud_db, tissue.cloud_mm) = (db, mm);
        }
        if let Some([db, mm]) = self.grain {
            (tissue.grain_db, tissue.grain_mm) = (db, mm);
        }
        if let Some([db, mm]) = self.septa {
            (tissue.septa_db, tissue.septa_mm) = (db, mm);
        }
        if let Some([x, y, z, ratio]) = self.fibres {
            (tissue.fibre, tissue.fibre_ratio) = ([x, y, z], ratio);
        }
    }
}

impl SourcedTissue {
    /// The tissue without the sources.
    pub fn tissue(&self) -> Tissue {
        let mut tissue = Tissue {
            speed_m_s: self.speed_m_s.value,
            density_kg_m3: self.density_kg_m3.value,
            attenuation_db_cm_mhz: self.attenuation_db_cm_mhz.value,
            attenuation_exponent: self.attenuation_exponent.value,
            scatterer_density: self.scatterer_density.value,
            scatterer_mean: self.scatterer_mean.value,
            scatterer_deviation: self.scatterer_deviation.value,
            roughness: self.roughness.value,
            thickness_mm: self.thickness_mm.value,
            ..Tissue::default()
        };
        if let Some(texture) = &self.texture {
            texture.set(&mut tissue);
        }
        tissue
    }

    /// Each property with its key, physical properties first.
    pub fn properties(&self) -> [(&'static str, &Property); 9] {
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

/// Built-in tissues by name, with their sources.
///
/// # Errors
/// An invalid built-in table, which is a fault of the program.
pub fn sourced_tissues() -> Result<BTreeMap<String, SourcedTissue>, TissueError> {
    let files = TISSUES.iter().map(|text| tissues_of(text)).collect::<Result<Vec<_>, _>>()?;
    Ok(files.into_iter().flatten().collect())
}

/// Tissues of a file's text by name.
fn tissues_of(text: &str) -> Result<BTreeMap<String, SourcedTissue>, TissueError> {
    toml::from_str(text).map_err(|e| TissueError::Table { reason: e.to_string() })
}

impl TissueTable {
    /// Table of the built-in tissues.
    ///
    /// # Errors
    /// As [`sourced_tissues`].
    pub fn builtin() -> Result<Self, TissueError> {
        Self::new(sourced_tissues()?.into_iter().map(|(name, sourced)| (name, sourced.tissue())))
    }
}

#[cfg(test)]
mod tests {
    use super::*;

    #[test]
    fn every_value_has_a_source_or_is_marked_as_assumed() {
        for (name, tissue) in sourced_tissues().unwrap() {
            for (key, p) in tissue.properties() {
                assert!(p.assumed || p.source.is_some(), "{name}.{key}: neither source nor assumed");
                assert!(p.assumed || p.range.is_some(), "{name}.{key}: a source without its range");
                if let Some([low, high]) = p.range {
                    assert!(low <= p.value && p.value <= high, "{name}.{key}: {} not in {low}..={high}", p.value);
                }
            }
        }
    }

    #[test]
    fn no_file_repeats_a_tissue_of_another() {
        let count: usize = TISSUES.iter().map(|text| tissues_of(text).unwrap().len()).sum();
        assert_eq!(TissueTable::builtin().unwrap().names().len(), count);
        assert_eq!(sourced_tissues().unwrap().len(), count);
        let last: Vec<String> = tissues_of(TISSUES[1]).unwrap().into_keys().collect();
        assert_eq!(last, super::super::tissue::LAST);
        // The needle is the last of all.
        let table = TissueTable::builtin().unwrap();
        assert_eq!(table.names()[count - 1 - last.len()..count - 1], last);
        assert_eq!(table.names()[count - 1], super::super::tissue::NEEDLE);
    }

    #[test]
    fn the_table_holds_every_tissue_of_the_phantom() {
        let table = TissueTable::builtin().unwrap();
        let names = "water gel amniotic_fluid urine blood csf fat skin muscle uterus_wall cervix placenta cord_jelly \
                     vessel_wall brain choroid_plexus falx liver kidney heart spleen bowel soft_tissue lung_fetal \
                     lung_aerated air cartilage bone_adult bone_fetal fascia soft_tissue_maternal \
                     brain_deep cerebellum cerebellar_vermis renal_medulla septum peritoneum cervical_mucosa \
                     placental_plate placental_bed amnion amniotic_fluid_vernix";
        for name in names.split_whitespace() {
            assert!(table.index_of(name).is_some(), "{name}");
        }
    }

    #[test]
    fn targets_of_the_qa_phantom_have_the_levels_in_their_names() {
        let table = TissueTable::builtin().unwrap();
        let deviation = |name: &str| table.tissues()[table.index_of(name).unwrap()].scatterer_deviation;
        for (_, db, name) in crate::anatomy::specimens::qa::CONTRAST {
            let level = 20.0 * (deviation(name) / deviation("tmm")).log10();
            assert!((level - db).abs() < 0.01, "{name}: {level} dB");
        }
    }

    #[test]
    fn impedances_are_those_of_textbooks() {
        let table = TissueTable::builtin().unwrap();
        let z = |name| table.tissues()[table.index_of(name).unwrap()].impedance_mrayl();
        for (name, mrayl) in [("water", 1.48), ("fat", 1.38), ("blood", 1.66), ("liver", 1.65), ("muscle", 1.70)] {
            assert!((z(name) / mrayl - 1.0).abs() < 0.03, "{name}: {}", z(name));
        }
        assert!((z("air") - 0.0004).abs() < 5e-5 && z("bone_adult") > 6.0);
    }

    #[test]
    fn fluids_do_not_scatter_and_tissues_are_ordered_by_echogenicity() {
        for (name, tissue) in sourced_tissues().unwrap() {
            let t = tissue.tissue();
            let level = t.scatterer_deviation * t.scatterer_density.sqrt();
            let word = tissue.echogenicity.split([',', ' ']).next().unwrap();
            let expected = match word {
                "anechoic" => 0.0..=0.0,
                "near-anechoic" => 1e-4..=1e-3,
                "hypo" => 2e-3..=6e-3,
                "iso" => 6e-3..=1.2e-2,
                "hyper" => 1.2e-2..=4e-2,
                // Targets in a phantom, named by their level relative to the phantom's background.
                "relative" => 8e-4..=2e-2,
                other => panic!("{name}: {other}"),
            };
            assert!(expected.contains(&level), "{name} is {word} at {level}");
        }
    }
}
