//! Cost curves: frame time against triangles, rays, layers, axial samples, scanlines and image size. Each is varied
//! alone, and a power law is fitted.
//!
//! `cargo bench --bench cost` takes about three minutes on two cores; `cargo bench --bench cost -- rays layers`
//! measures only these curves. The curve of triangles uses 32 spheres that fill the view, at the same positions for
//! each count. All other curves use the obstetric phantom.
//!
//! Each number is the median over poses, as `insonify bench` measures it. The output is also written to
//! `out/cost/cost.md` and `cost.svg`.

// A benchmark that cannot be set up has nothing to measure.
#![allow(clippy::expect_used)]

#[path = "support/cost_figure.rs"]
mod figure;

use std::path::Path;
use std::sync::Arc;

use glam::{DVec3, Vec3};
use insonify::anatomy::analytic::{Part, joined, scene, sphere};
use insonify::anatomy::{Bvh, Scene, TissueTable};
use insonify::measuring::bench::{Flow, Workload, measure};
use insonify::pose::Pose;
use insonify::recording;
use insonify::render::{Backend, BackendChoice, Quality, RenderSettings};
use insonify::report::time_table::{OVERHEAD, WHOLE_FRAME};
use insonify::station::Station;
use insonify::statistics::{evenly, slope};
use insonify::transducer::Probe;

/// Number of measured frames for each point of a curve.
const FRAMES: usize = 7;

/// Point of a curve: value of the varied quantity, median time of a frame, and of each pass, ms.
struct Point {
    x: f64,
    total_ms: f64,
    passes: Vec<(&'static str, f64)>,
}

/// A curve: name of the varied quantity, and points.
struct Curve {
    name: &'static str,
    points: Vec<Point>,
}

fn main() {
    let wanted: Vec<String> = std::env::args().skip(1).filter(|a| !a.starts_with('-')).collect();
    const NAMES: [&str; 6] = ["triangles", "rays", "layers", "samples", "scanlines", "image"];
    if let Some(unknown) = wanted.iter().find(|w| !NAMES.contains(&w.as_str())) {
        eprintln!("`{unknown}` is no curve; they are {}", NAMES.join(", "));
        std::process::exit(2);
    }
    let is_wanted = |name: &str| wanted.is_empty() || wanted.iter().any(|w| w == name);
    let backend =
        Backend::open(BackendChoice::from_environment().expect("a backend").unwrap_or_default()).expect("a backend");
    println!("{backend}");
    let root = Path::new(env!("CARGO_MANIFEST_DIR"));
    let station = Station::load(&root.join("configs/obstetric.toml")).expect("the obstetric station");

    let mut measured = Vec::new();
    if is_wanted("triangles") {
        measured.push(triangles(&backend, &station.settings));
    }
    type Change = fn(&mut Probe, &mut RenderSettings, u32);
    let curves: [(&'static str, &[u32], Change); 5] = [
        ("rays", &[1, 2, 4, 8, 16, 32, 64], |_, s, n| s.quality = Quality { rays: n, ..s.quality }),
        ("layers", &[1, 2, 3, 5, 9, 17], |_, s, n| s.quality = Quality { layers: n, ..s.quality }),
        ("samples", &[384, 768, 1536, 3072, 6144], |p, _, n| p.samples = n.into()),
        ("scanlines", &[32, 64, 128, 256, 512], |p, _, n| p.scanlines = n),
        ("image", &[250, 500, 1000, 2000], |_, s, n| (s.image.width, s.image.height) = (n * 1386 / 1000, n)),
    ];
    if curves.iter().all(|(name, ..)| !is_wanted(name)) {
        return write(&backend, &measured);
    }
    let measured_scene = Measured::new(&backend, station.load_scene(&|_| ()).expect("the scene"));
    let (recorded, _) = recording::poses(&root.join("assets/exams/obstetric_sweep.mcap")).expect("the recorded exam");
    let poses: Vec<Pose> = evenly(FRAMES, recorded.len()).map(|i| recorded[i].pose).collect();
    for (name, values, change) in curves.into_iter().filter(|(name, ..)| is_wanted(name)) {
        let points = values.iter().filter_map(|&n| {
            let (mut probe, mut settings) = (station.probe, station.settings);
            change(&mut probe, &mut settings, n);
            measured_scene.point(name, n, (probe, settings), &poses)
        });
        let points = points.collect();
        measured.push(Curve { name, points });
        measured.last().into_iter().for_each(|curve| print!("{}", table(curve)));
    }
    write(&backend, &measured);
}

/// Writes the tables and the figure to files.
fn write(backend: &Backend, curves: &[Curve]) {
    let place = if backend.on_host() { "made on the host's cores; " } else { "" };
    let title = format!("Time of a frame with its maps: {place}{} ({})", backend.name(), backend.driver());
    let folder = Path::new(env!("CARGO_MANIFEST_DIR")).join("out/cost");
    std::fs::create_dir_all(&folder).expect("a folder for the results");
    let tables: String = curves.iter().map(table).collect();
    std::fs::write(folder.join("cost.md"), format!("{title}, `cargo bench --bench cost`:\n{tables}")).expect("cost.md");
    std::fs::write(folder.join("cost.svg"), figure::svg(curves, &title).expect("a figure")).expect("cost.svg");
    println!("\n{}", folder.display());
}

fn triangles(backend: &Backend, settings: &RenderSettings) -> Curve {
    let tissues = TissueTable::builtin().expect("the tissue table");
    let pose = |i: usize| Pose { position_mm: DVec3::new(0.7 * i as f64, 0.3 * i as f64, 0.0), ..Pose::IDENTITY };
    let poses: Vec<Pose> = (0..FRAMES).map(pose).collect();
    let mut points = Vec::new();
    for subdivisions in 1..=7 {
        let spheres = (0..32u8).map(|i| {
            let (column, row) = (f32::from(i % 8), f32::from(i / 8));
            sphere(Vec3::new(20.0 * (column - 3.5), 0.0, 25.0 + 30.0 * row), 9.0, subdivisions)
        });
        let mesh = joined(spheres);
        let count = mesh.triangles.len() as u32;
        let part = Part { name: "spheres", tissue: "muscle", priority: 1, mesh };
        let made = scene(vec![part], &tissues, "liver").expect("tissues of the table");
        points.extend(Measured::new(backend, made).point("triangles", count, (Probe::default(), *settings), &poses));
    }
    let curve = Curve { name: "triangles", points };
    print!("{}", table(&curve));
    curve
}

/// Scene in which points of a curve are measured.
struct Measured<'a> {
    backend: &'a Backend,
    scene: Scene,
    bvh: Arc<Bvh>,
}

impl<'a> Measured<'a> {
    fn new(backend: &'a Backend, scene: Scene) -> Self {
        let bvh = Arc::new(Bvh::build(&scene).expect("a scene that can be traced"));
        Self { backend, scene, bvh }
    }

