//! Tests of the estimator's accuracy and robustness on simulated streams with a known true pose.

use glam::{DQuat, DVec3};
use insonify::pose::freehand::{Tremor, Waypoint, view_at};
use insonify::pose::{
    Calibration, Counters, Estimate, Estimator, FilterSettings, Fitted, Measurement, Pose, Reading, Settings,
    TrackingState, angle_between,
};
use proptest::prelude::*;

const START_NS: u64 = 1_790_000_000_000_000_000;
const PERIOD_NS: u64 = 16_666_667;
const MS: u64 = 1_000_000;

fn estimator() -> Estimator {
    Estimator::new(Settings::default())
}

fn measurement(i: u64, reading: Reading) -> Measurement {
    let host_time_ns = START_NS + i * PERIOD_NS;
    Measurement { host_time_ns, device_time_us: Some(i * PERIOD_NS / 1000), sequence: Some(i as u32), reading }
}

fn at(x: f64) -> Reading {
    Reading::Pose(Pose { position_mm: DVec3::X * x, ..Pose::IDENTITY })
}

fn time(i: u64) -> u64 {
    START_NS + i * PERIOD_NS
}

/// Reproducible numbers of a standard normal distribution (Box & Muller).
struct Normal(u64);

impl Normal {
    fn unit(&mut self) -> f64 {
        self.0 = self.0.wrapping_mul(6_364_136_223_846_793_005).wrapping_add(1_442_695_040_888_963_407);
        ((self.0 >> 11) as f64 + 0.5) / (1_u64 << 53) as f64
    }

    fn next(&mut self) -> f64 {
        (-2.0 * self.unit().ln()).sqrt() * (std::f64::consts::TAU * self.unit()).cos()
    }

    fn vector(&mut self) -> DVec3 {
        DVec3::new(self.next(), self.next(), self.next())
    }
}

/// Pose of a hand with tremor that moves 80 mm and 50° within 2 s, rests for 2 s, and comes back. Its peak speed is 75
/// mm/s.
fn hand(tremor: &Tremor, time_s: f64) -> Pose {
    let there = (DVec3::new(80.0, 0.0, 0.0), DQuat::from_rotation_y(50_f64.to_radians()));
    let waypoints: Vec<Waypoint> = (0..6)
        .map(|i| {
            let (target_mm, orientation) = if i % 2 == 0 { (DVec3::ZERO, DQuat::IDENTITY) } else { there };
            let arrive_s = f64::from(i) * 4.0;
            Waypoint { arrive_s, leave_s: arrive_s + 2.0, target_mm, orientation }
        })
        .collect();
    let (position, orientation) = view_at(&waypoints, time_s).unwrap();
    let (shift, turn) = tremor.at(time_s);
    Pose { position_mm: position + orientation * shift, orientation: orientation * turn }
}

/// Sums for the RMS errors of position (mm) and rotation (degrees).
#[derive(Default, Clone, Copy, Debug)]
struct Error {
    squares: (f64, f64),
    count: f64,
}

impl Error {
    fn add(&mut self, a: &Pose, b: &Pose) {
        self.squares.0 += a.position_mm.distance_squared(b.position_mm);
        self.squares.1 += angle_between(a.orientation, b.orientation).to_degrees().powi(2);
        self.count += 1.0;
    }

    fn rms(&self) -> (f64, f64) {
        ((self.squares.0 / self.count).sqrt(), (self.squares.1 / self.count).sqrt())
    }
}

