//! Every shipped generator at the paper's field of view, 1386 × 1000, on 2 CPU threads; the generators' budgets (30 and 60
//! ms) refer to these times. A run is the complete work on a frame: filling the tensor, padding, inference, checking
//! and rounding.
//!
//! `cargo bench --bench generator`, or with models: `GENERATORS=a.onnx:b.onnx cargo bench --bench generator`; with
//! other threads: `THREADS=4`. Needs ONNX Runtime's library (scripts/setup).

// A benchmark that cannot be set up has nothing to measure.
#![allow(clippy::expect_used)]

use std::path::{Path, PathBuf};

use criterion::Criterion;
use insonify::anatomy::TissueTable;
use insonify::generator::{Generator, Input, LoadOptions, Manifest, Runtime};
use insonify::transducer::{Probe, ScanGeometry};

const WIDTH: u32 = 1386;
const HEIGHT: u32 = 1000;

fn main() {
    let mut criterion = Criterion::default().configure_from_args();
    let runtime = Runtime::get().expect("ONNX Runtime");
    let pixels = (WIDTH * HEIGHT) as usize;
    let image: Vec<u8> = (0..pixels).map(|i| (i * 7919 % 251) as u8).collect();
    // Classes in blocks: a real frame has no channel of zeros only.
    let segmentation: Vec<u8> = (0..pixels).map(|i| 1 + (i / 40 % 7) as u8).collect();
    let (attenuation, mask) = (vec![0.5; pixels], vec![255; pixels]);
    let tissues = TissueTable::builtin().expect("the built-in tissues").names().to_vec();
    let threads = std::env::var("THREADS").ok().and_then(|n| n.parse().ok()).unwrap_or(2);
    let options = LoadOptions { threads, tissues: &tissues, ..LoadOptions::default() };
    let input = Input {
        width: WIDTH,
        height: HEIGHT,
        image: &image,
        segmentation: &segmentation,
        attenuation: &attenuation,
        mask: &mask,
        scan: Some(ScanGeometry::fit(&Probe::default(), WIDTH, HEIGHT)),
    };
    let mut group = criterion.benchmark_group("generator");
    group.sample_size(20);
    for path in models() {
        let mut generator = Generator::load(&path, runtime, &options).expect("a sound generator");
        let name = generator.manifest().name.clone();
        let mut out = Vec::new();
        group.bench_function(name, |bencher| {
            bencher.iter(|| generator.run(&input, &mut out).expect("an image"));
        });
    }
    group.finish();
    criterion.final_summary();
}

/// The models named by the environment, else those of `assets/generators`, and the identity, which measures the
/// overhead.
fn models() -> Vec<PathBuf> {
    if let Some(named) = std::env::var_os("GENERATORS") {
        return std::env::split_paths(&named).collect();
    }
    let root = Path::new(env!("CARGO_MANIFEST_DIR"));
    let directories = std::fs::read_dir(root.join("assets/generators")).expect("assets/generators").flatten();
    let files = directories.filter_map(|d| std::fs::read_dir(d.path()).ok()).flatten().flatten().map(|f| f.path());
    let mut models: Vec<_> = files
        .filter(|path| path.extension().is_some_and(|e| e == "onnx") && Manifest::path_of(path).is_file())
        .collect();
    models.push(root.join("tests/data/generators/identity.onnx"));
    models.sort();
    models
}
