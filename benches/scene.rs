//! Preparation of the first frame: the phantom at a quarter of its triangles, its file, and its BVH.
//!
//! `cargo bench --bench scene`

// A benchmark that cannot be set up has nothing to measure.
#![allow(clippy::expect_used)]

use std::hint::black_box;
use std::time::Duration;

use criterion::Criterion;
use insonify::anatomy::export::write_glb;
use insonify::anatomy::{Bvh, TissueTable, import};
use insonify::phantom::{PhantomOptions, build};

/// Fraction of the full phantom's triangles.
const SCALE: f64 = 0.25;

fn main() {
    let mut criterion = Criterion::default().configure_from_args();
    let mut group = criterion.benchmark_group("scene");
    group.sample_size(10).measurement_time(Duration::from_secs(20));
    let options = PhantomOptions { scale: SCALE, ..PhantomOptions::default() };
    group.bench_function("phantom at scale 0.25", |bencher| {
        bencher.iter(|| build(&options, &|_| {}).expect("the phantom"));
    });

    let surfaces = build(&options, &|_| {}).expect("the phantom");
    let directory = tempfile::tempdir().expect("a directory");
    let path = directory.path().join("phantom.glb");
    write_glb(&surfaces, &path).expect("the phantom's file");
    let tissues = TissueTable::builtin().expect("the tissues");
    group.bench_function("glTF import", |bencher| {
        bencher.iter(|| import::load(black_box(&path), &tissues, 0).expect("the scene"));
    });

    let scene = import::load(&path, &tissues, 0).expect("the scene");
    println!("{} triangles in {} surfaces", scene.triangle_count(), scene.surfaces.len());
    group.bench_function("BVH build", |bencher| bencher.iter(|| Bvh::build(black_box(&scene)).expect("a tree")));
    group.finish();
    criterion.final_summary();
}
