//! Attitude of the fetus: frames of its head, trunk and limbs.
//!
//! In the **fetal frame**, x points to the fetus' left, y cranially and z ventrally. Parts are modelled in it, or in
//! the frame of the head or of a vertebra (same axes, rotated). The fetus is then placed in the scene as a whole. Trunk
//! and head are drawn at their size at 22 weeks and scaled by [`Biometry::trunk_scale`] and [`Biometry::head_scale`]. A
//! *level* is a position along the spine, counted in vertebrae from C1.

use glam::{Quat, Vec3};
use insonify_core::anatomy::sdf::{Isometry, Solid, ellipsoid};

use super::biometry::Biometry;
use super::spine::Spine;
use super::vary::vary;

pub(crate) use super::spine::VERTEBRAE;

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

/// Attitude of the fetus and its placement in the scene.
#[derive(Debug, Clone)]
pub struct Attitude {
    /// Sizes of the fetus.
    pub biometry: Biometry,
    /// Isometry from the fetal frame to the scene frame, mm.
    pub scene_from_fetus: Isometry,
    /// Isometry from the head's frame to the fetal frame, mm. The head's frame has its origin at the skull's centre, y
    /// to the vertex, z to the face.
    pub fetus_from_head: Isometry,
    /// Left and right leg.
    pub legs: [Leg; 2],
    /// Left and right arm.
    pub arms: [Arm; 2],
    spine: Spine,
}

/// Key directions of a left limb's segments (upper, lower, hand or foot) at flexions 0, 0.5 and 1, fetal frame. A right
/// limb is the mirror image.
struct Pose {
    upper: [[f32; 3]; 3],
    lower: [[f32; 3]; 3],
    end: [[f32; 3]; 3],
}

const LEGS: [Pose; 2] = [
    Pose {
        upper: [[0.12, 0.20, 0.97], [0.0, 0.60, 0.80], [0.04, 0.70, 0.71]],
        lower: [[-0.08, -0.97, -0.10], [-0.24, -0.92, -0.34], [-0.20, -0.95, -0.24]],
        end: [[-0.06, 0.10, 0.99], [-0.12, 0.36, 0.92], [-0.12, 0.30, 0.94]],
    },
    Pose {
        upper: [[0.20, 0.06, 0.98], [0.12, 0.66, 0.75], [0.10, 0.72, 0.69]],
        lower: [[-0.02, -0.98, 0.02], [-0.07, -0.97, -0.22], [-0.02, -0.97, -0.20]],
        end: [[-0.06, 0.06, 0.99], [-0.10, 0.48, 0.86], [-0.10, 0.40, 0.90]],
    },
];

const ARMS: [Pose; 2] = [
    Pose {
        upper: [[0.30, -0.62, 0.72], [0.12, -0.42, 0.86], [0.14, -0.36, 0.90]],
        lower: [[-0.34, 0.30, 0.90], [-0.36, 0.72, 0.58], [-0.30, 0.74, 0.58]],
        end: [[-0.20, 0.60, 0.70], [-0.15, 0.90, 0.30], [-0.15, 0.90, 0.30]],
    },
    Pose {
        upper: [[0.26, -0.74, 0.62], [0.08, -0.50, 0.84], [0.12, -0.40, 0.89]],
        lower: [[-0.30, 0.36, 0.88], [-0.40, 0.70, 0.56], [-0.34, 0.70, 0.62]],
        end: [[-0.20, 0.70, 0.60], [-0.20, 0.85, 0.45], [-0.20, 0.85, 0.45]],
    },
];

/// Unit direction at `flexion`, interpolated between the three key directions. `side` is 1 for a left and −1 for a
/// right limb.
fn between(keys: &[[f32; 3]; 3], flexion: f32, side: f32) -> Vec3 {
    let [a, b, c] = keys.map(|k| Vec3::from(k).normalize());
    let v = if flexion < 0.5 { a.lerp(b, 2.0 * flexion) } else { b.lerp(c, 2.0 * flexion - 1.0) };
    (v * Vec3::new(side, 1.0, 1.0)).normalize()
}

/// Largest rotation, about each axis, of a limb's segment from its mean direction, rad.
const LIMB_VARIATION_RAD: f32 = 0.16;

