//! Sizes of the fetus.

/// Sizes of a fetus that drive every organ, mm.
///
/// Values at 22 weeks: head, abdomen and femur after Hadlock et al., "Estimating fetal age: computer-assisted analysis
/// of multiple fetal growth parameters", Radiology 152:497 (1984); other long bones after Jeanty et al., "Estimation
/// of gestational age from measurements of fetal long bones", J Ultrasound Med 3:75 (1984).
#[derive(Debug, Clone, Copy, PartialEq)]
pub struct Biometry {
    /// Biparietal diameter, outer to inner table of the skull.
    pub biparietal_mm: f32,
    /// Occipitofrontal diameter, outer to outer.
    pub occipitofrontal_mm: f32,
    /// Thickness of the skull.
    pub skull_thickness_mm: f32,
    /// Circumference of the abdomen at the skin.
    pub abdominal_circumference_mm: f32,
    /// Ossified length of the femur.
    pub femur_mm: f32,
    /// Ossified length of the tibia.
    pub tibia_mm: f32,
    /// Ossified length of the fibula.
    pub fibula_mm: f32,
    /// Ossified length of the humerus.
    pub humerus_mm: f32,
    /// Ossified length of the radius.
    pub radius_mm: f32,
    /// Ossified length of the ulna.
    pub ulna_mm: f32,
    /// Length of the foot, skin to skin.
    pub foot_mm: f32,
    /// Thickness of the fetal skin.
    pub skin_thickness_mm: f32,
}

impl Biometry {
    /// A fetus of 22 weeks.
    pub const WEEKS_22: Self = Self {
        biparietal_mm: 54.0,
        occipitofrontal_mm: 70.0,
        skull_thickness_mm: 1.8,
        abdominal_circumference_mm: 175.0,
        femur_mm: 39.0,
        tibia_mm: 34.0,
        fibula_mm: 33.0,
        humerus_mm: 37.0,
        radius_mm: 31.0,
        ulna_mm: 34.0,
        foot_mm: 38.0,
        skin_thickness_mm: 1.5,
    };

    /// Radius of the abdomen at the skin, mm.
    pub fn abdominal_radius_mm(&self) -> f32 {
        self.abdominal_circumference_mm / std::f32::consts::TAU
    }

    /// Half axes of the skull's outer table, mm: lateral, vertical, fore and aft.
    pub fn skull_semi_mm(&self) -> glam::Vec3 {
        // Outer to inner leaves out one table.
        let lateral = 0.5 * (self.biparietal_mm + self.skull_thickness_mm);
        let long = 0.5 * self.occipitofrontal_mm;
        glam::Vec3::new(lateral, 0.85 * long, long)
    }
}

impl Default for Biometry {
    fn default() -> Self {
        Self::WEEKS_22
    }
}
