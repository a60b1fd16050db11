//! Tests that find known mountings from exact and from noisy steps.

use std::f64::consts::TAU;

use proptest::prelude::*;

use super::*;
use crate::random::SplitMix64;

const DIMPLE: DVec3 = DVec3::new(210.0, -90.0, 40.0);

/// A probe with a convex face 56 mm wide and 8 mm high, and a sensor at any orientation.
struct Probe {
    sensor_from_probe: Pose,
    arc_mm: f64,
    noise_mm: f64,
    random: SplitMix64,
}

impl Probe {
    fn new(turn: DQuat, arc_mm: f64, noise_mm: f64) -> Self {
        let sensor_from_probe = Pose { position_mm: turn * DVec3::new(4.0, -18.0, 95.0), orientation: turn };
        Self { sensor_from_probe, arc_mm, noise_mm, random: SplitMix64::new(3) }
    }

    fn end(&self, side: f64) -> DVec3 {
        DVec3::new(28.0 * side, 0.0, -self.arc_mm)
    }

    /// Sensor poses of a probe at `tracker_from_probe`, with noise.
    fn poses(&mut self, count: usize, at: impl Fn(f64) -> Pose) -> Vec<Pose> {
        let mut unit = |scale: f64| scale * (2.0 * self.random.unit() - 1.0);
        let noise = self.noise_mm;
        let mut noisy = |part: f64| {
            let shift = DVec3::new(unit(noise), unit(noise), unit(noise));
            let turn = DQuat::from_scaled_axis(0.002 * DVec3::new(unit(noise), unit(noise), unit(noise)));
            let pose = at(part) * self.sensor_from_probe.inverse();
            Pose { position_mm: pose.position_mm + shift, orientation: turn * pose.orientation }
        };
        (0..count).map(|i| noisy(i as f64 / count as f64)).collect()
    }

    /// Poses with the point `rests` of the probe in the dimple, tilted to all sides by up to `tilt` rad.
    fn tilted(&mut self, rests: DVec3, tilt: f64) -> Vec<Pose> {
        self.poses(300, |part| {
            let axis = DVec3::new((5.0 * TAU * part).cos(), (5.0 * TAU * part).sin(), 0.0);
            let lean = DQuat::from_axis_angle(axis, tilt * (0.3 + 0.7 * part));
            let down = DQuat::from_rotation_x(TAU / 2.0);
            let orientation = lean * down * DQuat::from_rotation_z(0.5 * tilt * (3.0 * TAU * part).sin());
            Pose { position_mm: DIMPLE - orientation * rests, orientation }
        })
    }

    fn spun(&mut self, wobble: f64) -> Vec<Pose> {
        self.poses(300, |part| {
            let shaken = DVec3::new((9.0 * TAU * part).cos(), (7.0 * TAU * part).sin(), 0.0);
            let lean = DQuat::from_scaled_axis(wobble * shaken);
            let orientation =
                lean * DQuat::from_rotation_x(TAU / 2.0) * DQuat::from_rotation_z(2.0 * (TAU * part).sin());
            Pose { position_mm: DIMPLE, orientation }
        })
    }

    /// Poses of a slide along the probe's −x, with the marker's side ahead.
    fn slid(&mut self) -> Vec<Pose> {
        let orientation = DQuat::from_rotation_y(0.3) * DQuat::from_rotation_x(TAU / 2.0);
        self.poses(200, |part| Pose { position_mm: DIMPLE - orientation * DVec3::X * 150.0 * part, orientation })
    }

    fn off_deg(&self, found: &ProbeMount) -> f64 {
        angle_between(found.sensor_from_probe.orientation, self.sensor_from_probe.orientation).to_degrees()
    }
}

fn any_turn() -> impl Strategy<Value = DQuat> {
    (prop::array::uniform3(-1.0..1.0_f64), -3.0..3.0_f64)
        .prop_map(|(axis, angle)| DQuat::from_axis_angle(DVec3::from_array(axis).normalize_or(DVec3::X), angle))
}

