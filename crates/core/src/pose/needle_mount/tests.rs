//! Tests that find known needles from exact and from noisy motions.

use std::f64::consts::TAU;

use glam::DQuat;
use proptest::prelude::*;

use super::super::transform::any_pose;
use super::*;
use crate::pose::Calibration;
use crate::random::SplitMix64;

const DIMPLE: DVec3 = DVec3::new(210.0, -90.0, 40.0);

/// A needle of 90 mm whose sensor sits at the hub, 15 mm aside of the shaft.
struct Needle {
    sensor_from_needle: Pose,
    noise_deg: f64,
    random: SplitMix64,
}

impl Needle {
    fn new(turn: DQuat, tip_mm: DVec3, noise_deg: f64) -> Self {
        let sensor_from_needle = Pose { position_mm: turn * tip_mm, orientation: turn };
        Self { sensor_from_needle, noise_deg, random: SplitMix64::new(7) }
    }

    fn at_hub(noise_deg: f64) -> Self {
        let turn = DQuat::from_rotation_y(0.7) * DQuat::from_rotation_x(-1.1);
        Self::new(turn, DVec3::new(15.0, 4.0, 92.0), noise_deg)
    }

    fn axis(&self) -> DVec3 {
        self.sensor_from_needle.orientation * DVec3::Z
    }

    /// 300 sensor poses of a needle whose tip rests in the dimple with the given orientations, with noise.
    fn poses(&mut self, orientation: impl Fn(f64) -> DQuat) -> Vec<Pose> {
        // The sum of twelve numbers of 0..1 has the variance 1 and is nearly normal.
        let mut normal = || (0..12).map(|_| self.random.unit()).sum::<f64>() - 6.0;
        let noise = self.noise_deg.to_radians();
        let pose = |i: u32| {
            let orientation = orientation(f64::from(i) / 300.0);
            let sensor = Pose { position_mm: DIMPLE, orientation } * self.sensor_from_needle.inverse();
            let turn = DQuat::from_scaled_axis(noise * DVec3::new(normal(), normal(), normal()));
            Pose { orientation: sensor.orientation * turn, ..sensor }
        };
        (0..300).map(pose).collect()
    }

    fn tilted(&mut self, tilt: f64) -> Vec<Pose> {
        self.poses(|part| {
            let axis = DVec3::new((5.0 * TAU * part).cos(), (5.0 * TAU * part).sin(), 0.0);
            DQuat::from_axis_angle(axis, tilt * (0.3 + 0.7 * part)) * DQuat::from_rotation_x(2.6)
        })
    }

    /// Poses of a needle that is turned about its shaft by up to `spin` rad each way, from 0 on.
    fn spun(&mut self, spin: f64, wander: f64) -> Vec<Pose> {
        self.poses(|part| {
            let lean = DVec3::new((3.0 * TAU * part).sin(), (7.0 * TAU * part).sin(), 0.0);
            DQuat::from_scaled_axis(wander * lean)
                * DQuat::from_rotation_x(2.6)
                * DQuat::from_rotation_z(spin * (2.0 * TAU * part).sin())
        })
    }
}

fn angle_deg(a: DVec3, b: DVec3) -> f64 {
    a.cross(b).length().atan2(a.dot(b)).to_degrees()
}

/// The complete mounting from a pivot and a spin, taken in both orders.
fn both_orders(tilted: &[Pose], spun: &[Pose], towards_tip: Option<DVec3>) -> Result<[NeedleMount; 2], NeedleError> {
    let (pivot, spin) = (pivot(tilted)?, spin::calibrate(spun).unwrap());
    let (mut a, mut b) = (NeedleCalibration::default(), NeedleCalibration::default());
    let first = a.set_tip(&pivot).and_then(|()| a.set_axis(&spin, towards_tip));
    let second = b.set_axis(&spin, towards_tip).and_then(|_| b.set_tip(&pivot));
    assert_eq!(first.is_err(), second.is_err());
    first.and(second)?;
    assert_eq!(a, b, "the file is the same in either order");
    Ok([a.mount()?, b.mount()?])
}

