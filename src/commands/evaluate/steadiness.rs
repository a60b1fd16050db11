//! Steadiness of generated frames while the probe slides in its image plane.

use std::path::{Path, PathBuf};

use anyhow::anyhow;
use glam::DVec3;
use insonify::generator::{Generator, Input};
use insonify::pose::Pose;
use insonify::quality::Steadiness;
use insonify::render::{Effect, Frame, FrameQuality, Quality, RenderSettings, Renderer};
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

/// Renders the slide in high quality, and in each low quality as a live session does; runs the generators on the frames
/// that they were trained for. The high quality is that of the first model's training.
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
    let aperture = base.effects.of(Effect::Aperture);
    let taken = |generator: &Generator| generator.manifest().lq().first().copied().unwrap_or(FrameQuality::LQ);
    let mut qualities = vec![FrameQuality::LQ];
    for quality in generators.iter().map(|(_, generator)| taken(generator)) {
        if !qualities.contains(&quality) {
            qualities.push(quality);
        }
    }
    let of_training = generators.first().and_then(|(_, g)| g.manifest().training.as_ref()?.hq);
    let target = of_training.unwrap_or(FrameQuality::new(Quality::HQ.rays, Quality::HQ.layers));
    let mut renderer = Renderer::new(&backend, &scene, &station.probe, &FrameQuality::LQ.apply(&base, aperture))?;
    let sector = *renderer.sector();
    let step_mm = f64::from(args.step) * sector.pixel_mm;
    let count = args.frames as usize;
    let total = (qualities.len() + 1) * count;
    let progress = Progress::new("steadiness", total);
    let mut sequences: Vec<(String, Vec<Vec<u8>>)> = Vec::new();
    let mut mask = Vec::new();
    let mut frame = Frame::default();
    for (nth, quality) in qualities.iter().enumerate() {
        renderer.reconfigure(&station.probe, &quality.apply(&base, aperture))?;
        renderer.restart_compounding();
        let before = quality.angles as usize - 1;
        let mut rendered = Vec::new();
        let mut generated: Vec<(String, Vec<Vec<u8>>)> = Vec::new();
        for (done, pose) in slide(&pose, count, before, step_mm).iter().enumerate() {
            progress.set(nth * count + done.saturating_sub(before), total);
            renderer.submit(pose)?;
            renderer.receive(&mut frame)?;
            if done < before {
                continue;
            }
            let own = generators.iter_mut().filter(|(_, generator)| taken(generator) == *quality);
            for (index, (name, generator)) in own.enumerate() {
                let mut image = Vec::new();
                generator.run(&Input::from(&frame), &mut image)?;
                if generated.len() <= index {
                    generated.push((name.clone(), Vec::new()));
                }
                generated[index].1.push(image);
            }
            rendered.push(frame.bmode.clone());
            mask.clone_from(&frame.mask);
        }
        let name = if *quality == FrameQuality::LQ { "LQ".to_owned() } else { quality.to_string() };
        sequences.push((name, rendered));
        sequences.append(&mut generated);
    }
    renderer.reconfigure(&station.probe, &target.apply(&base, aperture))?;
    let mut hq = Vec::new();
    for (done, pose) in slide(&pose, count, 0, step_mm).iter().enumerate() {
        progress.set(qualities.len() * count + done, total);
        renderer.render(pose, &mut frame)?;
        hq.push(frame.bmode.clone());
    }
    drop(progress);
    let size = [sector.width as usize, sector.height as usize];
    let shift = [-(args.step as isize), 0];
    let mut rows = Vec::new();
    for (name, frames) in &sequences {
        rows.push(Row { name: name.clone(), steadiness: Steadiness::of(frames, &hq, &mask, size, shift)? });
    }
    let name = format!("HQ (target, {target})");
    rows.push(Row { name, steadiness: Steadiness::of(&hq, &hq, &mask, size, shift)? });
    Ok(Report { station: path.to_owned(), frames: count, step_pixels: args.step, step_mm, rows })
}

/// `frames` poses along the probe's x axis, centred on `middle`, and `before` of them on the way there.
fn slide(middle: &Pose, frames: usize, before: usize, step_mm: f64) -> Vec<Pose> {
    let axis = middle.transform_vector(DVec3::X);
    let at = |i: usize| (i as f64 - before as f64 - 0.5 * (frames as f64 - 1.0)) * step_mm;
    (0..before + frames).map(|i| Pose { position_mm: middle.position_mm + axis * at(i), ..*middle }).collect()
}

#[cfg(test)]
mod tests {
    use super::*;
    use glam::DQuat;

    #[test]
    fn the_probe_slides_in_its_image_plane() {
        let orientation = DQuat::from_rotation_z(std::f64::consts::FRAC_PI_2);
        let poses = slide(&Pose { position_mm: DVec3::new(5.0, 6.0, 7.0), orientation }, 3, 1, 0.5);
        let expected = [5.0, 5.5, 6.0, 6.5].map(|y| DVec3::new(5.0, y, 7.0));
        assert!(poses.iter().zip(expected).all(|(p, e)| p.position_mm.distance(e) < 1e-12), "{poses:?}");
    }
}
