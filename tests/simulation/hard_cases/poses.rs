//! Hard cases of poses and time: quaternions that are not normalised, negated or NaN; time that stops or runs backward.

use glam::{DQuat, DVec3};
use insonify::pose::{
    Estimator, Measurement, Pose, PoseError, Reading, Settings, TimedPose, TrackingState, angle_between, interpolate,
};
use insonify::render::ShaderSet;
use insonify::selftest::bench::{Bench, grainy, linear, slab, small};

use super::common::{frame, renderer, row, vector, words};
use insonify::random::SplitMix64;

#[test]
fn invalid_quaternions_are_refused_with_the_reason() {
    for (value, name) in [(f64::NAN, "qy"), (f64::INFINITY, "qy"), (f64::NEG_INFINITY, "qy")] {
        let error = Pose::from_components([0.0, 0.0, 0.0, 1.0, 0.0, value, 0.0]).unwrap_err();
        assert!(matches!(error, PoseError::NotFinite { name: n, .. } if n == name), "{error}");
    }
    for q in [[0.0; 4], [2.0, 0.0, 0.0, 0.0], [1e-200; 4], [1e200; 4], [0.99, 0.0, 0.0, 0.0]] {
        let error = Pose::from_components([0.0, 0.0, 0.0, q[0], q[1], q[2], q[3]]).unwrap_err();
        assert!(matches!(error, PoseError::NotUnit { .. }), "{q:?}: {error}");
    }
    // Within the tolerance it is normalised.
    let pose = Pose::from_components([0.0, 0.0, 0.0, 1.0005, 0.0, 0.0, 0.0]).unwrap();
    assert_eq!(pose.orientation.length(), 1.0);
}

#[test]
fn a_negated_quaternion_is_the_same_rotation() {
    let mut bench = Bench::new(grainy(0.0, 0.01));
    bench.add(0, 1, slab(glam::DVec2::ZERO, 80.0, -80.0, 80.0));
    let mut renderer =
        renderer(&bench.scene().unwrap(), &linear(33, 0.5, 256, 40.0), &small(1, 1), &ShaderSet::default());
    let orientation = DQuat::from_euler(glam::EulerRot::XYZ, 0.4, 0.7, 0.9);
    let pose = Pose { position_mm: DVec3::new(1.0, 2.0, 3.0), orientation };
    let negated = Pose { orientation: -orientation, ..pose };
    assert!(words(&frame(&mut renderer, &pose)) == words(&frame(&mut renderer, &negated)));

    // Between two poses, one of them negated: the mean of the components takes the long arc or vanishes.
    let mut random = SplitMix64::new(4);
    let (mut naive, mut kept) = (0.0_f64, 0.0_f64);
    for _ in 0..200 {
        let axis = vector(&mut random).normalize();
        let (a, b) = (DQuat::from_axis_angle(axis, 0.2), -DQuat::from_axis_angle(axis, 0.6));
        let want = DQuat::from_axis_angle(axis, 0.4);
        let mean = DQuat::from_vec4((0.5 * (glam::DVec4::from(a) + glam::DVec4::from(b))).normalize());
        naive = naive.max(angle_between(mean, want));
        let timed = |host_time_ns, orientation| TimedPose {
            host_time_ns,
            device_time_us: 0,
            pose: Pose { orientation, ..Pose::IDENTITY },
        };
        let middle = interpolate(&[timed(100, a), timed(200, b)], 150, 100).unwrap();
        kept = kept.max(angle_between(middle.orientation, want));
    }
    assert!(naive > 3.0 && kept < 1e-7, "{naive} {kept}");
    row(
        "between q and a negated neighbour",
        format!("the components' mean is turned by {:.0}°", naive.to_degrees()),
        "slerp on the shorter arc",
        format!("{:.0e}°", kept.to_degrees()),
    );
}

#[test]
fn small_rotations_are_not_lost_in_an_arc_cosine() {
    let (mut naive, mut kept, mut nan) = (0.0_f64, 0.0_f64, 0);
    let mut random = SplitMix64::new(6);
    for i in 0..1000 {
        let angle = 10f64.powf(-9.0 + 6.0 * f64::from(i) / 1000.0);
        let q = DQuat::from_axis_angle(vector(&mut random).normalize(), 1.0 + random.unit()).normalize();
        let turned = DQuat::from_axis_angle(vector(&mut random).normalize(), angle) * q;
        let arc = 2.0 * turned.dot(q).acos();
        nan += usize::from(arc.is_nan());
        if !arc.is_nan() {
            naive = naive.max((arc - angle).abs());
        }
        kept = kept.max((angle_between(turned, q) - angle).abs());
    }
    assert!(nan > 0 && naive > 1e-9 && kept < 1e-14, "{nan} {naive} {kept}");
    row(
        "angle between nearly equal orientations (f64)",
        format!("2·acos(q·p) is off by {naive:.0e} rad, and NaN {nan} times of 1000"),
        "atan2 of the rotation vector",
        format!("{kept:.0e} rad"),
    );
}

