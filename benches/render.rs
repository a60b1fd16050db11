//! Complete frames with the paper's parameters over the obstetric phantom, at low and high quality, and the time of
//! each pass.
//!
//! `cargo bench --bench render`. The poses are those of the recorded exam, so that no single view dominates. After each
//! benchmark the passes' times are printed.

// A benchmark that cannot be set up has nothing to measure.
#![allow(clippy::expect_used)]

mod support;

use std::path::Path;
use std::sync::Arc;

use criterion::Criterion;
use insonify::anatomy::{Bvh, Scene};
use insonify::pose::Pose;
use insonify::recording;
use insonify::render::{Backend, BackendChoice, Frame, Quality, RenderSettings, Renderer};
use insonify::report::TimeTable;
use insonify::report::time_table::SideBySide;
use insonify::station::Station;
use insonify::transducer::Probe;

/// Number of poses, spread over the exam.
const POSES: usize = 12;

fn main() {
    let mut criterion = Criterion::default().configure_from_args();
    let root = Path::new(env!("CARGO_MANIFEST_DIR"));
    let station = Station::load(&root.join("configs/obstetric.toml")).expect("the obstetric station");
    let scene = support::scene(&station);
    let (recorded, _) = recording::poses(&root.join("assets/exams/obstetric_sweep.mcap")).expect("the recorded exam");
    let poses: Vec<Pose> = (0..POSES).map(|i| recorded[(2 * i + 1) * recorded.len() / (2 * POSES)].pose).collect();
    let backend =
        Backend::open(BackendChoice::from_environment().expect("a backend").unwrap_or_default()).expect("a backend");
    println!("{backend}, {} triangles", scene.triangle_count());

    for (name, quality, maps) in
        [("LQ", Quality::LQ, true), ("LQ without maps", Quality::LQ, false), ("HQ", Quality::HQ, true)]
    {
        let settings = RenderSettings { quality, maps, ..station.settings };
        let mut renderer = Renderer::new(&backend, &scene, &station.probe, &settings).expect("a renderer");
        whole_frames(&mut criterion, name, &mut renderer, &poses);
    }
    reconfigurations(&mut criterion, &backend, &scene, &station);
    criterion.final_summary();
}

/// Measures the duration of each kind of change, there and back, of an existing renderer.
fn reconfigurations(criterion: &mut Criterion, backend: &Backend, scene: &Scene, station: &Station) {
    type Change = fn(&mut Probe, &mut RenderSettings);
    let changes: [(&str, Change); 6] = [
        ("gain", |_, s| s.image.gain_db += 6.0),
        ("focus", |p, _| p.focus_mm *= 0.5),
        ("depth", |p, _| p.depth_mm *= 0.7),
        ("frequency", |p, _| p.frequency_mhz *= 0.5),
        ("4 x 2", |_, s| s.quality = Quality { rays: 4, layers: 2, ..s.quality }),
        ("image size", |_, s| (s.image.width, s.image.height) = (1024, 768)),
    ];
    let bvh = Arc::new(Bvh::build(scene).expect("a scene that can be traced"));
    let built =
        || Renderer::with_bvh(backend, scene, bvh.clone(), &station.probe, &station.settings).expect("a renderer");
    let mut group = criterion.benchmark_group("reconfigure, there and back");
    group.sample_size(10);
    for (name, change) in changes {
        let mut renderer = built();
        let (mut probe, mut settings) = (station.probe, station.settings);
        change(&mut probe, &mut settings);
        // Compiles what only the change needs.
        renderer.reconfigure(&probe, &settings).expect("a change");
        group.bench_function(name, |bencher| {
            bencher.iter(|| {
                renderer.reconfigure(&probe, &settings).expect("a change");
                renderer.reconfigure(&station.probe, &station.settings).expect("a change back");
            });
        });
    }
    group.bench_function("a renderer built", |bencher| bencher.iter(&built));
    group.finish();
}

/// Measures frames from the call until all maps are in memory.
fn whole_frames(criterion: &mut Criterion, name: &str, renderer: &mut Renderer, poses: &[Pose]) {
    let mut frame = Frame::default();
    let mut times = TimeTable::default();
    let mut next = poses.iter().cycle();
    let mut group = criterion.benchmark_group("frame");
    group.sample_size(20);
    group.bench_function(name, |bencher| {
        bencher.iter(|| {
            let pose = next.next().expect("poses in a cycle");
            renderer.render(pose, &mut frame).expect("a frame");
            times.push(&frame.times);
        });
    });
    group.finish();
    if times.frames() > 0 {
        println!("{}\n", SideBySide(&[(name, &times)]));
    }
}