    /// Measures the point at which the quantity `name` is `n`. If it can't be rendered, prints the reason and returns
    /// `None`.
    fn point(
        &self,
        name: &'static str,
        n: u32,
        (probe, settings): (Probe, RenderSettings),
        poses: &[Pose],
    ) -> Option<Point> {
        let workload = Workload { name, probe, settings, moves: false, flow: Flow::Single };
        let found = measure(self.backend, &self.scene, &self.bvh, &workload, poses, FRAMES, || {});
        let stages = found.inspect_err(|error| println!("{name} = {n}: {error}")).ok()?.stages;
        let total_ms = stages.iter().find(|stage| stage.stage == WHOLE_FRAME)?.p50_ms;
        let passes = stages.iter().take_while(|stage| ![OVERHEAD, WHOLE_FRAME].contains(&stage.stage));
        Some(Point { x: f64::from(n), total_ms, passes: passes.map(|stage| (stage.stage, stage.p50_ms)).collect() })
    }
}

/// Markdown table of a curve.
fn table(Curve { name, points }: &Curve) -> String {
    let Some(last) = points.last() else { return String::new() };
    let names: Vec<_> = last.passes.iter().map(|p| p.0).collect();
    let mut text = format!("\n| {name} | frame, ms | {} |\n", names.join(" | "));
    text += &format!("|---|---|{}\n", "---|".repeat(names.len()));
    for point in points {
        let passes: Vec<_> = point.passes.iter().map(|p| format!("{:.1}", p.1)).collect();
        text += &format!("| {} | {:.1} | {} |\n", point.x, point.total_ms, passes.join(" | "));
    }
    let exponents: Vec<_> = (0..names.len()).map(|i| format!("{:+.2}", exponent(points, |p| p.passes[i].1))).collect();
    text + &format!("| exponent | {:+.2} | {} |\n", exponent(points, |p| p.total_ms), exponents.join(" | "))
}

/// Exponent of the power law: slope of the least-squares line through (ln x, ln ms).
fn exponent(points: &[Point], ms: impl Fn(&Point) -> f64) -> f64 {
    let logs: Vec<(f64, f64)> = points.iter().map(|p| (p.x.ln(), ms(p).max(1e-4).ln())).collect();
    slope(&logs).0
}