impl Attitude {
    /// Attitude in the fetal frame, not placed in the scene. `variation`, 0 to 1, scales the differences between
    /// individuals. `spread` is an angle, rad, by which limbs are rotated apart and away from the face.
    pub(super) fn posed(biometry: &Biometry, flexion: f32, seed: u64, variation: f32, spread: f32) -> Self {
        let drawn = Spine::drawn();
        let bend = 1.0 + 0.5 * (flexion - 0.5);
        let spine = drawn.bent(bend, biometry.spine_mm / drawn.length_mm());
        let trunk = biometry.trunk_scale();
        // Moves a point of the drawn fetus with the vertebra at `level`.
        let moved = |level: f32, point: Vec3| {
            let local = drawn.vertebra(level).local_point(point);
            spine.vertebra(level).point(local * trunk)
        };
        let turned =
            |level: f32| (spine.vertebra(level).rotation * drawn.vertebra(level).rotation.conjugate()).normalize();

        let nod = 25f32.to_radians();
        let vertex = Vec3::new(0.0, nod.cos(), nod.sin());
        let face = Vec3::new(0.0, -nod.sin(), nod.cos());
        let drawn_head = Isometry::from_axes(Vec3::new(0.0, 58.0, 1.0), vertex, face);
        let on_neck = drawn.vertebra(0.0).local_point(drawn_head.translation) * biometry.head_scale();
        let neck = Quat::from_rotation_x((8.0 * (flexion - 0.5) + 3.0 * variation * vary(seed, 1)).to_radians());
        let fetus_from_head = Isometry {
            rotation: (neck * turned(0.0) * drawn_head.rotation).normalize(),
            translation: spine.vertebra(0.0).translation + neck * (spine.vertebra(0.0).vector(on_neck)),
        };

        let limb = |pose: &Pose, i: usize, what: u64, level: f32| {
            let side = if i == 0 { 1.0 } else { -1.0 };
            let jitter = |v: Vec3, k: u64| {
                let turn = |axis: u64| LIMB_VARIATION_RAD * variation * vary(seed, 100 * what + 10 * k + axis);
                // `spread` moves the elbows outward, the forearms apart and away from the face, the thighs away from
                // the elbows, and the shanks outward.
                let apart = match (level < 15.0, k) {
                    (true, 0) => Quat::from_rotation_y(0.7 * side * spread),
                    (true, _) => Quat::from_rotation_x(0.3 * spread) * Quat::from_rotation_y(side * spread),
                    (false, 0) => Quat::from_rotation_x(0.6 * spread) * Quat::from_rotation_y(0.3 * side * spread),
                    (false, _) => Quat::from_rotation_z(0.5 * side * spread),
                };
                turned(level) * apart * Quat::from_euler(glam::EulerRot::XYZ, turn(0), turn(1), turn(2)) * v
            };
            [&pose.upper, &pose.lower, &pose.end]
                .into_iter()
                .zip(0..)
                .map(|(keys, k)| jitter(between(keys, flexion, side), k))
                .collect::<Vec<_>>()
        };
        // The distance between two joints is the ossified shaft plus the cartilage at its ends.
        let (leg_scale, arm_scale) = (biometry.leg_scale(), biometry.arm_scale());
        let leg = |i: usize| {
            let side = if i == 0 { 1.0 } else { -1.0 };
            let d = limb(&LEGS[i], i, 2 + i as u64, 26.0);
            let hip = moved(26.0, Vec3::new(side * 10.0, -51.0, -9.0));
            let knee = hip + (biometry.femur_mm + 6.5 * leg_scale) * d[0];
            Leg { hip, knee, ankle: knee + (biometry.tibia_mm + 7.0 * leg_scale) * d[1], toes: d[2].normalize() }
        };
        let arm = |i: usize| {
            let side = if i == 0 { 1.0 } else { -1.0 };
            let d = limb(&ARMS[i], i, 4 + i as u64, 9.0);
            let shoulder = moved(9.0, Vec3::new(side * 19.0, 12.0, -19.0));
            let elbow = shoulder + (biometry.humerus_mm + 6.0 * arm_scale) * d[0];
            Arm {
                shoulder,
                elbow,
                wrist: elbow + (biometry.ulna_mm + 5.0 * arm_scale) * d[1],
                fingers: d[2].normalize(),
            }
        };
        Self {
            biometry: *biometry,
            scene_from_fetus: Isometry::IDENTITY,
            fetus_from_head,
            legs: [leg(0), leg(1)],
            arms: [arm(0), arm(1)],
            spine,
        }
    }