proptest! {
    #![proptest_config(ProptestConfig { cases: 48, failure_persistence: None, ..ProptestConfig::default() })]

    #[test]
    fn exact_motions_give_the_mounting(mounted in any_pose()) {
        let mut needle = Needle::new(mounted.orientation, DVec3::new(15.0, 4.0, 92.0), 0.0);
        let (tilted, spun) = (needle.tilted(0.6), needle.spun(1.4, 0.0));
        let [found, other] = both_orders(&tilted, &spun, None).unwrap();
        prop_assert_eq!(found, other);
        prop_assert!(found.tip_mm.distance(needle.sensor_from_needle.position_mm) < 1e-6);
        prop_assert!(angle_deg(found.axis, needle.axis()) < 1e-5, "{:?}", found);
        let pose = found.sensor_from_needle();
        prop_assert!(pose.transform_point(DVec3::ZERO).distance(found.tip_mm) < 1e-9);
        prop_assert!(pose.transform_vector(DVec3::Z).distance(found.axis) < 1e-9);
    }

    #[test]
    fn the_needle_in_the_tracker_does_not_depend_on_the_sensors_mounting(tracker in any_pose(), mounted in any_pose()) {
        let mut needle = Needle::at_hub(0.3);
        let (tilted, spun) = (needle.tilted(0.6), needle.spun(1.4, 0.01));
        // The sensor stays near the hub: up to 10 mm away in each direction.
        let mounted = Pose { position_mm: 0.01 * mounted.position_mm, ..mounted };
        let found = |change: &dyn Fn(&Pose) -> Pose| {
            let [tilted, spun] = [&tilted, &spun].map(|poses| poses.iter().map(change).collect::<Vec<_>>());
            let mut needle = NeedleCalibration::default();
            needle.set_tip(&pivot(&tilted).unwrap()).unwrap();
            needle.set_axis(&spin::calibrate(&spun).unwrap(), None).unwrap();
            (needle, spun[0])
        };
        let (mut before, first) = found(&|pose| *pose);
        before.set_bevel(&first, DVec3::X).unwrap();
        let before = first * before.mount().unwrap().sensor_from_needle();
        let (mut after, first) = found(&|pose| tracker * *pose * mounted);
        after.set_bevel(&first, tracker.transform_vector(DVec3::X)).unwrap();
        let after = tracker.inverse() * first * after.mount().unwrap().sensor_from_needle();
        prop_assert!(before.position_mm.distance(after.position_mm) < 1e-5, "{:?} {:?}", before, after);
        prop_assert!(before.orientation.angle_between(after.orientation) < 1e-6, "{:?} {:?}", before, after);
    }
}

#[test]
fn noise_costs_some_hundredths_of_a_degree_and_less_than_a_millimetre() {
    let mut needle = Needle::at_hub(0.3);
    let (tilted, spun) = (needle.tilted(0.6), needle.spun(1.4, 0.0));
    let [found, _] = both_orders(&tilted, &spun, None).unwrap();
    assert!(angle_deg(found.axis, needle.axis()) < 0.05, "{found:?}");
    assert!(found.tip_mm.distance(needle.sensor_from_needle.position_mm) < 0.3, "{found:?}");
    let across_mm = found.across_mm().unwrap();
    assert!((0.01..0.1).contains(&across_mm), "{across_mm}");
    let half_degree = NeedleMount { axis_deg: Some(0.5), tip_mm: DVec3::Z * 90.0, ..found };
    assert!((half_degree.across_mm().unwrap() - 0.785).abs() < 1e-3);
    let said = half_degree.to_string();
    assert!(
        said.contains("tip 90.0 mm from its sensor") && said.contains("0.500°, which is 0.79 mm over 90 mm"),
        "{said}"
    );
}

#[test]
fn a_sensor_level_with_the_tip_needs_a_stated_sense() {
    let mut needle = Needle::new(DQuat::IDENTITY, DVec3::new(40.0, 0.0, 3.0), 0.0);
    let (tilted, spun) = (needle.tilted(0.6), needle.spun(1.4, 0.0));
    let open = both_orders(&tilted, &spun, None).unwrap_err();
    assert!(matches!(open, NeedleError::Level { .. }), "{open}");
    assert!(open.to_string().contains("may point either way") && open.to_string().contains("--towards-tip"), "{open}");
    for sense in [1.0, -1.0] {
        let [found, other] = both_orders(&tilted, &spun, Some(sense * DVec3::Z)).unwrap();
        assert!(found == other && angle_deg(found.axis, sense * DVec3::Z) < 1e-5, "{found:?}");
    }
    let beside = both_orders(&tilted, &spun, Some(DVec3::X)).unwrap_err();
    assert!(matches!(beside, NeedleError::TowardsTip { .. }), "{beside}");
}

#[test]
fn a_stated_sense_must_not_contradict_the_tip() {
    let mut needle = Needle::at_hub(0.0);
    let (tilted, spun) = (needle.tilted(0.6), needle.spun(1.4, 0.0));
    let axis = needle.axis();
    let [found, _] = both_orders(&tilted, &spun, Some(axis)).unwrap();
    assert!(angle_deg(found.axis, axis) < 1e-5);
    let reversed = both_orders(&tilted, &spun, Some(-axis)).unwrap_err();
    assert!(matches!(reversed, NeedleError::Reversed { along_mm } if (along_mm - 92.0).abs() < 0.1), "{reversed}");
    // Values from elsewhere, such as those of a tool whose origin is its tip, state the sense in the file.
    let known = NeedleCalibration { tip_mm: Some(DVec3::ZERO), axis: Some(DVec3::X), ..NeedleCalibration::default() };
    assert!(matches!(known.mount(), Err(NeedleError::Level { .. })));
    let stated = NeedleCalibration { points_to_tip: true, ..known };
    assert_eq!(stated.mount().unwrap().sensor_from_needle().transform_vector(DVec3::Z), DVec3::X);
}

