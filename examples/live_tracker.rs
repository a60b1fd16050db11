//! A live session with one's own tracker (a thread that supplies poses) and one's own sink (which prints frames):
//! `cargo run --release --example live_tracker -- [SECONDS]`

use std::error::Error;
use std::path::Path;
use std::sync::Arc;
use std::time::Duration;

use insonify::glam::{DQuat, DVec3};
use insonify::pipeline::{Limits, LocalRendererFactory, Parts, Pipeline, Summary, TrackedPoses};
use insonify::pose::{Estimator, Measurement, Reading, Settings};
use insonify::render::{Backend, BackendChoice};
use insonify::sink::live::{LiveSink, PresentedFrame};
use insonify::tracker::host_time_ns;
use insonify::{Pose, Station};

/// Sink that prints the probe's position and the latency of each frame.
struct Printer;

impl LiveSink for Printer {
    fn name(&self) -> &str {
        "printer"
    }

    fn present(&mut self, frame: &PresentedFrame) -> Result<(), insonify::sink::SinkError> {
        let x_mm = frame.info.pose().map_or(f64::NAN, |pose| pose.position_mm.x);
        let latency = frame.info.pose_to_present().map_or("no new pose".to_owned(), |time| format!("{time:.1?}"));
        println!("frame {}: x = {x_mm:.1} mm, {latency}", frame.number);
        Ok(())
    }
}

/// Runs a session of some seconds, in which the probe swings across the scene's sphere.
pub(crate) fn run(station: &Path, seconds: f64) -> Result<Summary, Box<dyn Error>> {
    let station = Station::load(station)?;
    let scene = station.load_scene_from(station.scene_file().ok_or("take a station whose [scene] has a path")?)?;
    let factory = LocalRendererFactory::new(Backend::open(BackendChoice::Host)?, Arc::new(scene))?;
    let poses = TrackedPoses::new(Estimator::new(Settings::default()));
    let (mut parts, _controls) = Parts::new(poses.clone(), factory, station.probe, station.settings)?;
    parts.sinks.push(Box::new(Printer));
    let stop = parts.stop.clone();
    std::thread::spawn(move || {
        for sequence in (0..).take_while(|_| !stop.is_requested()) {
            let x_mm = 20.0 * (0.02 * f64::from(sequence)).sin();
            let pose = Pose { position_mm: DVec3::new(x_mm, 0.0, 0.0), orientation: DQuat::IDENTITY };
            let (host_time_ns, reading) = (host_time_ns(), Reading::Pose(pose));
            poses.push(&Measurement { host_time_ns, device_time_us: None, sequence: Some(sequence), reading });
            std::thread::sleep(Duration::from_millis(10));
        }
    });
    let limits = Limits { duration: Some(Duration::try_from_secs_f64(seconds)?), frames: None };
    Ok(Pipeline::run(&station.pipeline, limits, parts, |_| ())?)
}

fn main() -> Result<(), Box<dyn Error>> {
    let seconds = std::env::args().nth(1).map_or(Ok(5.0), |text| text.parse())?;
    println!("{} frames", run(Path::new("configs/sphere.toml"), seconds)?.presented);
    Ok(())
}