proptest! {
    #![proptest_config(ProptestConfig { cases: 32, failure_persistence: None, ..ProptestConfig::default() })]

    #[test]
    fn exact_steps_give_the_mounting(turn in any_turn(), arc in prop_oneof![Just(0.0), Just(8.0)]) {
        let mut probe = Probe::new(turn, arc, 0.0);
        let (pivot, spin) = (probe.tilted(DVec3::ZERO, 0.6), probe.spun(0.0));
        let ends = [probe.end(-1.0), probe.end(1.0)].map(|end| probe.tilted(end, 0.1));
        let [marker, other] = &ends;
        let slid = probe.slid();
        let by_ends = MountSteps { pivot: &pivot, ends: Some([marker, other]), slide: None, spin: Some(&spin) };
        let by_slide = MountSteps { ends: None, slide: Some(&slid), ..by_ends };
        for steps in [by_ends, by_slide] {
            let found = mount(&steps).unwrap();
            prop_assert!(probe.off_deg(&found) < 1e-4, "{} {:?}", probe.off_deg(&found), found);
            prop_assert!(found.position_mm.distance(probe.sensor_from_probe.position_mm) < 1e-6);
            prop_assert!(found.square_deg < 1e-4 && found.beam_from == BeamSource::Spin);
        }
        let by_arc = mount(&MountSteps { spin: None, ..by_ends });
        if arc > 0.0 {
            let found = by_arc.unwrap();
            prop_assert!(probe.off_deg(&found) < 1e-4 && found.beam_from == BeamSource::Arc);
            prop_assert!((found.width_mm.unwrap() - 56.0).abs() < 1e-6 && (found.arc_mm.unwrap() - 8.0).abs() < 1e-6);
        } else {
            let refused = by_arc.unwrap_err().to_string();
            prop_assert!(refused.contains("(--spin)") && refused.contains("too flat"), "{}", refused);
        }
    }

    #[test]
    fn noise_and_a_shaky_hand_cost_a_degree_or_two(turn in any_turn()) {
        let mut probe = Probe::new(turn, 8.0, 0.5);
        let (pivot, spin) = (probe.tilted(DVec3::ZERO, 0.6), probe.spun(0.05));
        let ends = [probe.end(-1.0), probe.end(1.0)].map(|end| probe.tilted(end, 0.1));
        let [marker, other] = &ends;
        let steps = MountSteps { pivot: &pivot, ends: Some([marker, other]), slide: None, spin: Some(&spin) };
        let found = mount(&steps).unwrap();
        prop_assert!(probe.off_deg(&found) < 1.5, "{} {:?}", probe.off_deg(&found), found);
        prop_assert!((1.0..6.0).contains(&found.beam_scatter_deg), "{:?}", found);
        let found = mount(&MountSteps { spin: None, ..steps }).unwrap();
        prop_assert!(probe.off_deg(&found) < 3.0, "{} {:?}", probe.off_deg(&found), found);
    }
}

#[test]
fn exchanged_ends_turn_the_probe_by_half_a_turn() {
    let mut probe = Probe::new(DQuat::from_rotation_y(0.7), 8.0, 0.0);
    let pivot = probe.tilted(DVec3::ZERO, 0.6);
    let [marker, other] = [-1.0, 1.0].map(|side| {
        let end = probe.end(side);
        probe.tilted(end, 0.1)
    });
    let found = mount(&MountSteps { pivot: &pivot, ends: Some([&other, &marker]), ..MountSteps::default() }).unwrap();
    assert!((probe.off_deg(&found) - 180.0).abs() < 1e-4);
}

#[test]
fn steps_that_fail_are_refused_with_the_reason() {
    let mut probe = Probe::new(DQuat::from_rotation_y(0.7), 8.0, 0.0);
    let pivot = probe.tilted(DVec3::ZERO, 0.6);
    let ends = [probe.end(-1.0), probe.end(1.0), probe.end(0.2), 3.0 * probe.end(1.0)];
    let [marker, other, near, far] = ends.map(|end| probe.tilted(end, 0.1));
    let (spin, shaky, slid) = (probe.spun(0.0), probe.spun(0.3), probe.slid());
    let all = MountSteps { pivot: &pivot, ends: Some([&marker, &other]), slide: None, spin: Some(&spin) };
    let refused = |steps: MountSteps<'_>| mount(&steps).unwrap_err().to_string();
    assert!(refused(MountSteps { pivot: &pivot[..5], ..all }).contains("5 poses are too few"));
    assert!(refused(MountSteps { ends: None, ..all }).contains("--marker-end, --other-end"));
    assert!(refused(MountSteps { ends: None, slide: Some(&slid), spin: None, ..all }).contains("(--spin)"));
    assert!(
        refused(MountSteps { ends: Some([&marker, &[]]), ..all }).contains("the other end of the face: there are no")
    );
    assert!(refused(MountSteps { ends: Some([&marker, &near]), ..all }).contains("mixed up"));
    assert!(refused(MountSteps { ends: Some([&far, &marker]), ..all }).contains("mixed up"));
    assert!(refused(MountSteps { ends: Some([&marker, &marker]), ..all }).contains("0.0 mm apart"));
    assert!(refused(MountSteps { ends: Some([&marker, &slid]), ..all }).contains("moved by"));
    assert!(refused(MountSteps { spin: Some(&marker), ..all }).contains("turn it by at least 60°"));
    assert!(refused(MountSteps { spin: Some(&shaky), ..all }).contains("keep the probe upright"));
    assert!(refused(MountSteps { ends: None, slide: Some(&marker), ..all }).contains("slide along a ruler"));
    // A slide of another probe contradicts the ends of the face.
    let crossed = probe.poses(200, |part| Pose {
        position_mm: DIMPLE - DVec3::Y * 150.0 * part,
        orientation: DQuat::from_rotation_x(TAU / 2.0),
    });
    assert!(refused(MountSteps { slide: Some(&crossed), ..all }).contains("lateral axes are 90° apart"));
}

