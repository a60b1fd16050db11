//! Stress test: traces as many rays as a million random frames have, and checks that all values stay finite.
//!
//! `make hard ARGS="--frames N --seconds S --state FILE --station STATION"`. A frame counts as 256 rays. Each chunk is
//! a random scene (or the station's) seen from 24 random poses with 32 rays per scanline. The bits of every value that
//! the device wrote for a frame are checked.
//!
//! Chunks are numbered, and depend only on their number. The state file records the progress of earlier runs, where the
//! next run continues. At the first non-finite value, the program names its chunk and pose and exits with 1.

// A test that cannot be set up has nothing to show.
#![allow(clippy::expect_used)]

use std::path::PathBuf;
use std::process::ExitCode;
use std::time::Instant;

use clap::Parser;
use glam::{DVec3, Quat, Vec3};
use insonify::anatomy::{Scene, Tissue, analytic};
use insonify::pose::Pose;
use insonify::random::SplitMix64;
use insonify::render::{Backend, BackendChoice, Frame, RenderSettings, Renderer};
use insonify::selftest::bench::{Bench, silent, small};
use insonify::station::Station;
use insonify::transducer::{Probe, ProbeKind};

/// Number of rays in a low-quality frame.
const FRAME_RAYS: u64 = 256;
/// Number of poses in a chunk.
const POSES: u64 = 24;
const SCANLINES: u32 = 256;
const RAYS: u32 = 32;

#[derive(Parser)]
struct Args {
    /// Stop at this many frames' worth of rays, including those of earlier runs
    #[arg(long, default_value_t = 1_000_000)]
    frames: u64,
    /// Stop after this many seconds, at the end of a chunk
    #[arg(long)]
    seconds: Option<u64>,
    /// File that stores the count
    #[arg(long, default_value = "out/hard.json")]
    state: PathBuf,
    /// Station whose scene every fourth chunk renders, such as configs/obstetric.toml with its scene exported to a file
    #[arg(long)]
    station: Option<PathBuf>,
}

/// Progress of earlier runs.
#[derive(serde::Serialize, serde::Deserialize, Default)]
struct State {
    chunks: u64,
    rays: u64,
    words: u64,
    overflows: u64,
}

/// Random vector, each component in −1..1.
fn vector(random: &mut SplitMix64) -> DVec3 {
    DVec3::new(random.between(-1.0, 1.0), random.between(-1.0, 1.0), random.between(-1.0, 1.0))
}

/// Random tissue, each value anywhere in its range, ends included.
fn tissue(random: &mut SplitMix64) -> Tissue {
    let mut end = |low: f64, high: f64| match random.unit() {
        u if u < 0.1 => low,
        u if u < 0.2 => high,
        _ => random.between(low, high),
    };
    Tissue {
        attenuation_db_cm_mhz: end(0.0, 100.0) * 0.1,
        attenuation_exponent: end(0.0, 3.0),
        scatterer_density: end(0.0, 1.0),
        scatterer_mean: end(-1.0, 1.0),
        scatterer_deviation: end(0.0, 1.0),
        roughness: end(0.0, 2.0),
        thickness_mm: end(0.0, 10.0),
        ..silent(end(100.0, 10_000.0), 10f64.powf(end(-3.4, 1.0)))
    }
}

/// Random bodies of any size, orientation and kind: sound, flat, inverted, torn, or without area.
fn scene(random: &mut SplitMix64) -> Scene {
    let filled = tissue(random);
    let mut bench = Bench::new(Tissue { density_kg_m3: filled.density_kg_m3.clamp(0.1, 25_000.0), ..filled });
    for i in 0..8 {
        let filled = tissue(random);
        let index = bench.tissue(Tissue { density_kg_m3: filled.density_kg_m3.clamp(0.1, 25_000.0), ..filled });
        let centre = (40.0 * vector(random) + DVec3::new(0.0, 0.0, 40.0)).as_vec3();
        let turn = Quat::from_scaled_axis((3.0 * vector(random)).as_vec3());
        let size = 10f64.powf(random.between(-3.0, 3.0)) as f32;
        let mut mesh = match i % 4 {
            0 => analytic::sphere(centre, size, 3),
            1 => analytic::plate(centre, size * (Vec3::ONE + vector(random).as_vec3()), turn),
            2 => analytic::plate(centre, Vec3::new(80.0, 80.0, 1e-3 * size), turn),
            _ => analytic::cuboid(centre.round() - Vec3::splat(10.0), centre.round() + Vec3::splat(10.0)),
        };
        match (random.unit() * 12.0) as u32 {
            0 => mesh.flip(),
            1 => mesh.triangles.truncate(5),
            2 => mesh.triangles.extend(mesh.triangles.clone()),
            3 => mesh.triangles.push([0, 0, 1]),
            4 => mesh.triangles.iter_mut().step_by(2).for_each(|t| t.swap(0, 1)),
            _ => {}
        }
        bench.add(index, i, mesh);
    }
    bench.scene().expect("a scene of tissues within their ranges")
}