/// Errors relative to the hand's pose at display time: of the estimator's pose, and of the last measured pose.
///
/// The tracker makes 60 measurements a second with noise of 0.15 mm and 0.1° on each axis; its transport takes 4 to 10
/// ms. Frames are sampled 30 times a second and shown 25 ms later.
fn track(filter: FilterSettings, seconds: u64) -> (Error, Error) {
    let mut estimator = Estimator::new(Settings { filter, ..Settings::default() });
    let (tremor, mut noise) = (Tremor::new(3), Normal(5));
    let (mut estimated, mut raw) = (Error::default(), Error::default());
    let mut next = 0;
    let mut last = None;
    for frame in 0..30 * seconds {
        let now_ms = 33.333 * frame as f64 + 7.0;
        loop {
            let made_s = next as f64 / 60.0;
            let arrives_ms = made_s * 1e3 + 4.0 + 6.0 * noise.unit();
            if arrives_ms > now_ms {
                break;
            }
            let truth = hand(&tremor, made_s);
            let pose = Pose {
                position_mm: truth.position_mm + 0.15 * noise.vector(),
                orientation: truth.orientation * DQuat::from_scaled_axis(noise.vector() * 0.1_f64.to_radians()),
            };
            let host_time_ns = START_NS + (arrives_ms * 1e6) as u64;
            estimator.push(&Measurement { host_time_ns, ..measurement(next, Reading::Pose(pose)) });
            last = Some(pose);
            next += 1;
        }
        let display_ms = now_ms + 25.0;
        let ns = |ms: f64| START_NS + (ms * 1e6) as u64;
        let estimate = estimator.sample(ns(now_ms), ns(display_ms));
        if frame > 30 {
            let truth = hand(&tremor, display_ms * 1e-3);
            estimated.add(&estimate.scene_from_probe.unwrap(), &truth);
            raw.add(&last.unwrap(), &truth);
        }
    }
    assert_eq!(estimator.counters().used, next, "{:?}", estimator.counters());
    (estimated, raw)
}

#[test]
fn the_shown_pose_is_nearer_to_the_hand_than_the_last_raw_one() {
    let (estimated, raw) = track(FilterSettings::default(), 18);
    let (plain, _) = track(FilterSettings { prediction_ms: 0.0, ..FilterSettings::default() }, 18);
    let [estimated, plain, raw] = [estimated, plain, raw].map(|e| e.rms());
    println!("RMS error at display: estimated {estimated:.3?}, without prediction {plain:.3?}, raw {raw:.3?} (mm, °)");
    assert!(estimated.0 < 0.8 * raw.0 && estimated.1 < 0.8 * raw.1, "{estimated:?} {raw:?}");
    assert!(estimated.0 < plain.0 && estimated.1 < plain.1, "{estimated:?} {plain:?}");
    assert!(estimated.0 < 0.9 && estimated.1 < 0.7, "{estimated:?}");
}

#[test]
fn noise_of_a_resting_sensor_is_reduced() {
    let (mut estimator, mut noise) = (estimator(), Normal(9));
    let (mut filtered, mut raw) = (Error::default(), Error::default());
    for i in 0..1200 {
        let pose = Pose {
            position_mm: 0.2 * noise.vector(),
            orientation: DQuat::from_scaled_axis(noise.vector() * 0.2_f64.to_radians()),
        };
        estimator.push(&measurement(i, Reading::Pose(pose)));
        if i > 60 {
            filtered.add(&estimator.sample(time(i), time(i)).scene_from_probe.unwrap(), &Pose::IDENTITY);
            raw.add(&pose, &Pose::IDENTITY);
        }
    }
    let (filtered, raw) = (filtered.rms(), raw.rms());
    println!("noise at rest: filtered {filtered:.3?}, raw {raw:.3?} (mm, °)");
    // α = 0.095 at 1 Hz leaves √(α/(2 − α)) = 0.22 of the noise; the speed of the noise itself raises the cutoff.
    assert!(filtered.0 < 0.4 * raw.0 && filtered.1 < 0.4 * raw.1, "{filtered:?} {raw:?}");
}

#[test]
fn steady_motion_is_delayed_only_by_the_filters_lag() {
    for speed in [10.0, 50.0, 200.0] {
        let mut estimator = estimator();
        (0..240).for_each(|i| estimator.push(&measurement(i, at(speed * i as f64 / 60.0))));
        let shown = estimator.sample(time(239), time(239) + 20 * MS);
        let truth = speed * (239.0 / 60.0 + 0.02);
        let late_ms = 1e3 * (truth - shown.scene_from_probe.unwrap().position_mm.x) / speed;
        println!("{speed} mm/s: {late_ms:.1} ms late");
        let FilterSettings { min_cutoff_hz, beta, .. } = FilterSettings::default();
        let lag_ms = 1e3 / (std::f64::consts::TAU * (min_cutoff_hz + beta * speed));
        assert!((late_ms - lag_ms).abs() < 0.1, "{speed} mm/s: {late_ms} ms");
        assert!((shown.predicted_ms - 20.0).abs() < 0.1);
    }
}

