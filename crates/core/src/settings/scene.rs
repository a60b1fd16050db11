//! Scene of a station: the generated phantom, and motion.

use serde::{Deserialize, Serialize};

use super::{settings, stored_word};

/// Range of the phantom's number of triangles, relative to the full phantom.
pub const SCALE_RANGE: std::ops::RangeInclusive<f64> = 0.01..=20.0;
/// Range of the fetus' gestational age, completed weeks.
pub const WEEKS_RANGE: std::ops::RangeInclusive<f64> = 16.0..=34.0;
/// Range of the fetus' flexion: 0 is stretched, 1 tightly curled.
pub const FLEXION_RANGE: std::ops::RangeInclusive<f64> = 0.0..=1.0;
/// Range of the fetus' roll about its long axis, degrees.
pub const ROLL_RANGE_DEG: std::ops::RangeInclusive<f64> = -180.0..=180.0;
/// Range of the amniotic fluid index, mm: oligohydramnios to polyhydramnios.
pub const FLUID_INDEX_RANGE_MM: std::ops::RangeInclusive<f64> = 50.0..=250.0;
/// Range of the thickness of the mother's subcutaneous fat, mm.
pub const FAT_RANGE_MM: std::ops::RangeInclusive<f64> = 5.0..=60.0;

/// Lie of the fetus: direction of its long axis and of its head.
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
    /// On the front wall, towards the belly; left and high.
    #[default]
    Anterior,
    /// On the back wall, towards the spine.
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

/// Class of an abdominal wall by its aberration: the RMS of the delays over 30 mm of aperture, about their best-fit
/// plane.
#[derive(Debug, Clone, Copy, PartialEq, Eq, Default, Serialize, Deserialize)]
#[serde(rename_all = "kebab-case")]
pub enum Wall {
    /// At most 20 ns.
    #[default]
    Easy,
    /// 40 to 50 ns.
    Average,
    /// At least 60 ns, behind more fat.
    Hard,
}

crate::names::named!(Wall { Easy = "easy", Average = "average", Hard = "hard" });

stored_word!(Lie);
stored_word!(PlacentaSite);
stored_word!(Wall);

settings! {
    /// Settings of `[scene]`, in addition to its files.
    #[derive(Debug, Clone, Copy, PartialEq)]
    pub struct SceneSettings in "scene" {
        /// Number of triangles relative to the full phantom; refused below about 0.24, where the finest parts are lost.
        phantom_scale: f64 = 1.0, "", SCALE_RANGE, Everything;

        /// Gestational age of the phantom's fetus.
        phantom_weeks: f64 = 22.0, "weeks", WEEKS_RANGE, Everything;

        /// Lie of the fetus: head down, head up, or across.
        phantom_lie: Lie = Lie::Cephalic, "", Lie::RANGE, Everything;

        /// Roll of the fetus about its long axis; at 0, its left side is up.
        phantom_roll_deg: f64 = 0.0, "°", ROLL_RANGE_DEG, Everything;

        /// Flexion of the fetus: 0 is stretched, 1 tightly curled.
        phantom_flexion: f64 = 0.5, "", FLEXION_RANGE, Everything;

        /// Site of the placenta on the uterine wall.
        phantom_placenta: PlacentaSite = PlacentaSite::Anterior, "", PlacentaSite::RANGE, Everything;

        /// Amniotic fluid index, from oligohydramnios to polyhydramnios.
        phantom_fluid_index_mm: f64 = 140.0, "mm", FLUID_INDEX_RANGE_MM, Everything;

        /// Class of the abdominal wall by its aberration: median RMS delay of 13, 45 or 71 ns over 30 mm of aperture.
        phantom_wall: Wall = Wall::Easy, "", Wall::RANGE, Everything;

        /// Whether fat fills the gap between the rectus muscles: a lens that doubles the image behind the midline.
        phantom_recti_lens: bool = false, "", 0.0..=1.0, Everything;

        /// Seed of the differences between individuals.
        phantom_seed: u32 = 0, "", 0.0..=4_294_967_295.0, Everything;

        /// Whether hearts, breathing and limbs move; a single frame shows time 0, at rest.
        motion: bool = true, "", 0.0..=1.0, Everything;
    }
}
