//! Placement of the fetus in the uterine cavity.
//!
//! The fetus starts in the middle, rotated by lie and roll. As a rigid body it is then pushed off wall and placenta
//! until it touches neither.

use glam::{Quat, Vec3};
use insonify_core::anatomy::sdf::{Isometry, Solid, ellipsoid};

use super::attitude::Attitude;
use super::biometry::Biometry;
use super::parameters::{Lie, Parameters, PlacentaSite};
use super::{fetus, mother};

/// Fluid layer between the fetus and its surroundings, mm.
const CLEARANCE_MM: f32 = 3.0;
/// Largest accepted shortfall from [`CLEARANCE_MM`], mm.
const ACCEPTED_MM: f32 = 0.6;
/// Semi-axes of the disc that represents the placenta, mm at 22 weeks; y is along its thickness.
const PLACENTA_SEMI_MM: Vec3 = Vec3::new(60.0, 13.0, 60.0);
/// Largest number of steps that push the fetus off its obstacles.
const STEPS: usize = 240;

/// Obstacles around the fetus.
struct Obstacles {
    cavity: Solid,
    /// Approximate placenta. It yields to the fetus if the cavity is too small for both.
    placenta: Solid,
    start: Isometry,
}

impl Obstacles {
    fn of(parameters: &Parameters) -> Self {
        let (centre, outward) = mother::placenta_centre(parameters);
        let size = Biometry::at_weeks(parameters.gestational_weeks).trunk_scale();
        let disc = ellipsoid(Vec3::ZERO, PLACENTA_SEMI_MM * size);
        let placenta = disc.placed(Isometry::from_axes(centre, outward, outward.any_orthonormal_vector()));
        Self { cavity: mother::cavity(parameters), placenta, start: start(parameters) }
    }

    /// Placement (`scene_from_fetus`) of the fetus, and its largest remaining shortfall from the wall clearance, mm.
    fn place(&self, attitude: &Attitude) -> (Isometry, f32) {
        let balls = fetus::balls(attitude);
        let scale = attitude.biometry.trunk_scale();
        let mut pose = Isometry { translation: self.start.translation * scale, ..self.start };
        let mut best = (pose, f32::MAX);
        for step in 0..STEPS {
            let (mut force, mut torque, mut weight, mut inertia) = (Vec3::ZERO, Vec3::ZERO, 0.0f32, 0.0f32);
            let mut worst = 0.0f32;
            let centre = pose.translation;
            let mut push = |at: Vec3, by: Vec3| {
                let depth = by.length();
                let arm = at - centre;
                force += by * depth;
                torque += arm.cross(by) * depth;
                weight += depth;
                inertia += depth * arm.length_squared();
            };
            for &(local, radius) in &balls {
                let at = pose.point(local);
                // The ball's surface point nearest to the wall is used, since the cavity's distances are accurate only
                // near the wall.
                let outward = self.cavity.normal(at + self.cavity.normal(at) * radius);
                let out_of_wall = self.cavity.distance_mm(at + outward * radius) + CLEARANCE_MM;
                if out_of_wall > 0.0 {
                    worst = worst.max(out_of_wall);
                    push(at, -outward * out_of_wall);
                }
                let in_placenta = radius + CLEARANCE_MM - self.placenta.distance_mm(at);
                // If the cavity is too small for both, the placenta yields.
                if in_placenta > 0.0 && step < STEPS / 2 {
                    push(at, self.placenta.normal(at) * in_placenta);
                }
            }
            // Clearance from the wall decides; clearance from the placenta is a bonus.
            if worst < best.1.max(0.5 * ACCEPTED_MM) {
                best = (pose, worst);
            }
            if weight < 0.5 * ACCEPTED_MM || (step >= STEPS / 2 && worst < 0.5 * ACCEPTED_MM) {
                break;
            }
            pose.translation += 0.7 * force / weight;
            let turn = 0.5 * torque / inertia.max(1e-6);
            pose.rotation = (Quat::from_scaled_axis(turn.clamp_length_max(0.03)) * pose.rotation).normalize();
        }
        best
    }
}

