//! A first frame: renders the scene of a station file with its probe and pose, on the processor, and writes a picture:
//! `cargo run --release --example first_frame -- [STATION] [PICTURE]`

use std::error::Error;
use std::path::{Path, PathBuf};

use insonify::render::{Backend, BackendChoice};
use insonify::sink::png::{Effort, write_grey};
use insonify::{Frame, Renderer, Station};

/// Renders a frame at the station's pose.
pub(crate) fn render(station: &Path) -> Result<Frame, Box<dyn Error>> {
    let station = Station::load(station)?;
    let file = station.scene_file().ok_or("the station has a generated scene; take one whose [scene] has a path")?;
    let scene = station.load_scene_from(file)?;
    let backend = Backend::open(BackendChoice::Host)?;
    let mut renderer = Renderer::new(&backend, &scene, &station.probe, &station.settings)?;
    let mut frame = Frame::default();
    renderer.render(&station.default_pose.ok_or("the station has no [pose]")?, &mut frame)?;
    Ok(frame)
}

fn main() -> Result<(), Box<dyn Error>> {
    let mut arguments = std::env::args_os().skip(1).map(PathBuf::from);
    let station = arguments.next().unwrap_or_else(|| "configs/sphere.toml".into());
    let picture = arguments.next().unwrap_or_else(|| "frame.png".into());
    let frame = render(&station)?;
    write_grey(&picture, frame.width, frame.height, &frame.bmode, Effort::Small)?;
    println!("{}: {} x {} pixels in {:.0} ms", picture.display(), frame.width, frame.height, frame.times.total_ms);
    Ok(())
}
