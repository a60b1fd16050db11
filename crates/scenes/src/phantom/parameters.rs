//! Parameters of a phantom individual.

use serde::{Deserialize, Serialize};
use thiserror::Error;

use insonify_core::settings::SceneSettings;
pub use insonify_core::settings::{
    FAT_RANGE_MM, FLEXION_RANGE, FLUID_INDEX_RANGE_MM, Lie, PlacentaSite, ROLL_RANGE_DEG, WEEKS_RANGE, Wall,
};

/// Parameters of a phantom; equal parameters give equal bytes.
#[derive(Debug, Clone, Copy, PartialEq, Serialize, Deserialize)]
pub struct Parameters {
    /// Gestational age in weeks, within [`WEEKS_RANGE`].
    #[serde(rename = "weeks")]
    pub gestational_weeks: f64,
    /// Lie of the fetus.
    pub lie: Lie,
    /// Rotation of the fetus about its long axis, degrees, from the position with its left side up; within
    /// [`ROLL_RANGE_DEG`].
    pub roll_deg: f64,
    /// Flexion: 0 is stretched, 1 tightly curled; within [`FLEXION_RANGE`].
    pub flexion: f64,
    /// Site of the placenta.
    pub placenta: PlacentaSite,
    /// Amniotic fluid index, mm, within [`FLUID_INDEX_RANGE_MM`].
    pub fluid_index_mm: f64,
    /// Thickness of the mother's subcutaneous fat over the belly, mm, within [`FAT_RANGE_MM`].
    #[serde(rename = "fat_mm")]
    pub maternal_fat_mm: f64,
    /// Aberration class of the abdominal wall.
    #[serde(default)]
    pub wall: Wall,
    /// Whether fat fills the gap between the recti. The fat is an acoustic lens that shows structures below the midline
    /// twice.
    #[serde(default)]
    pub recti_lens: bool,
    /// Seed of the small variations between individuals.
    pub seed: u64,
}

impl Default for Parameters {
    fn default() -> Self {
        Self::from(&SceneSettings::default())
    }
}

/// Parameters of a station, with the fat of its wall.
impl From<&SceneSettings> for Parameters {
    fn from(scene: &SceneSettings) -> Self {
        Self {
            gestational_weeks: scene.phantom_weeks,
            lie: scene.phantom_lie,
            roll_deg: scene.phantom_roll_deg,
            flexion: scene.phantom_flexion,
            placenta: scene.phantom_placenta,
            fluid_index_mm: scene.phantom_fluid_index_mm,
            maternal_fat_mm: scene.phantom_wall.fat_mm(),
            wall: scene.phantom_wall,
            recti_lens: scene.phantom_recti_lens,
            seed: scene.phantom_seed.into(),
        }
    }
}

/// A parameter outside its range.
#[derive(Debug, Error, Clone, PartialEq)]
#[error("the phantom's {name} is {value}; it must lie in {min}..={max}")]
pub struct ParametersError {
    /// Name of the parameter.
    pub name: &'static str,
    /// Value found.
    pub value: f64,
    /// Smallest accepted value.
    pub min: f64,
    /// Largest accepted value.
    pub max: f64,
}

impl Parameters {
    /// Checks every value against its range.
    ///
    /// # Errors
    /// The first value outside its range; NaN is outside.
    pub fn validate(&self) -> Result<(), ParametersError> {
        let checks = [
            ("gestational age in weeks", self.gestational_weeks, WEEKS_RANGE),
            ("roll in degrees", self.roll_deg, ROLL_RANGE_DEG),
            ("flexion", self.flexion, FLEXION_RANGE),
            ("amniotic fluid index in mm", self.fluid_index_mm, FLUID_INDEX_RANGE_MM),
            ("maternal fat in mm", self.maternal_fat_mm, FAT_RANGE_MM),
        ];
        for (name, value, range) in checks {
            if !range.contains(&value) {
                return Err(ParametersError { name, value, min: *range.start(), max: *range.end() });
            }
        }
        Ok(())
    }
}

#[cfg(test)]
mod tests {
    use super::*;

    #[test]
    fn names_select_their_variants() {
        assert_eq!(Lie::NAMES.iter().filter_map(|name| Lie::named(name)).collect::<Vec<_>>(), Lie::ALL);
        assert!(PlacentaSite::ALL.iter().all(|&site| PlacentaSite::named(site.name()) == Some(site)));
        assert!(Wall::ALL.iter().all(|&wall| Wall::named(wall.name()) == Some(wall)));
        assert_eq!((Lie::named("oblique"), PlacentaSite::named("")), (None, None));
    }

    #[test]
    fn values_outside_their_range_are_named() {
        assert_eq!(Parameters::default().validate(), Ok(()));
        for weeks in [15.9, 34.1, f64::NAN] {
            let error = Parameters { gestational_weeks: weeks, ..Parameters::default() }.validate().unwrap_err();
            assert!(error.to_string().contains("16..=34"), "{error}");
        }
    }
}