    /// Isometry from the frame of the vertebra at `level` to the fetal frame, mm: y cranial along the spine, z ventral.
    pub fn vertebra(&self, level: f32) -> Isometry {
        self.spine.vertebra(level)
    }

    /// Point at the distances `left` and `ventral` (mm at 22 weeks) from the spine at `level`; fetal frame, mm.
    pub fn trunk(&self, level: f32, left: f32, ventral: f32) -> Vec3 {
        self.vertebra(level).point(Vec3::new(left, 0.0, ventral) * self.biometry.trunk_scale())
    }

    /// Centre and radius of a ball about the point [`Self::trunk`], fetal frame, mm. `radius` is in mm at 22 weeks.
    pub(crate) fn knot(&self, level: f32, left: f32, ventral: f32, radius: f32) -> (Vec3, f32) {
        (self.trunk(level, left, ventral), radius * self.biometry.trunk_scale())
    }

    /// Converts a solid in the frame of the vertebra at `level`, drawn in mm at 22 weeks, to the fetal frame.
    pub(crate) fn in_trunk(&self, level: f32, solid: Solid) -> Solid {
        solid.scaled(self.biometry.trunk_scale()).placed(self.vertebra(level))
    }

    /// Ellipsoid in the fetal frame. `centre` and `semi` are drawn in the frame of the vertebra at `level`, mm at 22
    /// weeks.
    pub(crate) fn in_trunk_ellipsoid(&self, level: f32, centre: Vec3, semi: Vec3) -> Solid {
        self.in_trunk(level, ellipsoid(centre, semi))
    }

    /// Converts a solid drawn in the head's frame (mm at 22 weeks) to the fetal frame.
    pub(crate) fn in_head(&self, solid: Solid) -> Solid {
        solid.scaled(self.biometry.head_scale()).placed(self.fetus_from_head)
    }

    /// Converts a point drawn in the head's frame (mm at 22 weeks) to the fetal frame, mm.
    pub(crate) fn head_point(&self, drawn: Vec3) -> Vec3 {
        self.fetus_from_head.point(drawn * self.biometry.head_scale())
    }
}

#[cfg(test)]
mod tests {
    use super::*;
    use crate::phantom::parameters::{Lie, Parameters};

    #[test]
    fn frames_are_right_handed_and_descend_along_the_back() {
        for flexion in [0.0, 0.5, 1.0] {
            let attitude = Attitude::of(&Parameters { flexion, ..Parameters::default() });
            for level in 0..=VERTEBRAE {
                let frame = attitude.vertebra(level as f32);
                assert!((frame.vector(Vec3::X) - Vec3::X).length() < 1e-4, "left is left at {level}");
                assert!(frame.vector(Vec3::Z).z > 0.1, "ventral is ventral at {level}");
            }
        }
    }

    #[test]
    fn the_head_points_in_the_direction_of_the_lie() {
        let head = [
            (Lie::Cephalic, Vec3::NEG_Y),
            (Lie::Breech, Vec3::Y),
            (Lie::TransverseHeadLeft, Vec3::X),
            (Lie::TransverseHeadRight, Vec3::NEG_X),
        ];
        for (lie, towards) in head {
            let attitude = Attitude::of(&Parameters { lie, ..Parameters::default() });
            assert!(attitude.scene_from_fetus.vector(Vec3::Y).dot(towards) > 0.85, "{lie:?}");
            assert!(attitude.scene_from_fetus.vector(Vec3::X).z > 0.85, "{lie:?}: the left side is up");
            assert!(
                attitude.scene_from_fetus.point(attitude.fetus_from_head.translation).dot(towards) > 30.0,
                "{lie:?}"
            );
        }
        // A quarter turn brings the back or the belly up.
        let rolled = Attitude::of(&Parameters { roll_deg: 90.0, ..Parameters::default() });
        assert!(rolled.scene_from_fetus.vector(Vec3::Z).z.abs() > 0.85);
    }
}
