//! Makes a data set: renders pairs of low and high quality near a station's pose into a directory, and reads them:
//! `cargo run --release --example data_set -- [DIRECTORY]`

use std::error::Error;
use std::path::Path;

use insonify::Station;
use insonify::dataset::{Dataset, Maker, Recipe, Split};
use insonify::render::{Backend, BackendChoice};

/// Mean absolute difference of the grey levels of two pictures.
fn difference(lq: &[u8], hq: &[u8]) -> f64 {
    lq.iter().zip(hq).map(|(a, b)| f64::from(a.abs_diff(*b))).sum::<f64>() / lq.len().max(1) as f64
}

/// Renders `frames` tuples with high quality of `hq` rays × layers into `directory`. Existing tuples are kept.
pub(crate) fn render(station: &Path, frames: usize, hq: [u32; 2], directory: &Path) -> Result<(), Box<dyn Error>> {
    let recipe = Recipe { frames, hq, frames_per_exam: 2, ..Recipe::new(vec![Station::load(station)?]) };
    let maker = Maker::new(recipe)?;
    println!("{maker}");
    let mut job = maker.open(directory)?;
    job.render(&Backend::open(BackendChoice::Host)?, &|_| ())?;
    println!("{}", job.made());
    Ok(())
}

/// Reads the training pairs of a data set. Returns the mean difference of each pair.
pub(crate) fn read(directory: &Path) -> Result<Vec<f64>, Box<dyn Error>> {
    let data = Dataset::open(directory)?;
    let tuples = data.of(Split::Train).map(|row| data.tuple(row));
    Ok(tuples.map(|tuple| tuple.map(|t| difference(&t.lq, &t.hq))).collect::<Result<_, _>>()?)
}

fn main() -> Result<(), Box<dyn Error>> {
    let directory = std::env::args_os().nth(1).unwrap_or_else(|| "out/data_set".into());
    render(Path::new("configs/sphere.toml"), 4, [32, 3], Path::new(&directory))?;
    let differences = read(Path::new(&directory))?;
    println!("LQ and HQ differ by {differences:.1?} grey levels on average");
    Ok(())
}