#[test]
fn what_is_missing_is_named_with_its_command() {
    let calibration = |needle| Calibration { needle, ..Calibration::default() };
    let nothing = calibration(None).needle_mount().unwrap_err();
    assert_eq!(nothing, NeedleError::Unknown);
    let both = ["`insonify calibrate pivot --of needle`", "`insonify calibrate spin --of needle`"];
    assert!(both.iter().all(|command| nothing.to_string().contains(command)), "{nothing}");
    let tip = NeedleCalibration { tip_mm: Some(DVec3::Z * 90.0), ..NeedleCalibration::default() };
    let axis = NeedleCalibration { axis: Some(DVec3::Z), ..NeedleCalibration::default() };
    for (needle, missing, there) in [(axis, both[0], both[1]), (tip, both[1], both[0])] {
        let said = calibration(Some(needle)).needle_mount().unwrap_err().to_string();
        assert!(said.contains(missing) && !said.contains(there), "{said}");
    }
    let whole = NeedleCalibration { axis: Some(-DVec3::Z), ..tip };
    assert_eq!(calibration(Some(whole)).needle_mount().unwrap().axis, DVec3::Z);
}

#[test]
fn wrong_motions_are_refused_with_what_to_do() {
    let mut needle = Needle::at_hub(0.3);
    let refused = |poses: &[Pose]| pivot(poses).unwrap_err().to_string();
    // A turn about the shaft is no pivot, also if the hand is unsteady.
    for wander in [0.0, 0.06] {
        let said = refused(&needle.spun(1.4, wander));
        assert!(said.contains("tilted by") && said.contains("`insonify calibrate spin --of needle`"), "{said}");
    }
    assert!(refused(&needle.tilted(0.1)).contains("tilt it by at least 30° to all sides"));
    assert!(refused(&needle.tilted(0.6)[..5]).contains("5 poses are too few"));
    // Tilts to one side and back.
    let plane = needle.poses(|part| DQuat::from_rotation_x(0.6 * (3.0 * TAU * part).sin()));
    assert!(refused(&plane).contains("tilt it by 30° to all sides"));
    let tilted = needle.tilted(0.6);
    let spin = spin::calibrate(&tilted).unwrap_err().to_string();
    assert!(spin.contains("`insonify calibrate pivot --of needle`"), "{spin}");
    // A turn about another line than the shaft runs past the tip.
    let mut aside = Needle::new(DQuat::from_rotation_x(TAU / 4.0), DVec3::new(90.0, 0.0, 8.0), 0.0);
    let said = both_orders(&aside.tilted(0.6), &aside.spun(1.4, 0.0), None).unwrap_err().to_string();
    assert!(said.contains("turned about its own shaft?"), "{said}");
}

#[test]
fn the_bevel_is_known_from_the_first_pose() {
    let mut needle = Needle::at_hub(0.0);
    let spun = needle.spun(1.4, 0.0);
    let spin = spin::calibrate(&spun).unwrap();
    let x = needle.sensor_from_needle.orientation * DVec3::X;
    let mut found = NeedleCalibration::default();
    assert_eq!(found.set_bevel(&spun[0], DVec3::X), Err(NeedleError::NoAxis));
    found.set_axis(&spin, None).unwrap();
    assert!(found.mount().is_err_and(|error| error == NeedleError::NoTip));
    // At the first pose the needle's x is the tracker's x; the user's direction is a little off.
    found.set_bevel(&spun[0], DVec3::new(1.0, 0.0, 0.1).normalize()).unwrap();
    assert!(angle_deg(found.bevel.unwrap(), x) < 6.0);
    assert!(found.bevel.unwrap().dot(spin.axis).abs() < 1e-9);
    let along = spun[0].orientation * spin.axis;
    assert!(
        matches!(found.set_bevel(&spun[0], along), Err(NeedleError::BevelAlongShaft { angle_deg }) if angle_deg < 1e-3)
    );
    found.set_tip(&pivot(&needle.tilted(0.6)).unwrap()).unwrap();
    let pose = found.mount().unwrap().sensor_from_needle();
    assert!(angle_deg(pose.transform_vector(DVec3::X), found.bevel.unwrap()) < 1e-5);
    // A repeated spin keeps the bevel; that of a sensor mounted anew does not.
    assert_eq!(found.set_axis(&spin, None), Ok(false));
    assert!(found.bevel.is_some());
    let mut anew = Needle::new(DQuat::from_rotation_x(1.0) * needle.sensor_from_needle.orientation, DVec3::Z, 0.0);
    found.tip_mm = None;
    assert_eq!(found.set_axis(&spin::calibrate(&anew.spun(1.4, 0.0)).unwrap(), None), Ok(true));
    assert_eq!(found.bevel, None);
}