#[test]
fn prediction_ends_at_its_cap_and_the_past_is_interpolated() {
    let mut estimator = estimator();
    (0..120).for_each(|i| estimator.push(&measurement(i, at(i as f64))));
    let x = |e: &Estimate| e.scene_from_probe.unwrap().position_mm.x;
    let far = estimator.sample(time(119), time(119) + 900 * MS);
    assert!((far.predicted_ms - 30.0).abs() < 1e-9);
    let newest = estimator.sample(time(119), time(119));
    assert!((x(&far) - x(&newest) - 60.0 * 0.03).abs() < 0.05);
    let past = estimator.sample(time(119), time(115) + PERIOD_NS / 2);
    assert!((x(&newest) - x(&past) - 3.5).abs() < 0.05 && past.predicted_ms == 0.0);
    assert_eq!(newest.first_byte_ns, Some(time(119)));
}

#[test]
fn states_follow_the_age_and_a_lost_pose_is_none() {
    let mut estimator = estimator();
    assert_eq!(estimator.sample(time(0), time(0)).state, TrackingState::Lost);
    let mut states = Vec::new();
    for i in 0..5 {
        estimator.push(&measurement(i, at(0.0)));
        states.push(estimator.sample(time(i), time(i)).state);
    }
    use TrackingState::{Good, Held, Lost, Stale};
    assert_eq!(states, [Held, Held, Good, Good, Good]);
    let last = time(4);
    for (age_ms, state) in [(90, Good), (110, Held), (600, Stale), (2100, Lost)] {
        let estimate = estimator.sample(last + age_ms * MS, last + age_ms * MS);
        assert_eq!((estimate.state, estimate.scene_from_probe.is_some()), (state, state != Lost));
    }
    // Out of view: present, but not good.
    (140..145).for_each(|i| estimator.push(&measurement(i, at(0.0))));
    assert_eq!(estimator.sample(time(144), time(144)).state, Good);
    estimator.push(&measurement(145, Reading::OutOfView));
    assert_eq!(estimator.sample(time(145), time(145)).state, Held);
    let counters = *estimator.counters();
    assert_eq!((counters.out_of_view, counters.missing, counters.used), (1, 135, 10));
}

#[test]
fn non_finite_measurements_are_not_used() {
    let mut estimator = estimator();
    let nan = f64::NAN;
    let wrong = [
        at(nan),
        at(f64::INFINITY),
        at(1e6),
        Reading::Pose(Pose { orientation: DQuat::from_xyzw(0.0, 0.0, 0.0, 0.0), ..Pose::IDENTITY }),
        Reading::Orientation(DQuat::from_xyzw(nan, 0.0, 0.0, 1.0)),
        Reading::Orientation(DQuat::from_xyzw(0.0, 0.0, 0.0, 1.1)),
        Reading::Rates { translation: DVec3::new(0.0, nan, 0.0), rotation: DVec3::ZERO },
        Reading::Rates { translation: DVec3::ZERO, rotation: DVec3::NEG_INFINITY },
    ];
    wrong.iter().enumerate().for_each(|(i, reading)| estimator.push(&measurement(i as u64, *reading)));
    assert_eq!((estimator.counters().invalid, estimator.counters().used), (8, 0));
    assert_eq!(estimator.sample(time(9), time(9)).scene_from_probe, None);
}

#[test]
fn repeated_and_late_measurements_are_counted_and_not_used() {
    let mut estimator = estimator();
    for i in [0, 1, 2, 2, 4, 3, 5, 6] {
        estimator.push(&Measurement { host_time_ns: time(8), ..measurement(i, at(i as f64)) });
    }
    let Counters { duplicates, out_of_order, missing, used, .. } = *estimator.counters();
    assert_eq!((duplicates, out_of_order, missing, used), (1, 1, 1, 6));
    // Without a counter and a clock, host times that repeat or fall are not used.
    let mut estimator = self::estimator();
    for i in [5, 6, 6, 3, 7] {
        estimator.push(&Measurement { sequence: None, device_time_us: None, ..measurement(i, at(i as f64)) });
    }
    assert_eq!((estimator.counters().time_not_rising, estimator.counters().used), (2, 3));
}