fn measured(host_time_ns: u64, x: f64) -> Measurement {
    let pose = Pose { position_mm: DVec3::new(x, 0.0, 0.0), orientation: DQuat::IDENTITY };
    Measurement { host_time_ns, device_time_us: None, sequence: None, reading: Reading::Pose(pose) }
}

#[test]
fn time_that_does_not_advance_gives_no_velocity() {
    const START: u64 = 1_700_000_000_000_000_000;
    const STEP: u64 = 16_666_667;
    // Difference quotient at a single time.
    let naive: f64 = (0.01 - 0.0) / ((START - START) as f64 * 1e-9);
    assert!(!naive.is_finite());
    let mut estimator = Estimator::new(Settings::default());
    for i in 0..30 {
        estimator.push(&measured(START + i * STEP, 0.1 * i as f64));
    }
    let sound = |estimator: &mut Estimator, now: u64, what: &str| {
        for display in [now, now.saturating_add(20_000_000), now.saturating_sub(1_000_000_000), 0, u64::MAX] {
            let estimate = estimator.sample(now, display);
            let Some(pose) = estimate.scene_from_probe else { continue };
            assert!(pose.position_mm.is_finite() && (pose.orientation.length() - 1.0).abs() < 1e-9, "{what}: {pose:?}");
            assert!(pose.position_mm.length() < 100.0, "{what}: {pose:?}");
            assert!((0.0..=30.0).contains(&estimate.predicted_ms), "{what}: {estimate:?}");
        }
    };
    let last = START + 29 * STEP;
    // At rest.
    for i in 0..10 {
        estimator.push(&measured(last, 3.0 + 0.01 * f64::from(i)));
        sound(&mut estimator, last, "still");
    }
    assert!(estimator.counters().time_not_rising + estimator.counters().duplicates >= 10, "{:?}", estimator.counters());
    // Back by a little, by a second, by years; and to the end of time.
    for time in [last - 1, last - STEP, last - 1_000_000_000, 5, 0, u64::MAX, u64::MAX - 1] {
        estimator.push(&measured(time, 3.1));
        sound(&mut estimator, last + STEP, "backward");
        sound(&mut estimator, time, "backward, seen from there");
    }
    // It continues as if nothing had happened.
    let mut state = TrackingState::Lost;
    for i in 1..200 {
        let now = last + i * STEP;
        // Readings that repeat exactly would be those of a stuck sensor.
        estimator.push(&measured(now, 3.0 + 1e-3 * (i % 2) as f64));
        sound(&mut estimator, now, "afterwards");
        state = estimator.sample(now, now).state;
    }
    assert_eq!(state, TrackingState::Good, "{:?}", estimator.counters());
    row(
        "two measurements at one time (f64)",
        format!("a velocity of {naive}"),
        "time that does not rise is dropped and counted; a jump of the clock begins anew",
        "none".to_owned(),
    );
}

#[test]
fn nan_readings_are_counted_and_change_nothing() {
    let mut estimator = Estimator::new(Settings::default());
    for i in 0..30 {
        estimator.push(&measured(1_000_000_000 + i * 16_666_667, 1.0));
    }
    let now = 1_000_000_000 + 29 * 16_666_667;
    let before = estimator.sample(now, now);
    for bad in [f64::NAN, f64::INFINITY, 1e300] {
        let pose = Pose { position_mm: DVec3::splat(bad), orientation: DQuat::IDENTITY };
        let turned = Pose { position_mm: DVec3::ZERO, orientation: DQuat::from_xyzw(bad, 0.0, 0.0, 1.0) };
        for reading in [Reading::Pose(pose), Reading::Pose(turned), Reading::Orientation(turned.orientation)] {
            estimator.push(&Measurement { reading, ..measured(now + 1, 0.0) });
        }
    }
    assert_eq!(estimator.counters().invalid, 9);
    assert_eq!(estimator.sample(now, now), before);
}
