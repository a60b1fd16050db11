//! Steadiness of generated frames while the probe slides in its scan plane.

use std::path::PathBuf;
use std::sync::Arc;

use glam::DVec3;
use serde::Serialize;

use super::Models;
use crate::dataset::{Progress, Step};
use crate::generator::{Generator, Input};
use crate::measuring::MeasuringError;
use crate::pose::Pose;
use crate::quality::Steadiness;
use crate::render::{Backend, Effect, Frame, FrameQuality, Quality, RenderSettings, Renderer};
use crate::station::{Poses, Station, StationError};

/// Slide of the probe in its scan plane.
#[derive(Debug, Clone, Copy, PartialEq, Eq)]
pub struct Slide {
    /// Number of frames, at least 2.
    pub frames: usize,
    /// Displacement from frame to frame, pixels.
    pub step_pixels: u32,
}

impl Default for Slide {
    /// 12 frames, one pixel apart.
    fn default() -> Self {
        Self { frames: 12, step_pixels: 1 }
    }
}

/// Steadiness of low quality, of generators and of the target.
#[derive(Debug, Clone, Serialize)]
pub struct SteadinessReport {
    /// Path of the station file.
    pub station: PathBuf,
    /// Number of frames of the slide.
    pub frames: usize,
    /// Displacement from frame to frame, pixels.
    pub step_pixels: u32,
    /// Displacement from frame to frame, mm.
    pub step_mm: f64,
    /// Low qualities, each with its generators, then the target.
    pub rows: Vec<SteadinessRow>,
}

/// Steadiness of a sequence of frames.
#[derive(Debug, Clone, Serialize)]
pub struct SteadinessRow {
    /// Name of the quality or of the generator.
    pub name: String,
    /// Differences between successive frames.
    #[serde(flatten)]
    pub steadiness: Steadiness,
}

/// Renders the slide in high quality, and in each low quality as a live session does. Runs each generator on the low
/// quality that it was trained for. The high quality is the training target of the first generator.
///
/// The probe slides laterally by whole pixels, so that the warp between frames is exact. The scene is static, and all
/// frames have the station's seed, as in a live session.
///
/// # Errors
/// A station without a pose or with an unusable scene, a generator that cannot be loaded or run, or fewer than two
/// frames.
pub fn steadiness(
    station: &Station,
    models: &Models,
    motion: Slide,
    backend: &Backend,
    progress: &Progress<'_>,
) -> Result<SteadinessReport, MeasuringError> {
    let poses = Poses::of_station(station, None)?.spread(1);
    let pose = *poses.first().ok_or_else(|| StationError::NoPose { station: station.path.clone() })?;
    let scene = station.load_scene(&|p| progress(Step::Phantom { done: p.done, total: p.total }))?;
    let mut generators = models.load_generators(scene.tissues.names())?;
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
    let mut renderer = Renderer::new(backend, &scene, &station.probe, &FrameQuality::LQ.apply(&base, aperture))?;
    let sector = *renderer.sector();
    let step_mm = f64::from(motion.step_pixels) * sector.pixel_mm;
    let count = motion.frames;
    let total = (qualities.len() + 1) * count;
    let mut sequences: Vec<(String, Vec<Vec<u8>>)> = Vec::new();
    let mut mask: Arc<[u8]> = Arc::default();
    let mut frame = Frame::default();
    for (nth, quality) in qualities.iter().enumerate() {
        renderer.reconfigure(&station.probe, &quality.apply(&base, aperture))?;
        renderer.restart_compounding();
        let before = quality.angles as usize - 1;
        let mut rendered = Vec::new();
        let mut generated: Vec<(String, Vec<Vec<u8>>)> = Vec::new();
        for (done, pose) in slide(&pose, count, before, step_mm).iter().enumerate() {
            progress(Step::Frames { done: nth * count + done.saturating_sub(before), total });
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
        progress(Step::Frames { done: qualities.len() * count + done, total });
        renderer.render(pose, &mut frame)?;
        hq.push(frame.bmode.clone());
    }
    let size = [sector.width as usize, sector.height as usize];
    let shift = [-(motion.step_pixels as isize), 0];
    let mut rows = Vec::new();
    for (name, frames) in &sequences {
        rows.push(SteadinessRow { name: name.clone(), steadiness: Steadiness::of(frames, &hq, &mask, size, shift)? });
    }
    let name = format!("HQ (target, {target})");
    rows.push(SteadinessRow { name, steadiness: Steadiness::of(&hq, &hq, &mask, size, shift)? });
    Ok(SteadinessReport {
        station: station.path.clone(),
        frames: count,
        step_pixels: motion.step_pixels,
        step_mm,
        rows,
    })
}

/// `frames` poses along the probe's x axis, centred on `middle`. Before them come `before` poses on the way there.
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