#[test]
fn a_restarted_device_is_followed_at_once() {
    let mut estimator = estimator();
    (0..200).for_each(|i| estimator.push(&measurement(i, at(i as f64 * 0.1))));
    for i in 0..10 {
        estimator.push(&Measurement { host_time_ns: time(201 + i), ..measurement(i, at(20.0)) });
    }
    assert_eq!((estimator.counters().device_restarts, estimator.counters().used), (1, 210));
    let estimate = estimator.sample(time(210), time(210));
    assert_eq!((estimate.state, estimate.first_byte_ns), (TrackingState::Good, Some(time(210))));
}

#[test]
fn a_host_clock_jump_is_survived_whichever_call_sees_it_first() {
    const HOUR: i64 = 3_600_000_000_000;
    for (jump, sample_first) in [(HOUR, true), (HOUR, false), (-HOUR, true), (-HOUR, false)] {
        let mut estimator = estimator();
        let shifted = |i: u64| time(i).saturating_add_signed(if i >= 100 { jump } else { 0 });
        let mut worst = TrackingState::Good;
        for i in 0..200 {
            let push = |e: &mut Estimator| {
                e.push(&Measurement { host_time_ns: shifted(i), ..measurement(i, at(0.1 * i as f64)) });
            };
            let sample = |e: &mut Estimator| e.sample(shifted(i), shifted(i) + 20 * MS);
            let estimate = if sample_first {
                let estimate = sample(&mut estimator);
                push(&mut estimator);
                estimate
            } else {
                push(&mut estimator);
                sample(&mut estimator)
            };
            if i > 110 {
                worst = worst.max(estimate.state);
                assert!((estimate.scene_from_probe.unwrap().position_mm.x - 0.1 * i as f64).abs() < 2.0);
            }
        }
        assert_eq!(worst, TrackingState::Good, "{jump} {sample_first}");
        let counters = estimator.counters();
        assert_eq!(counters.clock_jumps, 1, "{jump} {sample_first}: {counters:?}");
        assert!(counters.used >= 197, "{counters:?}");
    }
}

#[test]
fn a_tracker_that_dies_as_the_clock_is_set_back_is_still_lost() {
    let mut estimator = estimator();
    (0..100).for_each(|i| estimator.push(&measurement(i, at(0.0))));
    assert_eq!(estimator.sample(time(99), time(99)).state, TrackingState::Good);
    let set_back = time(99) - 3_600_000 * MS;
    let states = [0, 200, 1000, 3000].map(|ms| estimator.sample(set_back + ms * MS, set_back).state);
    use TrackingState::{Good, Held, Lost, Stale};
    assert_eq!(states, [Good, Held, Stale, Lost]);
}

#[test]
fn a_sensor_out_of_view_as_the_clock_jumps_is_lost() {
    let mut estimator = estimator();
    (0..100).for_each(|i| estimator.push(&measurement(i, at(0.0))));
    for i in 100..110 {
        let host_time_ns = time(i) - 3_600_000 * MS;
        estimator.push(&Measurement { host_time_ns, ..measurement(i, Reading::OutOfView) });
    }
    let now_ns = time(110) - 3_600_000 * MS;
    let estimate = estimator.sample(now_ns, now_ns);
    assert_eq!((estimate.state, estimate.scene_from_probe), (TrackingState::Lost, None));
    assert_eq!((estimator.counters().clock_jumps, estimator.counters().out_of_view), (1, 8));
}

#[test]
fn spikes_are_not_shown_and_jumps_are() {
    let mut estimator = estimator();
    let x = |i: u64| match i {
        50 => 400.0,
        i if i >= 70 => -300.0,
        _ => 0.0,
    };
    for i in 0..100 {
        estimator.push(&measurement(i, at(x(i))));
        let shown = estimator.sample(time(i), time(i) + 30 * MS).scene_from_probe.unwrap().position_mm.x;
        let expected = if i > 70 { -300.0 } else { 0.0 };
        assert!((shown - expected).abs() < 1e-6, "{i}: {shown}");
    }
    assert_eq!((estimator.counters().spikes, estimator.counters().jumps), (2, 1));
}

