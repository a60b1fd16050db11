//! How the fetus lies: frames of its head, trunk and limbs.
//!
//! The **fetal frame** has x to the fetus' left, y cranial and z ventral. Parts are modelled in it, or in the frame of
//! the head or of a vertebra (same axes, turned), and the fetus is then placed in the scene as a whole.

use glam::{Quat, Vec3};

use super::biometry::Biometry;
use super::parameters::Parameters;
use super::sdf::{Isometry, catmull_rom};

/// Vertebrae from C1 to S5. A *level* counts them from 0 at C1's cranial side: 7 is the top of T1, 19 of L1, 24 of S1.
pub const VERTEBRAE: usize = 29;

/// Joints of one leg, fetal frame, mm.
#[derive(Debug, Clone, Copy, PartialEq)]
pub struct Leg {
    /// Hip.
    pub hip: Vec3,
    /// Knee.
    pub knee: Vec3,
    /// Ankle.
    pub ankle: Vec3,
    /// Direction of the toes, unit.
    pub toes: Vec3,
}

/// Joints of one arm, fetal frame, mm.
#[derive(Debug, Clone, Copy, PartialEq)]
pub struct Arm {
    /// Shoulder.
    pub shoulder: Vec3,
    /// Elbow.
    pub elbow: Vec3,
    /// Wrist.
    pub wrist: Vec3,
    /// Direction of the fingers, unit.
    pub fingers: Vec3,
}

/// The fetus' attitude and its place in the scene.
#[derive(Debug, Clone)]
pub struct Attitude {
    /// Sizes of the fetus.
    pub biometry: Biometry,
    /// `scene_from_fetus`.
    pub scene_from_fetus: Isometry,
    /// `fetus_from_head`: origin at the skull's centre, y to the vertex, z to the face.
    pub fetus_from_head: Isometry,
    /// Left and right leg.
    pub legs: [Leg; 2],
    /// Left and right arm.
    pub arms: [Arm; 2],
    /// Centres of the vertebral bodies, finely spaced, cranial to caudal, fetal frame.
    spine: Vec<Vec3>,
    /// Level at each of `spine`.
    levels: Vec<f32>,
}

/// Relative heights of a cervical, thoracic, lumbar and sacral vertebra with its disc.
const HEIGHTS: [(usize, f32); 4] = [(7, 2.9), (12, 3.95), (5, 4.7), (5, 3.5)];

impl Attitude {
    /// How the fetus of `parameters` lies.
    pub fn of(_: &Parameters) -> Self {
        let biometry = Biometry::default();
        // Midsagittal knots from C1 to S5.
        let knots = [(36.9, -17.5), (29.5, -24.0), (21.0, -29.0), (10.0, -33.5), (-2.0, -36.8), (-14.0, -38.0)];
        let knots =
            knots.into_iter().chain([(-26.0, -37.4), (-38.0, -34.0), (-47.5, -29.0), (-55.0, -22.5), (-61.5, -15.0)]);
        let knots: Vec<(Vec3, f32)> = knots.map(|(y, z)| (Vec3::new(0.0, y, z), 0.0)).collect();
        let spine: Vec<Vec3> = catmull_rom(&knots, 12).into_iter().map(|(p, _)| p).collect();
        let levels = levels_along(&spine);

        let flexion = 25f32.to_radians();
        let vertex = Vec3::new(0.0, flexion.cos(), flexion.sin());
        let face = Vec3::new(0.0, -flexion.sin(), flexion.cos());
        let fetus_from_head = Isometry::from_axes(Vec3::new(0.0, 58.0, 1.0), vertex, face);

        // Joints lie a cartilage end beyond the ossified shafts.
        let thigh = biometry.femur_mm + 6.5;
        let shank = biometry.tibia_mm + 7.0;
        let upper = biometry.humerus_mm + 6.0;
        let fore = biometry.ulna_mm + 5.0;
        let leg = |side: f32, thigh_dir: Vec3, shank_dir: Vec3, toes: Vec3| {
            let hip = Vec3::new(side * 10.0, -51.0, -9.0);
            let knee = hip + thigh * thigh_dir.normalize();
            Leg { hip, knee, ankle: knee + shank * shank_dir.normalize(), toes: toes.normalize() }
        };
        let arm = |side: f32, upper_dir: Vec3, fore_dir: Vec3, fingers: Vec3| {
            let shoulder = Vec3::new(side * 19.0, 12.0, -19.0);
            let elbow = shoulder + upper * upper_dir.normalize();
            Arm { shoulder, elbow, wrist: elbow + fore * fore_dir.normalize(), fingers: fingers.normalize() }
        };
        Self {
            biometry,
            scene_from_fetus: scene_from_fetus(),
            fetus_from_head,
            legs: [
                leg(1.0, Vec3::new(0.0, 0.60, 0.80), Vec3::new(-0.24, -0.92, -0.34), Vec3::new(-0.12, 0.36, 0.92)),
                leg(-1.0, Vec3::new(-0.12, 0.66, 0.75), Vec3::new(0.07, -0.97, -0.22), Vec3::new(0.10, 0.48, 0.86)),
            ],
            arms: [
                arm(1.0, Vec3::new(0.12, -0.42, 0.86), Vec3::new(-0.36, 0.72, 0.58), Vec3::new(-0.15, 0.90, 0.30)),
                arm(-1.0, Vec3::new(-0.08, -0.50, 0.84), Vec3::new(0.40, 0.70, 0.56), Vec3::new(0.20, 0.85, 0.45)),
            ],
            spine,
            levels,
        }
    }

