//! A data set: plans exams about a station's pose and renders pairs of low and high quality, or reads what `insonify dataset` wrote:
//! `cargo run --release --example data_set -- [DIRECTORY]`

use std::error::Error;
use std::path::Path;

use insonify::dataset::{Dataset, Plan, Source, Split, Wishes};
use insonify::render::{Backend, BackendChoice, Quality, RenderSettings};
use insonify::{Frame, Renderer, Station};

/// Mean difference of two pictures' grey levels.
fn difference(lq: &[u8], hq: &[u8]) -> f64 {
    lq.iter().zip(hq).map(|(a, b)| f64::from(a.abs_diff(*b))).sum::<f64>() / lq.len().max(1) as f64
}

/// Renders `frames` planned pairs; returns the difference of each.
pub(crate) fn render(station: &Path, frames: usize, hq: Quality) -> Result<Vec<f64>, Box<dyn Error>> {
    let station = Station::load(station)?;
    let scene = station.load_scene_from(station.scene_file().ok_or("take a station whose [scene] has a path")?)?;
    let backend = Backend::open(BackendChoice::Host)?;
    let renderer =
        |quality| Renderer::new(&backend, &scene, &station.probe, &RenderSettings { quality, ..station.settings });
    let (mut low, mut high) = (renderer(Quality::LQ)?, renderer(hq)?);
    let wishes = Wishes { frames, seed: 7, phantoms: 0, frames_per_exam: 2, test_share: 0.5, stations: vec![false] };
    let source = Source::About(station.default_pose.ok_or("the station has no [pose]")?);
    let (mut lq, mut hq, mut differences) = (Frame::default(), Frame::default(), Vec::new());
    for exam in &Plan::new(&wishes)?.exams {
        for moment in exam.moments(&source, 0)? {
            low.render(&moment.pose, &mut lq)?;
            high.render(&moment.pose, &mut hq)?;
            differences.push(difference(&lq.bmode, &hq.bmode));
        }
    }
    Ok(differences)
}

/// Reads the training pairs of a data set; returns the difference of each.
pub(crate) fn read(directory: &Path) -> Result<Vec<f64>, Box<dyn Error>> {
    let data = Dataset::open(directory)?;
    let tuples = data.of(Split::Train).map(|row| data.tuple(row));
    Ok(tuples.map(|tuple| tuple.map(|t| difference(&t.lq, &t.hq))).collect::<Result<_, _>>()?)
}

fn main() -> Result<(), Box<dyn Error>> {
    let differences = match std::env::args_os().nth(1) {
        Some(directory) => read(Path::new(&directory))?,
        None => render(Path::new("configs/sphere.toml"), 4, Quality::HQ)?,
    };
    println!("LQ and HQ differ by {differences:.1?} grey levels on average");
    Ok(())
}
