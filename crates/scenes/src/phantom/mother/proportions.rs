//! Size of the uterine cavity, and displacement of the mother's organs as it grows.

use glam::Vec3;

use crate::phantom::parameters::{Lie, Parameters};

/// Semi-axes of the cavity at 22 weeks with normal fluid and a longitudinal lie, mm.
const CAVITY_22_MM: Vec3 = Vec3::new(63.0, 103.0, 53.0);

/// Thickness of the uterine wall, mm.
pub(super) const UTERINE_WALL_MM: f32 = 8.0;

/// Amniotic fluid index of the reference cavity, mm.
const FLUID_INDEX_22_MM: f32 = 140.0;

/// Size of the fetus relative to 22 weeks: a parabola through the values at 16, 22 and 34 weeks. Each value is the mean
/// ratio of Hadlock's biparietal diameter, abdominal circumference and femur length to their values at 22 weeks
/// (Radiology 152:497, 1984).
pub(super) fn growth(parameters: &Parameters) -> f32 {
    let weeks = parameters.gestational_weeks as f32 - 22.0;
    1.0 + 0.0583 * weeks - 0.000_28 * weeks * weeks
}

/// Semi-axes of the uterine cavity along x, y, z, mm.
///
/// The cavity grows with the fetus and with the fluid. It is wide for a transverse lie, and deep for a fetus facing
/// forward or back.
pub(in crate::phantom) fn cavity_semi_mm(parameters: &Parameters) -> Vec3 {
    // A fetus is deeper from back to knees than from side to side.
    let turned = (parameters.roll_deg as f32).to_radians().sin().powi(2);
    let broad = CAVITY_22_MM.x - 3.0 * turned;
    let deep = CAVITY_22_MM.z + 8.0 * turned;
    let long = CAVITY_22_MM.y;
    let stretched = 1.0 + 0.16 * (0.5 - parameters.flexion as f32).max(0.0);
    let fluid = (parameters.fluid_index_mm as f32 - FLUID_INDEX_22_MM) / 100.0;
    // The fluid changes the cavity's width and depth by `aside`, its length by `along`: less with little fluid, so that
    // the fetus still fits.
    let (aside, along) = if fluid < 0.0 { (0.05, 0.02) } else { (0.10, 0.06) };
    let (aside, along) = (1.0 + aside * fluid, stretched * (1.0 + along * fluid));
    let semi = match parameters.lie {
        Lie::Cephalic | Lie::Breech => Vec3::new(broad * aside, long * along, deep * aside),
        Lie::TransverseHeadLeft | Lie::TransverseHeadRight => Vec3::new(long * along, broad * aside, deep * aside),
    };
    semi * growth(parameters)
}

/// Positions of the organs around the uterus.
#[derive(Debug, Clone, Copy)]
pub(super) struct Proportions {
    /// Semi-axes of the cavity, mm.
    pub(super) cavity_semi: Vec3,
    /// Excess of the cavity's semi-axes over the reference cavity's, mm.
    pub(super) excess: Vec3,
}

impl Proportions {
    pub(super) fn of(parameters: &Parameters) -> Self {
        let cavity_semi = cavity_semi_mm(parameters);
        Self { cavity_semi, excess: cavity_semi - CAVITY_22_MM }
    }

    /// Position of soft tissue, mm, that lies at `reference` if the cavity has its reference size.
    pub(super) fn follow(&self, reference: Vec3) -> Vec3 {
        reference + self.excess * (reference / CAVITY_22_MM).clamp(Vec3::NEG_ONE, Vec3::ONE)
    }

    /// Displacement of the mother's skeleton, mm: spine and pelvis keep their distance behind and below the cavity.
    pub(super) fn skeleton_shift(&self) -> Vec3 {
        Vec3::new(0.0, -self.excess.y, -self.excess.z)
    }
}

#[cfg(test)]
mod tests {
    use super::*;

    fn volume(parameters: &Parameters) -> f32 {
        cavity_semi_mm(parameters).element_product()
    }

    #[test]
    fn the_cavity_grows_with_weeks_and_fluid() {
        let default = Parameters::default();
        assert_eq!(cavity_semi_mm(&default), CAVITY_22_MM);
        for lie in [Lie::Cephalic, Lie::TransverseHeadLeft] {
            let mut last = 0.0;
            for weeks in 16..=34 {
                let now = volume(&Parameters { gestational_weeks: f64::from(weeks), lie, ..default });
                assert!(now > last, "{weeks} weeks");
                last = now;
            }
            last = 0.0;
            for index in (50..=250).step_by(5) {
                let now = volume(&Parameters { fluid_index_mm: f64::from(index), lie, ..default });
                assert!(now > last, "index of {index} mm");
                last = now;
            }
        }
    }

    #[test]
    fn organs_beside_the_cavity_do_not_enter_it() {
        let p = Proportions::of(&Parameters { gestational_weeks: 34.0, ..Parameters::default() });
        let lateral = Vec3::new(88.0, 20.0, -56.0);
        assert!((p.follow(lateral).x - 88.0 - p.excess.x).abs() < 1e-4);
        assert_eq!(p.follow(Vec3::ZERO), Vec3::ZERO);
    }
}
