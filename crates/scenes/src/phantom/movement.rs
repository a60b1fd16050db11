//! Motion of the phantom: fetal heartbeat, fetal breathing in bouts, stretching limbs, maternal breathing.

use glam::Vec3;
use insonify_core::anatomy::motion::{Drift, Field, Motion, Rhythm, Shape};

use super::attitude::Attitude;
use super::fetus;
use super::parameters::Parameters;
use super::vary::vary;

/// Mean fetal heart rate and its largest deviation, beats per minute: 110 to 160 is normal (ISUOG guidelines,
/// Ultrasound Obstet Gynecol 41:348, 2013).
const HEART_PER_MIN: (f64, f64) = (145.0, 12.0);
/// Shortening fraction of both ventricles: a third of the radius between diastole and systole (DeVore 1984).
const SHORTENING: f32 = 0.32;
/// Fetal breaths per minute during a bout (Patrick et al., Obstet Gynecol 56:24, 1980: 40 to 60 per minute).
const FETAL_BREATHS_PER_MIN: f64 = 50.0;
/// Change of the chest's radius in fetal inspiration, relative to the radius: 2 to 4 mm at 22 weeks (Patrick 1980).
const CHEST_WALL: f32 = -0.05;
/// Caudal movement of the diaphragm in fetal inspiration at 22 weeks, mm: 2 to 4 (Patrick 1980).
const DIAPHRAGM_MM: f32 = 2.5;
/// Breathing rate of a resting mother, per minute, and caudal displacement of the uterus by a breath, mm (assumed).
const MATERNAL_BREATHS_PER_MIN: f64 = 14.0;
const UTERUS_MM: f32 = 2.0;
/// Stretch of a knee or an elbow, degrees (assumed).
const STRETCH_DEG: f32 = 14.0;

/// Motion of the phantom of `parameters`, scene frame.
pub fn movement(parameters: &Parameters) -> Motion {
    let attitude = Attitude::of(parameters);
    let seed = parameters.seed;
    let mut fields = vec![heart(&attitude, seed), breathing(&attitude, seed)];
    for (i, side) in ["left", "right"].into_iter().enumerate() {
        let (leg, arm) = (attitude.legs[i], attitude.arms[i]);
        let foot = leg.ankle + leg.toes * (0.7 * attitude.biometry.foot_mm);
        let hand = arm.wrist + arm.fingers * (0.5 * attitude.biometry.foot_mm);
        let (leg_mm, arm_mm) = (8.0 * attitude.biometry.leg_scale(), 6.5 * attitude.biometry.arm_scale());
        let leg = [leg.hip, leg.knee, leg.ankle, foot];
        let arm = [arm.shoulder, arm.elbow, arm.wrist, hand];
        fields.push(stretch(&attitude, format!("{side} leg"), leg, leg_mm, seed.wrapping_add(11)));
        fields.push(stretch(&attitude, format!("{side} arm"), arm, arm_mm, seed));
    }
    let rhythm = Rhythm::Breath { breaths_per_min: MATERNAL_BREATHS_PER_MIN, bout_s: 1.0, pause_s: 0.0, seed };
    // The uterus moves along the skin, so the probe keeps its contact.
    Motion { fields, drift: Some(Drift { way_mm: Vec3::new(0.0, -UTERUS_MM, 0.0), rhythm }) }
}

fn named(names: &[&str]) -> Vec<String> {
    names.iter().map(|&name| name.to_owned()).collect()
}

fn heart(attitude: &Attitude, seed: u64) -> Field {
    let ([left, right, left_atrium, right_atrium], crux) = fetus::chamber_centres(attitude);
    let axis = 0.5 * (left + right) - 0.5 * (left_atrium + right_atrium);
    let (mean, spread) = HEART_PER_MIN;
    Field {
        name: "heartbeat".into(),
        surfaces: named(&["heart*"]),
        shape: Shape::Beat {
            centre_mm: attitude.scene_from_fetus.point(crux),
            axis: attitude.scene_from_fetus.vector(axis.normalize()),
            radius_mm: 13.0 * attitude.biometry.trunk_scale(),
            squeeze: SHORTENING,
            shorten: 0.16,
        },
        rhythm: Rhythm::Heart { beats_per_min: mean + spread * f64::from(vary(seed, 901)) },
    }
}

fn breathing(attitude: &Attitude, seed: u64) -> Field {
    let scale = attitude.biometry.trunk_scale();
    // Level of the diaphragm, in vertebrae from C1.
    let level = 15.5;
    Field {
        name: "fetal breathing".into(),
        surfaces: named(&[
            "fetal_skin",
            "fetal_body",
            "ribs",
            "lungs",
            "diaphragm*",
            "belly",
            "heart*",
            "liver",
            "stomach",
            "spleen",
            "gall_bladder",
            "fetal_vessel*",
            "airway",
        ]),
        shape: Shape::Breath {
            centre_mm: attitude.scene_from_fetus.point(attitude.trunk(level, 0.0, 20.0)),
            axis: -attitude.scene_from_fetus.vector(attitude.vertebra(level).vector(Vec3::Y)),
            half_length_mm: 22.0 * scale,
            radius_mm: 24.0 * scale,
            widen: CHEST_WALL,
            shift_mm: DIAPHRAGM_MM * scale,
        },
        rhythm: Rhythm::Breath { breaths_per_min: FETAL_BREATHS_PER_MIN, bout_s: 9.0, pause_s: 14.0, seed },
    }
}

/// Occasional stretching of a limb at the second of its joints `[root, hinge, next, tip]`, fetal frame, mm.
fn stretch(attitude: &Attitude, name: String, joints: [Vec3; 4], radius_mm: f32, seed: u64) -> Field {
    let [root, hinge, next, tip] = joints;
    // A positive rotation about this axis bends the joint, a negative rotation stretches it.
    let axis = (hinge - root).cross(next - hinge).normalize_or(Vec3::X);
    let end = hinge + (next - hinge).normalize() * (next.distance(hinge) + 0.6 * tip.distance(next));
    // Each limb stretches at its own times.
    let seed = name.bytes().fold(seed, |h, b| h.wrapping_mul(31).wrapping_add(b.into()));
    Field {
        name,
        surfaces: named(&["fetal_skin", "fetal_body", "long_bones", "hand_and_foot_bones", "cartilage"]),
        shape: Shape::Swing {
            joint_mm: attitude.scene_from_fetus.point(hinge),
            end_mm: attitude.scene_from_fetus.point(end),
            axis: attitude.scene_from_fetus.vector(axis),
            radius_mm,
            angle_deg: -STRETCH_DEG,
        },
        rhythm: Rhythm::Twitch { every_s: 13.0, lasts_s: 1.6, seed },
    }
}

#[cfg(test)]
mod tests {
    use super::*;
    use crate::phantom::organs;

    #[test]
    fn every_phantom_moves_within_the_ranges_and_names_existing_surfaces() {
        for (weeks, seed) in [(16.0, 0), (22.0, 3), (34.0, 8)] {
            let parameters = Parameters { gestational_weeks: weeks, seed, ..Parameters::default() };
            let motion = movement(&parameters);
            let organs = organs(&parameters);
            assert_eq!(motion.validate(organs.iter().map(|o| o.name)), Ok(()));
            for surface in motion.fields.iter().flat_map(|f| &f.surfaces).filter(|s| !s.ends_with('*')) {
                assert!(organs.iter().any(|o| o.name == surface), "no surface is called `{surface}`");
            }
        }
    }
}