    /// `fetus_from_vertebra`: the frame of the spine at `level`, y along the spine to cranial, z ventral.
    pub fn vertebra(&self, level: f32) -> Isometry {
        let last = self.spine.len() - 1;
        let i = self.levels.partition_point(|&l| l < level).clamp(1, last);
        let (a, b) = (self.levels[i - 1], self.levels[i]);
        let t = ((level - a) / (b - a)).clamp(0.0, 1.0);
        let origin = self.spine[i - 1].lerp(self.spine[i], t);
        // The tangent over some distance, so that frames turn evenly.
        let cranial = self.spine[i.saturating_sub(4)] - self.spine[(i + 3).min(last)];
        Isometry::from_axes(origin, cranial, Vec3::X.cross(cranial))
    }

    /// The point `left`, `ventral` of the spine at `level`, fetal frame, mm.
    pub fn trunk(&self, level: f32, left: f32, ventral: f32) -> Vec3 {
        self.vertebra(level).point(Vec3::new(left, 0.0, ventral))
    }

    /// A point of the fetal frame in the scene, mm.
    pub fn scene_point(&self, fetal: Vec3) -> Vec3 {
        self.scene_from_fetus.point(fetal)
    }

    /// A direction of the fetal frame in the scene.
    pub fn scene_vector(&self, fetal: Vec3) -> Vec3 {
        self.scene_from_fetus.vector(fetal)
    }
}

/// Head down, ventral to the mother's left, left side up; tilted so that the trunk lies deeper than the head.
fn scene_from_fetus() -> Isometry {
    let lie = Isometry::from_axes(Vec3::new(-5.0, 0.0, -11.0), Vec3::NEG_Y, Vec3::X);
    let tilt = Quat::from_rotation_x(-5.5f32.to_radians());
    Isometry { rotation: (tilt * lie.rotation).normalize(), ..lie }
}

/// The level at each point of a spine from C1 to S5, spread by the vertebrae's relative heights.
fn levels_along(spine: &[Vec3]) -> Vec<f32> {
    let mut borders = vec![0.0f32];
    for (count, height) in HEIGHTS {
        for _ in 0..count {
            borders.push(borders[borders.len() - 1] + height);
        }
    }
    let mut lengths = vec![0.0f32];
    for pair in spine.windows(2) {
        lengths.push(lengths[lengths.len() - 1] + pair[0].distance(pair[1]));
    }
    let scale = borders[VERTEBRAE] / lengths[lengths.len() - 1];
    lengths
        .iter()
        .map(|&length| {
            let at = length * scale;
            let i = borders.partition_point(|&b| b < at).clamp(1, VERTEBRAE);
            (i - 1) as f32 + (at - borders[i - 1]) / (borders[i] - borders[i - 1])
        })
        .collect()
}

#[cfg(test)]
mod tests {
    use super::*;

    #[test]
    fn frames_are_right_handed_and_go_down_the_back() {
        let attitude = Attitude::of(&Parameters::default());
        for level in 0..=VERTEBRAE {
            let frame = attitude.vertebra(level as f32);
            assert!((frame.vector(Vec3::X) - Vec3::X).length() < 1e-4, "left is left at {level}");
            assert!(frame.vector(Vec3::Z).z > 0.2, "ventral is ventral at {level}");
        }
        let length: f32 = attitude.spine.windows(2).map(|p| p[0].distance(p[1])).sum();
        assert!((100.0..125.0).contains(&length), "spine of {length} mm");
        // Fetal cranial is the mother's caudal, fetal ventral her left.
        assert!(attitude.scene_vector(Vec3::Y).y < -0.9);
        assert!(attitude.scene_vector(Vec3::Z).x > 0.9);
        assert!(attitude.scene_vector(Vec3::X).z > 0.9);
    }
}
