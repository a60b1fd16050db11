//! Times that no command measures: preparation of a scene, changes of a renderer's settings, poses and calibrations.
//!
//! `cargo bench --bench parts` measures all; `cargo bench --bench parts -- scene pose` only some. Commands measure the
//! rest: frames and passes `insonify bench`, effects `insonify plan`, generators `insonify generator`. The scenes are
//! the phantom with a quarter of its triangles, and that of `configs/obstetric.toml`.

// A benchmark that cannot be set up has nothing to measure.
#![allow(clippy::expect_used)]

use std::convert::Infallible;
use std::hint::black_box;
use std::path::Path;
use std::sync::Arc;
use std::time::Instant;

use glam::{DQuat, DVec3};
use insonify::anatomy::export::write_glb;
use insonify::anatomy::{Bvh, TissueTable, import};
use insonify::measuring::timed;
use insonify::phantom::{PhantomOptions, build};
use insonify::pose::pivot::calibrate;
use insonify::pose::registration::{PointPair, register};
use insonify::pose::{Estimator, Measurement, Pose, Reading, Settings};
use insonify::render::{Backend, BackendChoice, Quality, RenderSettings, Renderer};
use insonify::station::Station;
use insonify::statistics::median;
use insonify::transducer::Probe;

/// Fraction of the full phantom's triangles that the scaled phantom has.
const SCALE: f64 = 0.25;
/// Timed repetitions, after an uncounted one.
const REPEATS: usize = 10;
/// Calls in a repetition if a call takes only microseconds.
const CALLS: u32 = 20_000;
/// Interval of 240 measurements per second, ns, and time of the first one.
const PERIOD_NS: u64 = 4_166_667;
const START_NS: u64 = 1_790_000_000_000_000_000;

fn main() {
    let wanted: Vec<String> = std::env::args().skip(1).filter(|a| !a.starts_with('-')).collect();
    let parts: [(&str, fn()); 3] = [("scene", scene), ("reconfigure", reconfigurations), ("pose", poses)];
    for (name, measure) in parts {
        if wanted.is_empty() || wanted.iter().any(|w| w == name) {
            println!("{name}");
            measure();
        }
    }
}

/// Prints the median over repetitions of the mean time of `calls` calls of `work`.
fn print<T>(name: &str, calls: u32, mut work: impl FnMut() -> T) {
    let times = timed(1, REPEATS, || {
        let started = Instant::now();
        (0..calls).for_each(|_| {
            black_box(work());
        });
        Ok::<_, Infallible>(started.elapsed().as_secs_f64() * 1e3 / f64::from(calls))
    });
    let Ok(times) = times;
    println!("  {name:<32} {:>14.6} ms", median(&times).expect("a repetition"));
}

/// Times the building of the phantom, the import of its file, and the building of its BVH.
fn scene() {
    let options = PhantomOptions { scale: SCALE, ..PhantomOptions::default() };
    print("phantom at scale 0.25", 1, || build(&options, &|_| {}).expect("the phantom"));
    let surfaces = build(&options, &|_| {}).expect("the phantom");
    let directory = tempfile::tempdir().expect("a directory");
    let path = directory.path().join("phantom.glb");
    write_glb(&surfaces, &path).expect("the phantom's file");
    let tissues = TissueTable::builtin().expect("the tissues");
    print("glTF import", 1, || import::load(black_box(&path), &tissues, 0).expect("the scene"));
    let scene = import::load(&path, &tissues, 0).expect("the scene");
    print("BVH build", 1, || Bvh::build(black_box(&scene)).expect("a tree"));
}

/// Times each kind of change of a renderer, applied and undone, and the creation of a renderer.
fn reconfigurations() {
    type Change = fn(&mut Probe, &mut RenderSettings);
    let changes: [(&str, Change); 6] = [
        ("gain, there and back", |_, s| s.image.gain_db += 6.0),
        ("focus", |p, _| p.focus_mm *= 0.5),
        ("depth", |p, _| p.depth_mm *= 0.7),
        ("frequency", |p, _| p.frequency_mhz *= 0.5),
        ("4 x 2", |_, s| s.quality = Quality { rays: 4, layers: 2, ..s.quality }),
        ("image size", |_, s| (s.image.width, s.image.height) = (1024, 768)),
    ];
    let root = Path::new(env!("CARGO_MANIFEST_DIR"));
    let station = Station::load(&root.join("configs/obstetric.toml")).expect("the obstetric station");
    let scene = station.load_scene(&|_| ()).expect("the scene");
    let choice = BackendChoice::from_environment().expect("a backend").unwrap_or_default();
    let backend = Backend::open(choice).expect("a backend");
    let bvh = Arc::new(Bvh::build(&scene).expect("a scene that can be traced"));
    let built =
        || Renderer::with_bvh(&backend, &scene, bvh.clone(), &station.probe, &station.settings).expect("a renderer");
    let mut renderer = built();
    for (name, change) in changes {
        let (mut probe, mut settings) = (station.probe, station.settings);
        change(&mut probe, &mut settings);
        print(name, 1, || {
            renderer.reconfigure(&probe, &settings).expect("a change");
            renderer.reconfigure(&station.probe, &station.settings).expect("a change back");
        });
    }
    print("a renderer built", 1, built);
}

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

/// Times measurements, sampled poses and calibrations.
fn poses() {
    let mut estimator = Estimator::new(Settings::default());
    let mut i = 0_u32;
    print("push a measurement", CALLS, || {
        estimator.push(black_box(&measurement(i)));
        i += 1;
    });
    let now_ns = START_NS + u64::from(i) * PERIOD_NS;
    print("sample, predicted", CALLS, || estimator.sample(now_ns, now_ns + 20_000_000));
    print("sample, interpolated", CALLS, || estimator.sample(now_ns, now_ns - 100_000_000));
    let pairs: Vec<_> = (0..8)
        .map(|i| {
            let scene_mm = pose_at(f64::from(i)).orientation * (100.0 * DVec3::Z);
            PointPair { scene_mm, tracker_mm: pose_at(0.4).transform_point(scene_mm) }
        })
        .collect();
    print("register 8 landmarks", CALLS / 100, || register(black_box(&pairs)));
    let pivoting: Vec<_> = (0..600)
        .map(|i| {
            let orientation = pose_at(f64::from(i) / 60.0).orientation;
            Pose { position_mm: orientation * DVec3::new(0.0, 0.0, -140.0), orientation }
        })
        .collect();
    print("pivot of 600 poses", 1, || calibrate(black_box(&pivoting)));
}
