//! Frames a second of the Rust library, for `throughput.py`: cargo run --release -p insonify-python --example throughput

use std::path::Path;
use std::time::Instant;

use insonify::render::{Backend, BackendChoice, FrameQuality};
use insonify::{Frame, Pose, Renderer, Station};

fn main() -> Result<(), Box<dyn std::error::Error>> {
    let arguments: Vec<String> = std::env::args().collect();
    let [_, station, quality, frames] = arguments.as_slice() else {
        return Err("usage: throughput STATION QUALITY FRAMES".into());
    };
    let station = Station::load(Path::new(station))?;
    let quality: FrameQuality = quality.parse()?;
    let frames: u32 = frames.parse()?;
    let scene = station.load_scene(&|_| ())?;
    let backend = Backend::open(BackendChoice::Host)?;
    let mut settings = station.settings;
    settings.quality = quality.with_seed(0);
    let mut renderer = Renderer::new(&backend, &scene, &station.probe, &settings)?;
    let pose = station.default_pose.unwrap_or(Pose::IDENTITY);
    let mut frame = Frame::default();
    let mut started = Instant::now();
    // The first tenth warms up.
    for n in 0..frames + frames / 10 {
        if n == frames / 10 {
            started = Instant::now();
        }
        renderer.render(&pose, &mut frame)?;
    }
    println!("{}", f64::from(frames) / started.elapsed().as_secs_f64());
    Ok(())
}
