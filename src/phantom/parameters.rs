//! Parameters of a phantom individual.

use serde::{Deserialize, Serialize};
use thiserror::Error;

use crate::anatomy::Wall;

/// Range of gestational ages, completed weeks.
pub const WEEKS_RANGE: std::ops::RangeInclusive<f64> = 16.0..=34.0;
/// Range of flexions.
pub const FLEXION_RANGE: std::ops::RangeInclusive<f64> = 0.0..=1.0;
/// Range of rolls, degrees.
pub const ROLL_RANGE_DEG: std::ops::RangeInclusive<f64> = -180.0..=180.0;
/// Range of amniotic fluid indices, mm: oligohydramnios to polyhydramnios.
pub const FLUID_INDEX_RANGE_MM: std::ops::RangeInclusive<f64> = 50.0..=250.0;
/// Range of thicknesses of the mother's subcutaneous fat, mm.
pub const FAT_RANGE_MM: std::ops::RangeInclusive<f64> = 5.0..=60.0;

/// Direction of the fetus' long axis.
#[derive(Debug, Clone, Copy, PartialEq, Eq, Default, Serialize, Deserialize)]
#[serde(rename_all = "kebab-case")]
pub enum Lie {
    /// Head down.
    #[default]
    Cephalic,
    /// Head up.
    Breech,
    /// Transverse, with the head to the mother's left.
    TransverseHeadLeft,
    /// Transverse, with the head to the mother's right.
    TransverseHeadRight,
}

/// Site of the placenta on the uterine wall.
#[derive(Debug, Clone, Copy, PartialEq, Eq, Default, Serialize, Deserialize)]
#[serde(rename_all = "kebab-case")]
pub enum PlacentaSite {
    /// Towards the belly, left and fundal.
    #[default]
    Anterior,
    /// Towards the spine.
    Posterior,
    /// At the top of the uterus.
    Fundal,
    /// On the mother's left.
    Left,
    /// On the mother's right.
    Right,
}

crate::names::named!(Lie {
    Cephalic = "cephalic",
    Breech = "breech",
    TransverseHeadLeft = "transverse-head-left",
    TransverseHeadRight = "transverse-head-right",
});

crate::names::named!(PlacentaSite {
    Anterior = "anterior",
    Posterior = "posterior",
    Fundal = "fundal",
    Left = "left",
    Right = "right",
});

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
    /// How strongly the abdominal wall aberrates.
    #[serde(default)]
    pub wall: Wall,
    /// Whether fat fills the gap between the recti: a lens that doubles what lies behind the midline.
    #[serde(default)]
    pub recti_lens: bool,
    /// Seed of the small variations between individuals.
    pub seed: u64,
}

impl Default for Parameters {
    fn default() -> Self {
        Self {
            gestational_weeks: 22.0,
            lie: Lie::Cephalic,
            roll_deg: 0.0,
            flexion: 0.5,
            placenta: PlacentaSite::Anterior,
            fluid_index_mm: 140.0,
            maternal_fat_mm: Wall::Easy.fat_mm(),
            wall: Wall::Easy,
            recti_lens: false,
            seed: 0,
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