#[test]
fn a_stuck_sensor_is_noted_while_its_clock_runs() {
    let mut estimator = estimator();
    (0..240).for_each(|i| estimator.push(&measurement(i, at(1.0))));
    let estimate = estimator.sample(time(239), time(239));
    assert_eq!((estimate.state, estimator.counters().stuck), (TrackingState::Stuck, 1));
    assert!(estimate.scene_from_probe.is_some());
    estimator.push(&measurement(240, at(1.001)));
    assert_eq!(estimator.sample(time(240), time(240)).state, TrackingState::Good);
    (241..481).for_each(|i| estimator.push(&measurement(i, at(1.0))));
    let silent = estimator.sample(time(480) + 600 * MS, time(480) + 600 * MS);
    assert_eq!(silent.state, TrackingState::Stale, "a stuck sensor that falls silent is stale");
}

#[test]
fn a_puck_moves_the_probe_and_is_tracked_at_rest() {
    let initial_pose = Pose { position_mm: DVec3::new(0.0, 0.0, 80.0), orientation: DQuat::from_rotation_x(0.4) };
    let mut estimator = Estimator::new(Settings { initial_pose, ..Settings::default() });
    let report = |ms: u64, x: f64| Measurement {
        host_time_ns: START_NS + ms * MS,
        device_time_us: None,
        sequence: None,
        reading: Reading::Rates { translation: DVec3::X * x, rotation: DVec3::ZERO },
    };
    let sample = |e: &mut Estimator, ms: u64| e.sample(START_NS + ms * MS, START_NS + ms * MS);
    estimator.push(&report(0, 0.0));
    assert_eq!(sample(&mut estimator, 60_000).state, TrackingState::Good);
    assert_eq!(sample(&mut estimator, 60_000).scene_from_probe.unwrap().position_mm, initial_pose.position_mm);
    for ms in (60_000..=60_500).step_by(10) {
        estimator.push(&report(ms, if ms == 60_500 { 0.0 } else { 1.0 }));
    }
    let moved = sample(&mut estimator, 90_000);
    assert!(moved.scene_from_probe.unwrap().position_mm.distance(DVec3::new(40.0, 0.0, 80.0)) < 1e-9);
    assert_eq!(moved.state, TrackingState::Good);
    estimator.disconnected();
    assert_eq!(sample(&mut estimator, 90_001).state, TrackingState::Lost);
}

#[test]
fn a_device_without_position_turns_about_a_fixed_one() {
    let initial_pose = Pose { position_mm: DVec3::new(5.0, 0.0, 80.0), ..Pose::IDENTITY };
    let quarter = |q: fn(f64) -> DQuat| Fitted::known(Pose { position_mm: DVec3::ONE, orientation: q(1.0) });
    let calibration = Calibration {
        scene_from_tracker: Some(quarter(DQuat::from_rotation_x)),
        sensor_from_probe: Some(quarter(DQuat::from_rotation_z)),
        ..Calibration::default()
    };
    let mut estimator = Estimator::new(Settings { calibration, initial_pose, ..Settings::default() });
    let sensor = DQuat::from_rotation_y(0.7);
    (0..10).for_each(|i| estimator.push(&measurement(i, Reading::Orientation(sensor))));
    let pose = estimator.sample(time(9), time(9)).scene_from_probe.unwrap();
    let expected = DQuat::from_rotation_x(1.0) * sensor * DQuat::from_rotation_z(1.0);
    assert!(
        pose.position_mm.distance(initial_pose.position_mm) < 1e-9 && angle_between(pose.orientation, expected) < 1e-9
    );
}

