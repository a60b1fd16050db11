//! Savings by the effect plan: frames of the sample scenes as planned and with every effect, at the stations' settings.
//!
//! `cargo bench --bench plan`. After each scene the plan's effects are printed. The obstetric phantom is taken from the
//! program's cache.

// A benchmark that cannot be set up has nothing to measure.
#![allow(clippy::expect_used)]

mod support;

use std::path::Path;
use std::sync::Arc;

use criterion::{BenchmarkId, Criterion};
use insonify::anatomy::Bvh;
use insonify::render::{Backend, BackendChoice, EffectChoices, EffectPlan, Frame, Quality, RenderSettings, Renderer};
use insonify::station::Station;

/// Stations, and whether frames carry maps: a session without a reader of maps needs none.
const STATIONS: [(&str, bool); 6] = [
    ("obstetric", true),
    ("obstetric", false),
    ("slabs", true),
    ("speckle_block", true),
    ("speckle", true),
    ("vessel_needle", true),
];

fn main() {
    let mut criterion = Criterion::default().configure_from_args();
    let root = Path::new(env!("CARGO_MANIFEST_DIR"));
    let backend =
        Backend::open(BackendChoice::from_environment().expect("a backend").unwrap_or_default()).expect("a backend");
    println!("{backend}");
    let mut group = criterion.benchmark_group("plan");
    group.sample_size(10);
    for (name, maps) in STATIONS {
        let station = Station::load(&root.join(format!("configs/{name}.toml"))).expect("a station");
        let scene = support::scene(&station);
        let bvh = Arc::new(Bvh::build(&scene).expect("a scene that can be traced"));
        let pose = station.default_pose.expect("a pose");
        // High quality takes seconds per frame in software: its cost beyond these is proportional.
        let Quality { rays, layers, seed } = station.settings.quality;
        let quality = Quality { rays: rays.min(4), layers: layers.min(2), seed };
        let planned = RenderSettings { maps, quality, ..station.settings };
        let whole = RenderSettings { maps: true, effects: EffectChoices::ALL_ON, ..planned };
        let label = if maps { name.to_owned() } else { format!("{name} without a reader of maps") };
        for (way, settings) in [("planned", planned), ("all effects", whole)] {
            let mut renderer =
                Renderer::with_bvh(&backend, &scene, bvh.clone(), &station.probe, &settings).expect("a renderer");
            let mut frame = Frame::default();
            group.bench_function(BenchmarkId::new(way, &label), |bencher| {
                bencher.iter(|| renderer.render(&pose, &mut frame).expect("a frame"));
            });
        }
        println!(
            "{label} at {} x {}:\n{}",
            quality.rays,
            quality.layers,
            EffectPlan::new(&scene, &station.probe, &planned)
        );
    }
    group.finish();
    criterion.final_summary();
}
