//! Cost of measurements, sampled frames and calibrations.
//!
//! `cargo bench --bench pose`

use std::hint::black_box;

use criterion::Criterion;
use glam::{DQuat, DVec3};
use insonify::pose::pivot::calibrate;
use insonify::pose::registration::{PointPair, register};
use insonify::pose::{Estimator, Measurement, Pose, Reading, Settings};

const START_NS: u64 = 1_790_000_000_000_000_000;

/// Interval of 240 measurements a second, ns.
const PERIOD_NS: u64 = 4_166_667;

fn pose_at(time_s: f64) -> Pose {
    let orientation = DQuat::from_rotation_y(time_s.sin()) * DQuat::from_rotation_x((1.3 * time_s).cos());
    Pose { position_mm: DVec3::new(40.0 * time_s.sin(), 20.0 * time_s.cos(), 80.0), orientation }
}

fn measurement(i: u32) -> Measurement {
    Measurement {
        host_time_ns: START_NS + u64::from(i) * PERIOD_NS,
        device_time_us: Some(u64::from(i) * PERIOD_NS / 1000),
        sequence: Some(i),
        reading: Reading::Pose(pose_at(f64::from(i) / 240.0)),
    }
}

fn main() {
    let mut criterion = Criterion::default().configure_from_args();
    let mut group = criterion.benchmark_group("pose");
    let mut estimator = Estimator::new(Settings::default());
    let mut i = 0_u32;
    group.bench_function("push a measurement", |bencher| {
        bencher.iter(|| {
            estimator.push(black_box(&measurement(i)));
            i += 1;
        });
    });
    let now_ns = START_NS + u64::from(i) * PERIOD_NS;
    group.bench_function("sample, predicted", |bencher| {
        bencher.iter(|| black_box(estimator.sample(now_ns, now_ns + 20_000_000)));
    });
    group.bench_function("sample, interpolated", |bencher| {
        bencher.iter(|| black_box(estimator.sample(now_ns, now_ns - 100_000_000)));
    });
    let pairs: Vec<_> = (0..8)
        .map(|i| {
            let scene_mm = pose_at(f64::from(i)).orientation * (100.0 * DVec3::Z);
            PointPair { scene_mm, tracker_mm: pose_at(0.4).transform_point(scene_mm) }
        })
        .collect();
    group.bench_function("register 8 landmarks", |bencher| bencher.iter(|| register(black_box(&pairs))));
    let pivoting: Vec<_> = (0..600)
        .map(|i| {
            let orientation = pose_at(f64::from(i) / 60.0).orientation;
            Pose { position_mm: orientation * DVec3::new(0.0, 0.0, -140.0), orientation }
        })
        .collect();
    group.bench_function("pivot of 600 poses", |bencher| bencher.iter(|| calibrate(black_box(&pivoting))));
    group.finish();
    criterion.final_summary();
}