/// Start placement: rotated by lie and roll, the head tilted slightly towards the mother's belly. The fetus starts near
/// the cavity's centre, displaced backwards from an anterior placenta and forwards from a posterior one.
fn start(parameters: &Parameters) -> Isometry {
    let (cranial, ventral) = match parameters.lie {
        Lie::Cephalic => (Vec3::NEG_Y, Vec3::X),
        Lie::Breech => (Vec3::Y, Vec3::NEG_X),
        Lie::TransverseHeadLeft => (Vec3::X, Vec3::Y),
        Lie::TransverseHeadRight => (Vec3::NEG_X, Vec3::NEG_Y),
    };
    let roll = Quat::from_axis_angle(cranial, (parameters.roll_deg as f32).to_radians());
    let lie = Isometry::from_axes(Vec3::ZERO, cranial, roll * ventral);
    let tilt = Quat::from_axis_angle(cranial.cross(Vec3::Z), 5.5f32.to_radians());
    let rotation = (tilt * lie.rotation).normalize();
    let behind = match parameters.placenta {
        PlacentaSite::Anterior => 11.0,
        PlacentaSite::Posterior => -8.0,
        PlacentaSite::Fundal | PlacentaSite::Left | PlacentaSite::Right => 2.0,
    };
    Isometry { rotation, translation: roll * ventral * -5.0 - Vec3::Z * behind }
}

impl Attitude {
    /// Attitude and placement of the fetus of `parameters`.
    ///
    /// A fetus too stretched for the cavity is curled as far as necessary.
    pub fn of(parameters: &Parameters) -> Self {
        let biometry = Biometry::at_weeks(parameters.gestational_weeks);
        let obstacles = Obstacles::of(parameters);
        let mut best: Option<(f32, Self)> = None;
        for step in 0..=5 {
            let flexion = parameters.flexion as f32;
            let curled = flexion + (1.0 - flexion) * 0.2 * step as f32;
            let mut attitude = Self::varied(&biometry, curled, parameters.seed);
            let (scene_from_fetus, overlap_mm) = obstacles.place(&attitude);
            attitude.scene_from_fetus = scene_from_fetus;
            if best.as_ref().is_none_or(|(least, _)| overlap_mm < *least) {
                best = Some((overlap_mm, attitude));
            }
            if overlap_mm < ACCEPTED_MM {
                break;
            }
        }
        // The loop runs at least once.
        best.map_or_else(|| Self::posed(&biometry, 0.5, 0, 0.0, 0.0), |(_, attitude)| attitude)
    }

    /// Attitude of individual `seed`. Its limbs vary as far as possible without crossing. If the limbs of the mean
    /// attitude cross, they are spread apart.
    fn varied(biometry: &Biometry, flexion: f32, seed: u64) -> Self {
        let variations = [1.0, 0.5, 0.25].into_iter().filter(|_| seed != 0).map(|variation| (variation, 0.0));
        let spreads = (0..=8).map(|step| (0.0, 0.06 * step as f32));
        for (variation, spread) in variations.chain(spreads) {
            let attitude = Self::posed(biometry, flexion, seed, variation, spread);
            if fetus::crossing_bones(&attitude).is_none() {
                return attitude;
            }
        }
        Self::posed(biometry, flexion, seed, 0.0, 0.0)
    }
}

#[cfg(test)]
mod tests {
    use super::*;

    #[test]
    fn bones_of_no_two_limbs_cross() {
        for seed in 0..40 {
            for flexion in [0.0, 0.25, 0.5, 0.75, 1.0] {
                for weeks in [16.0, 22.0, 34.0] {
                    let attitude = Attitude::varied(&Biometry::at_weeks(weeks), flexion, seed);
                    let crossing = fetus::crossing_bones(&attitude);
                    assert_eq!(crossing, None, "seed {seed}, flexion {flexion}, {weeks} weeks");
                }
            }
        }
        let [a, b] = [1, 2].map(|seed| Attitude::varied(&Biometry::default(), 0.5, seed));
        assert_ne!(a.legs, b.legs);
    }
}