fn probe(random: &mut SplitMix64) -> Probe {
    let kind = match (random.unit() * 3.0) as u32 {
        0 => ProbeKind::Linear { width_mm: random.between(0.1, 200.0) },
        1 => ProbeKind::Convex { radius_mm: random.between(1.0, 100.0), fov_deg: random.between(0.1, 180.0) },
        _ => ProbeKind::Phased { fov_deg: random.between(0.1, 180.0) },
    };
    let depth_mm = random.between(10.0, 250.0);
    Probe {
        kind,
        depth_mm,
        scanlines: SCANLINES,
        samples: 128.into(),
        frequency_mhz: random.between(0.5, 40.0),
        ..Probe::default()
    }
}

fn settings() -> RenderSettings {
    let mut settings = small(RAYS, 1);
    (settings.image.width, settings.image.height) = (64, 64);
    settings
}

/// Number of values checked, and a description of the first one that is not finite or is out of range.
fn check(frame: &Frame) -> (u64, Option<String>) {
    // Checked by their bits, because a compiler may assume that all values are finite.
    let finite = |v: f32| v.to_bits() & 0x7f80_0000 != 0x7f80_0000;
    let lines = frame.lines.iter().flatten();
    let words = 2 * frame.lines.len() + frame.attenuation.len() + 1;
    let bad = lines.chain(&frame.attenuation).chain([&frame.attenuation_p98]).position(|&v| !finite(v));
    let outside = frame.attenuation.iter().position(|v| !(0.0..=1.0).contains(v));
    let what = bad.map(|i| format!("word {i} is not finite"));
    (words as u64, what.or_else(|| outside.map(|i| format!("attenuation {i} is {}", frame.attenuation[i]))))
}

fn main() -> ExitCode {
    let args = Args::parse();
    let mut state: State = std::fs::read_to_string(&args.state)
        .ok()
        .map(|text| serde_json::from_str(&text).expect("a state file of this program"))
        .unwrap_or_default();
    if let Some(dir) = args.state.parent() {
        std::fs::create_dir_all(dir).expect("a directory for the state file");
    }
    let backend =
        Backend::open(BackendChoice::from_environment().expect("a backend").unwrap_or_default()).expect("a backend");
    println!("{backend}");
    let station = args.station.as_ref().map(|path| {
        let station = Station::load(path).expect("a station");
        let file = station.scene_file().expect("a station whose scene is a file").to_owned();
        station.load_scene_from(&file).expect("its scene")
    });
    let (started, before) = (Instant::now(), state.rays);
    let mut phantom: Option<Renderer> = None;
    let mut frame = Frame::default();
    while state.rays < args.frames * FRAME_RAYS && args.seconds.is_none_or(|s| started.elapsed().as_secs() < s) {
        let mut random = SplitMix64::new(state.chunks.wrapping_mul(0x2545_f491_4f6c_dd1d));
        let of_station = station.as_ref().filter(|_| state.chunks % 4 == 3);
        let chosen = probe(&mut random);
        let mut own;
        let renderer = match of_station {
            Some(scene) => {
                if phantom.is_none() {
                    phantom = Some(Renderer::new(&backend, scene, &chosen, &settings()).expect("a renderer"));
                }
                let renderer = phantom.as_mut().expect("made just now");
                renderer.reconfigure(&chosen, &settings()).expect("a configuration");
                renderer
            }
            None => {
                own = Renderer::new(&backend, &scene(&mut random), &chosen, &settings()).expect("a renderer");
                &mut own
            }
        };
        for pose in 0..POSES {
            let reach = if of_station.is_some() { 200.0 } else { 60.0 };
            let from = reach * vector(&mut random);
            let pose_in_scene = Pose::looking(from, 30.0 * vector(&mut random) - from, vector(&mut random));
            renderer.render(&pose_in_scene, &mut frame).expect("a frame");
            let (words, bad) = check(&frame);
            state.words += words;
            state.rays += u64::from(SCANLINES * RAYS);
            state.overflows += u64::from(frame.overflows);
            if let Some(what) = bad {
                eprintln!("chunk {}, pose {pose} ({:?}): {what}", state.chunks, pose_in_scene.components());
                return ExitCode::FAILURE;
            }
        }
        state.chunks += 1;
        let text = serde_json::to_string(&state).expect("numbers");
        std::fs::write(&args.state, text).expect("a state file that can be written");
        if state.chunks.is_multiple_of(16) {
            let rate = (state.rays - before) as f64 / started.elapsed().as_secs_f64();
            println!("{} frames' worth of rays, {:.0} rays/s", state.rays / FRAME_RAYS, rate);
        }
    }
    println!(
        "{} chunks, {} rays ({} frames' worth), {} words: all finite; {} crossings or interactions beyond the buffers",
        state.chunks,
        state.rays,
        state.rays / FRAME_RAYS,
        state.words,
        state.overflows
    );
    ExitCode::SUCCESS
}
