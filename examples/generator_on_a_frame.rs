//! A generator on a frame: translates a station's frame with a model. Needs ONNX Runtime (`scripts/setup`):
//! `cargo run --release --example generator_on_a_frame -- [MODEL] [PICTURE]`

use std::error::Error;
use std::path::{Path, PathBuf};

use insonify::generator::{Generator, Input, LoadOptions, Runtime};
use insonify::render::{Backend, BackendChoice};
use insonify::sink::png::{Effort, write_grey};
use insonify::{Frame, Renderer, Station};

/// Renders a frame, and translates it with the model. Returns the frame and the generated grey levels.
pub(crate) fn translate(station: &Path, model: &Path) -> Result<(Frame, Vec<u8>), Box<dyn Error>> {
    let station = Station::load(station)?;
    let scene = station.load_scene_from(station.scene_file().ok_or("take a station whose [scene] has a path")?)?;
    let options = LoadOptions { tissues: scene.tissues.names(), ..LoadOptions::default() };
    let mut generator = Generator::load(model, Runtime::get()?, &options)?;
    let backend = Backend::open(BackendChoice::Host)?;
    let mut renderer = Renderer::new(&backend, &scene, &station.probe, &station.settings)?;
    let (mut frame, mut translated) = (Frame::default(), Vec::new());
    renderer.render(&station.default_pose.ok_or("the station has no [pose]")?, &mut frame)?;
    generator.run(&Input::from(&frame), &mut translated)?;
    Ok((frame, translated))
}

fn main() -> Result<(), Box<dyn Error>> {
    let mut arguments = std::env::args_os().skip(1).map(PathBuf::from);
    let model = arguments.next().unwrap_or_else(|| "assets/generators/fast_msa/fast_msa.onnx".into());
    let picture = arguments.next().unwrap_or_else(|| "translated.png".into());
    let (frame, translated) = translate(Path::new("configs/sphere.toml"), &model)?;
    write_grey(&picture, frame.width, frame.height, &translated, Effort::Small)?;
    println!("{}", picture.display());
    Ok(())
}
