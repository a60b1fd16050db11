//! Steadiness of generated frames while the probe slides in its image plane.

use std::path::{Path, PathBuf};

use anyhow::anyhow;
use glam::DVec3;
use insonify::generator::Input;
use insonify::pose::Pose;
use insonify::quality::Steadiness;
use insonify::render::{Frame, Quality, RenderSettings, Renderer};
use insonify::station::Station;
use serde::Serialize;

use super::super::progress::Progress;
use super::super::tradeoff::poses;
use super::super::{Failure, session};
use super::{Args, models};

/// Result, for JSON.
#[derive(Serialize)]
pub(super) struct Report {
    pub(super) station: PathBuf,
    pub(super) frames: usize,
    /// Slide from frame to frame.
    pub(super) step_pixels: u32,
    pub(super) step_mm: f64,
    /// Low quality, generators, target.
    pub(super) rows: Vec<Row>,
}

/// Steadiness of a sequence.
#[derive(Serialize)]
pub(super) struct Row {
    pub(super) name: String,
    #[serde(flatten)]
    pub(super) steadiness: Steadiness,
}

/// Renders the slide in both qualities, and runs the generators on each frame of the low one.
///
/// The probe slides laterally by whole pixels, so that the warp between frames is exact. The scene is static, and all
/// frames have the station's seed, as in a live session.
pub(super) fn run(args: &Args, path: &Path) -> Result<Report, Failure> {
    let station = Station::load(path)?;
    let all = poses::of_station(&station, None)?;
    let pose = *all.spread(1).first().ok_or_else(|| Failure::Input(anyhow!("{} has no pose", path.display())))?;
    let backend = args.backend.open(station.backend)?;
    let scene = session::load_scene(&station)?;
    let mut generators = models::generators(args, scene.tissues.names())?;
    let base = RenderSettings { maps: true, lines: false, ..station.settings };
    let of = |quality: Quality| RenderSettings { quality: Quality { seed: base.quality.seed, ..quality }, ..base };
    let mut renderer = Renderer::new(&backend, &scene, &station.probe, &of(Quality::LQ))?;
    let sector = *renderer.sector();
    let step_mm = f64::from(args.step) * sector.pixel_mm;
    let poses = slide(&pose, args.frames as usize, step_mm);
    let progress = Progress::new("steadiness", 2 * poses.len());

    let mut lq = Vec::new();
    let mut generated: Vec<Vec<Vec<u8>>> = vec![Vec::new(); generators.len()];
    let mut mask = Vec::new();
    let mut frame = Frame::default();
    for (done, pose) in poses.iter().enumerate() {
        progress.set(done, 2 * poses.len());
        renderer.render(pose, &mut frame)?;
        for ((_, generator), frames) in generators.iter_mut().zip(&mut generated) {
            let mut image = Vec::new();
            generator.run(&Input::from(&frame), &mut image)?;
            frames.push(image);
        }
        lq.push(frame.bmode.clone());
        mask.clone_from(&frame.mask);
    }
    renderer.reconfigure(&station.probe, &of(Quality::HQ))?;
    let mut hq = Vec::new();
    for (done, pose) in poses.iter().enumerate() {
        progress.set(poses.len() + done, 2 * poses.len());
        renderer.render(pose, &mut frame)?;
        hq.push(frame.bmode.clone());
    }
    drop(progress);
    let size = [sector.width as usize, sector.height as usize];
    let shift = [-(args.step as isize), 0];
    let names = generators.iter().map(|(name, _)| name.clone());
    let sequences = std::iter::once(("LQ".to_owned(), &lq)).chain(names.zip(&generated));
    let mut rows = Vec::new();
    for (name, frames) in sequences.chain([("HQ (target)".to_owned(), &hq)]) {
        rows.push(Row { name, steadiness: Steadiness::of(frames, &hq, &mask, size, shift)? });
    }
    Ok(Report { station: path.to_owned(), frames: poses.len(), step_pixels: args.step, step_mm, rows })
}

/// `frames` poses along the probe's x axis, centred on `middle`.
fn slide(middle: &Pose, frames: usize, step_mm: f64) -> Vec<Pose> {
    let axis = middle.transform_vector(DVec3::X);
    let at = |i: usize| (i as f64 - 0.5 * (frames as f64 - 1.0)) * step_mm;
    (0..frames).map(|i| Pose { position_mm: middle.position_mm + axis * at(i), ..*middle }).collect()
}

#[cfg(test)]
mod tests {
    use super::*;
    use glam::DQuat;

    #[test]
    fn the_probe_slides_in_its_image_plane() {
        let orientation = DQuat::from_rotation_z(std::f64::consts::FRAC_PI_2);
        let poses = slide(&Pose { position_mm: DVec3::new(5.0, 6.0, 7.0), orientation }, 3, 0.5);
        let expected = [5.5, 6.0, 6.5].map(|y| DVec3::new(5.0, y, 7.0));
        assert!(poses.iter().zip(expected).all(|(p, e)| p.position_mm.distance(e) < 1e-12), "{poses:?}");
    }
}
