//! Exports the straight rays of a high-quality frame for `scripts/embree-bench`, with the time that the pass `trace`
//! takes.
//!
//! cargo run --release --example embree_rays -- configs/obstetric.toml PHANTOM.glb OUT

use std::path::Path;

use anyhow::{Context, bail};
use insonify::anatomy::Bvh;
use insonify::pose::Pose;
use insonify::recording;
use insonify::render::{Backend, BackendChoice, Frame, Quality, RenderSettings, Renderer};
use insonify::sink::{create_dir, npy, write_json};
use insonify::station::Station;
use insonify::statistics::{evenly, sorted, upper_median};

/// Number of poses, spread over the recorded exam.
const POSES: usize = 3;
/// Number of timed frames at each pose.
const FRAMES: usize = 5;
/// Segments whose ln of the amplitude is below this value were not traced.
const GIVEN_UP_LN: f64 = -100.0;

fn main() -> anyhow::Result<()> {
    let arguments: Vec<String> = std::env::args().skip(1).collect();
    let [station, scene, out] = &arguments[..] else { bail!("expected STATION.toml SCENE.glb OUT") };
    let out = Path::new(out);
    create_dir(out)?;
    let station = Station::load(Path::new(station))?;
    let scene = station.load_scene_from(Path::new(scene))?;
    let (recorded, _) = recording::poses(Path::new("assets/exams/obstetric_sweep.mcap"))?;
    let poses: Vec<Pose> = evenly(POSES, recorded.len()).map(|i| recorded[i].pose).collect();

    // The device's coordinates are relative to the middle of the scene.
    let centre_mm = Bvh::build(&scene)?.centre_mm;
    let backend = Backend::open(BackendChoice::from_environment()?.unwrap_or_default())?;
    let settings = RenderSettings { quality: Quality::HQ, ..station.settings };
    let mut renderer = Renderer::new(&backend, &scene, &station.probe, &settings)?;
    let mut frame = Frame::default();
    let (mut origins, mut directions, mut lengths) = (Vec::new(), Vec::new(), Vec::new());
    let mut trace_ms = Vec::new();
    for pose in &poses {
        renderer.render(pose, &mut frame)?;
        let mut times = Vec::new();
        for _ in 0..FRAMES {
            renderer.render(pose, &mut frame)?;
            let trace: f64 = frame.times.passes.iter().filter(|p| p.name == "trace").map(|p| p.ms).sum();
            times.push(trace);
        }
        trace_ms.extend(upper_median(&sorted(times)));
        let snapshot = renderer.snapshot(pose)?;
        for path in &snapshot.paths {
            let ends = path.segments.iter().skip(1).map(|s| s.start_mm).chain([station.probe.depth_mm]);
            for (segment, end_mm) in path.segments.iter().zip(ends) {
                let range_mm = end_mm - segment.start_mm;
                let given_up = segment.ln_amplitude(segment.start_mm) < GIVEN_UP_LN;
                if range_mm > 0.0 && !given_up {
                    let from = segment.scatterer_mm(segment.start_mm);
                    origins.extend((centre_mm + from).as_vec3().to_array());
                    directions.extend(segment.step.normalize().as_vec3().to_array());
                    lengths.push((range_mm * segment.step.length()) as f32);
                }
            }
        }
    }
    let (mut vertices, mut faces, mut first) = (Vec::new(), Vec::new(), 0);
    for surface in &scene.surfaces {
        vertices.extend(surface.mesh.vertices_mm.iter().flat_map(|v| v.to_array()));
        // Integers below 2²⁴ are exact in f32.
        faces.extend(surface.mesh.triangles.iter().flatten().map(|i| (i + first) as f32));
        first += u32::try_from(surface.mesh.vertices_mm.len()).context("too many vertices")?;
    }
    if first >= 1 << 24 {
        bail!("{first} vertices: too many for their numbers to be written as f32");
    }
    let write = |name: &str, columns: usize, values: &[f32]| {
        npy::write_f32(&out.join(name), [values.len() / columns, columns], values)
    };
    write("vertices.npy", 3, &vertices)?;
    write("faces.npy", 3, &faces)?;
    write("origins.npy", 3, &origins)?;
    write("directions.npy", 3, &directions)?;
    write("lengths.npy", 1, &lengths)?;
    let about = serde_json::json!({
        "device": backend.name(),
        "driver": backend.driver(),
        "frames": POSES,
        "triangles": scene.triangle_count(),
        "trace_ms": trace_ms,
    });
    write_json(&out.join("frames.json"), &about)?;
    println!("{} rays of {POSES} frames; trace {trace_ms:.1?} ms", lengths.len());
    Ok(())
}