#[test]
fn exchanged_ends_are_told_by_a_slide() {
    let mut probe = Probe::new(DQuat::from_rotation_y(0.7), 8.0, 0.0);
    let (pivot, slid) = (probe.tilted(DVec3::ZERO, 0.6), probe.slid());
    let [marker, other] = [-1.0, 1.0].map(|side| {
        let end = probe.end(side);
        probe.tilted(end, 0.1)
    });
    let steps = MountSteps { pivot: &pivot, ends: Some([&marker, &other]), slide: Some(&slid), spin: None };
    assert!(probe.off_deg(&mount(&steps).unwrap()) < 1e-4);
    let refused = mount(&MountSteps { ends: Some([&other, &marker]), ..steps }).unwrap_err().to_string();
    assert!(refused.contains("axes are 180° apart") && refused.contains("were the ends exchanged"), "{refused}");
}

#[test]
fn a_turn_about_another_axis_is_refused() {
    for arc_mm in [8.0, 0.0] {
        let mut probe = Probe::new(DQuat::from_rotation_y(0.7), arc_mm, 0.0);
        let pivot = probe.tilted(DVec3::ZERO, 0.6);
        let [marker, other] = [-1.0, 1.0].map(|side| {
            let end = probe.end(side);
            probe.tilted(end, 0.1)
        });
        let mut refused = |axis: DVec3| {
            let spin = probe.poses(100, |part| Pose {
                position_mm: DIMPLE,
                orientation: DQuat::from_axis_angle(axis.normalize(), 2.0 * part),
            });
            let steps = MountSteps { pivot: &pivot, ends: Some([&marker, &other]), slide: None, spin: Some(&spin) };
            mount(&steps).unwrap_err().to_string()
        };
        // The probe lay on its narrow or its flat side, so it was turned about its lateral or elevational axis.
        for axis in [DVec3::X, DVec3::Y] {
            let said = refused(axis);
            let expected =
                if arc_mm > 0.0 { "another axis than its long one: 90° off" } else { "may point either way" };
            assert!(said.contains(expected), "{axis}: {said}");
        }
        // The probe leaned to one side.
        assert!(refused(DVec3::new(0.35, 0.0, 0.94)).contains("off a right angle"));
    }
}

#[test]
fn ends_are_checked_as_they_come() {
    let mut probe = Probe::new(DQuat::IDENTITY, 8.0, 0.0);
    let pivot = calibrate(&probe.tilted(DVec3::ZERO, 0.6)).unwrap();
    let ends = [probe.end(-1.0), probe.end(1.0), probe.end(0.2)].map(|end| probe.tilted(end, 0.1));
    let [marker, other, near] = &ends;
    assert_eq!(check_ends(&pivot, marker, None), Ok(()));
    assert_eq!(check_ends(&pivot, marker, Some(other)), Ok(()));
    let moved = check_ends(&pivot, &probe.slid(), None).unwrap_err();
    assert!(
        moved.to_string().starts_with("the end of the face at the marker: the end of the face moved by"),
        "{moved}"
    );
    assert!(matches!(check_ends(&pivot, marker, Some(near)), Err(MountError::OffCentre { .. })));
    assert!(matches!(check_ends(&pivot, marker, Some(marker)), Err(MountError::Width { .. })));
}