fn any_reading() -> impl Strategy<Value = Reading> {
    let number = || prop_oneof![4 => -200.0..200.0_f64, 1 => any::<f64>()];
    let vector = move || (number(), number(), number()).prop_map(|(x, y, z)| DVec3::new(x, y, z));
    let turn = || {
        (prop::array::uniform3(-1.0..1.0_f64), -7.0..7.0_f64, any::<bool>()).prop_map(|(axis, angle, negate)| {
            let q = DQuat::from_axis_angle(DVec3::from_array(axis).normalize_or(DVec3::X), angle);
            if negate { -q } else { q }
        })
    };
    prop_oneof![
        6 => (vector(), turn()).prop_map(|(position_mm, orientation)| Reading::Pose(Pose { position_mm, orientation })),
        2 => turn().prop_map(Reading::Orientation),
        1 => prop::array::uniform4(any::<f64>()).prop_map(|q| Reading::Orientation(DQuat::from_array(q))),
        2 => (vector(), vector()).prop_map(|(translation, rotation)| Reading::Rates { translation, rotation }),
        1 => Just(Reading::OutOfView),
    ]
}

proptest! {
    #![proptest_config(ProptestConfig { failure_persistence: None, ..ProptestConfig::default() })]

    #[test]
    fn every_shown_pose_is_valid(
        stream in prop::collection::vec(
            (any_reading(), -30_000_000_i64..200_000_000, prop::option::of(any::<u32>()), prop::option::of(0_u64..200_000), any::<i32>()),
            1..120,
        ),
        start in prop_oneof![Just(START_NS), any::<u64>()],
    ) {
        let mut estimator = estimator();
        let (mut host_time_ns, mut device_us) = (start, 0);
        for (reading, step, sequence, device_step, ahead) in stream {
            host_time_ns = host_time_ns.saturating_add_signed(step);
            device_us += device_step.unwrap_or(0);
            let device_time_us = device_step.map(|_| device_us);
            estimator.push(&Measurement { host_time_ns, device_time_us, sequence, reading });
            let estimate = estimator.sample(host_time_ns, host_time_ns.saturating_add_signed(i64::from(ahead)));
            prop_assert!((0.0..=30.0).contains(&estimate.predicted_ms));
            prop_assert!(estimate.state == TrackingState::Lost || estimate.scene_from_probe.is_some());
            if let Some(pose) = estimate.scene_from_probe {
                prop_assert!(pose.position_mm.is_finite() && pose.orientation.is_normalized(), "{:?}", pose);
            }
        }
        let c = estimator.counters();
        let dropped = c.invalid + c.duplicates + c.out_of_order + c.time_not_rising + c.time_outliers + c.out_of_view + c.spikes;
        prop_assert_eq!(c.used + dropped, c.measurements);
    }

    #[test]
    fn quaternion_signs_do_not_change_the_shown_pose(turns in prop::collection::vec((-0.4..0.4_f64, any::<bool>()), 10..80)) {
        let (mut plain, mut mixed) = (estimator(), estimator());
        let mut angle = 0.0;
        for (i, (turn, negate)) in turns.into_iter().enumerate() {
            angle += turn;
            let q = DQuat::from_rotation_z(angle);
            plain.push(&measurement(i as u64, Reading::Orientation(q)));
            mixed.push(&measurement(i as u64, Reading::Orientation(if negate { -q } else { q })));
            let shown = |e: &mut Estimator| e.sample(time(i as u64), time(i as u64) + 10 * MS).scene_from_probe.unwrap();
            prop_assert!(angle_between(shown(&mut plain).orientation, shown(&mut mixed).orientation) < 1e-6);
        }
    }
}

#[test]
fn the_speed_of_the_probe_is_reported_while_it_is_tracked() {
    let mut estimator = estimator();
    assert_eq!(estimator.sample(time(0), time(0)).speed, None);
    // 60 measurements a second: a second at rest, a second at 30 mm/s.
    let speeds = (0..120).map(|i: u64| {
        let x = 0.5 * i.saturating_sub(60) as f64;
        estimator.push(&measurement(i, at(x)));
        estimator.sample(time(i), time(i)).speed.unwrap()
    });
    let speeds: Vec<_> = speeds.collect();
    assert!(speeds[50].mm_s < 0.01 && speeds[119].deg_s < 0.01, "{:?}", speeds[50]);
    let expected = 0.5 * 1e9 / PERIOD_NS as f64;
    assert!((speeds[119].mm_s / expected - 1.0).abs() < 0.05, "{:?}", speeds[119]);
    assert_eq!(estimator.sample(time(119) + 900 * MS, time(119)).speed, None, "what was before the silence is not now");
}
