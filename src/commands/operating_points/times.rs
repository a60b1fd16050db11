//! Times of operating points on this machine: measured once, then kept in the cache.

use std::collections::BTreeMap;
use std::path::PathBuf;
use std::time::{Duration, Instant};

use insonify::generator::Generator;
use insonify::pose::Pose;
use insonify::render::{BackendError, Frame, FrameQuality, RenderError, Renderer, processor_name};
use insonify::sink::write_json;
use insonify::station::Station;
use insonify::statistics::{mean, nearest_rank, sorted};
use serde::{Deserialize, Serialize};
use sha2::{Digest, Sha256};

use super::super::{Failure, output, session};

/// Timed frames and runs of a point, after one to warm up.
const FRAMES: usize = 5;
/// Time after which no further point is measured, s.
const ENOUGH_S: f64 = 2.5;
/// A point whose frames take so many times the budget ends the measurement of points with more paths.
const BEYOND: f64 = 1.5;

/// Median times, ms, and their spread.
#[derive(Debug, Clone, Default, PartialEq, Serialize, Deserialize)]
pub(crate) struct Times {
    /// Frames of one look by rays and layers, without maps; none for those that the device has no room for, or that take far
    /// more than the budget.
    render_ms: Vec<([u32; 2], Option<f64>)>,
    /// What the maps, and rolling compounding, add to a frame.
    maps_ms: Option<f64>,
    angles_ms: Option<f64>,
    /// Time without the aperture over that with it.
    without_aperture: Option<f64>,
    /// Runs, by SHA-256 of the model.
    run_ms: BTreeMap<String, f64>,
    /// 95th percentile of times over their median.
    pub(crate) spread: f64,
}

/// What a measurement takes.
pub(super) struct Bench<'a> {
    pub(super) station: &'a Station,
    pub(super) renderer: &'a mut Renderer,
    pub(super) generators: &'a mut [Generator],
    pub(super) pose: Pose,
    /// Time that a frame may take, ms.
    pub(super) frame_ms: f64,
}

impl Times {
    /// Time of a frame, ms; none if it was not measured.
    pub(super) fn render(&self, quality: FrameQuality, maps: bool) -> Option<f64> {
        let of_paths = |(known, _): &&([u32; 2], Option<f64>)| *known == [quality.rays, quality.layers];
        let (_, ms) = self.render_ms.iter().find(of_paths)?;
        let ms = ms.as_ref()? * if quality.aperture { 1.0 } else { self.without_aperture? };
        let angles_ms = if quality.angles > 1 { self.angles_ms? } else { 0.0 };
        Some(ms + angles_ms + if maps { self.maps_ms? } else { 0.0 })
    }

    /// Time of a run, ms.
    pub(super) fn run(&self, generator: &Generator) -> Option<f64> {
        self.run_ms.get(&generator.manifest().sha256).copied()
    }

    /// Times of `qualities` and of the generators: those of the cache, and the others measured, in at most three seconds.
    /// Whether anything was measured.
    pub(super) fn known_or_measured(
        bench: &mut Bench<'_>,
        qualities: &[FrameQuality],
    ) -> Result<(Self, bool), Failure> {
        let path = path(bench)?;
        let kept = std::fs::read(&path).ok().and_then(|text| serde_json::from_slice::<Self>(&text).ok());
        let mut times = kept.unwrap_or_default();
        let unknown = qualities.iter().any(|q| !times.knows([q.rays, q.layers]));
        if !unknown && times.maps_ms.is_some() && bench.generators.iter().all(|g| times.run(g).is_some()) {
            return Ok((times, false));
        }
        times.measure(bench, qualities)?;
        // Without a cache the next session measures again.
        if let Err(error) = write_json(&path, &times) {
            tracing::debug!("times are not kept: {error}");
        }
        Ok((times, true))
    }

    fn knows(&self, rays_layers: [u32; 2]) -> bool {
        self.render_ms.iter().any(|(known, _)| *known == rays_layers)
    }

    fn measure(&mut self, bench: &mut Bench<'_>, qualities: &[FrameQuality]) -> Result<(), Failure> {
        let started = Instant::now();
        let mut spreads = Vec::new();
        let image = bench.station.settings.image;
        for generator in bench.generators.iter_mut() {
            if self.run(generator).is_none() {
                let times = generator.measure(image.width, image.height, FRAMES)?;
                let ms = median_of(times.iter().map(Duration::as_secs_f64).map(|s| 1e3 * s), &mut spreads);
                self.run_ms.insert(generator.manifest().sha256.clone(), ms);
            }
        }
        // With the aperture if the station has it.
        let aperture = qualities.iter().any(|quality| quality.aperture);
        let one_look = |[rays, layers]: [u32; 2]| FrameQuality { aperture, ..FrameQuality::new(rays, layers) };
        if let Some(first) = qualities.first().map(|quality| one_look([quality.rays, quality.layers])) {
            let angles = qualities.iter().map(|quality| quality.angles).max().unwrap_or(1);
            let without = FrameQuality { aperture: false, ..first };
            let compounded = FrameQuality { angles, ..first };
            // Differences of medians would be lost in the noise of so few frames.
            let mut ms = |quality, maps| Ok::<_, Failure>(frames(bench, quality, maps)?.and_then(least));
            let alone = ms(first, false)?;
            let over = |more: Option<f64>| alone.zip(more).map(|(alone, more)| (more - alone).max(0.0));
            self.maps_ms = over(ms(first, true)?);
            self.angles_ms = if angles > 1 { over(ms(compounded, false)?) } else { Some(0.0) };
            self.without_aperture = match aperture {
                true => alone.zip(ms(without, false)?).map(|(with, without)| (without / with).min(1.0)),
                false => Some(1.0),
            };
        }
        let mut beyond = None;
        for rays_layers in qualities.iter().map(|quality| [quality.rays, quality.layers]) {
            let quality = one_look(rays_layers);
            if self.knows(rays_layers) {
                continue;
            }
            let hopeless = beyond.is_some_and(|paths| quality.paths() >= paths);
            // What is left out now is measured at the next start.
            if !hopeless && started.elapsed().as_secs_f64() > ENOUGH_S {
                continue;
            }
            let ms = if hopeless { None } else { frames(bench, quality, false)?.map(|ms| median_of(ms, &mut spreads)) };
            if ms.is_none_or(|ms| ms > BEYOND * bench.frame_ms) {
                beyond = Some(quality.paths());
            }
            self.render_ms.push((rays_layers, ms));
        }
        // Of few values, the largest stands for the 95th percentile.
        self.spread = mean(spreads).unwrap_or(1.0).max(1.0);
        Ok(())
    }
}

/// Times of frames of a quality, ms; none if the device has no room for them.
fn frames(bench: &mut Bench<'_>, quality: FrameQuality, maps: bool) -> Result<Option<Vec<f64>>, Failure> {
    let Station { probe, settings, .. } = bench.station;
    let aperture = settings.effects.of(insonify::render::Effect::Aperture);
    let mut settings = quality.apply(settings, aperture);
    settings.maps = maps;
    match bench.renderer.reconfigure(probe, &settings) {
        Ok(()) => {}
        Err(RenderError::Backend(BackendError::Limit { .. } | BackendError::Memory { .. })) => return Ok(None),
        Err(error) => return Err(error.into()),
    }
    let mut frame = Frame::default();
    let mut ms = Vec::with_capacity(FRAMES);
    for nth in 0..=FRAMES {
        bench.renderer.submit(&bench.pose)?;
        bench.renderer.receive(&mut frame)?;
        if nth > 0 {
            ms.push(frame.times.total_ms);
        }
    }
    Ok(Some(ms))
}

/// Median of `ms`; adds the largest over it to `spreads`.
fn median_of(ms: impl IntoIterator<Item = f64>, spreads: &mut Vec<f64>) -> f64 {
    let ms = sorted(ms);
    let [median, most] = [0.5, 1.0].map(|part| nearest_rank(&ms, part).unwrap_or(f64::INFINITY));
    if median > 0.0 && most.is_finite() {
        spreads.push(most / median);
    }
    median
}

/// Least of `ms`, if there are any.
fn least(ms: Vec<f64>) -> Option<f64> {
    ms.into_iter().min_by(f64::total_cmp)
}

/// File of the times in the cache: named by machine, build and settings.
fn path(bench: &Bench<'_>) -> Result<PathBuf, Failure> {
    let mut sum = Sha256::new();
    let Station { scene, probe, settings, background, motion, .. } = bench.station;
    let mut settings = *settings;
    // These are measured at all values.
    settings.quality = Default::default();
    settings.look.angles = 1;
    let build =
        std::env::current_exe().and_then(|path| path.metadata()).and_then(|data| Ok((data.len(), data.modified()?)));
    let threads = std::thread::available_parallelism().map_or(1, usize::from);
    let device = if bench.renderer.on_host() { "host" } else { "device" };
    let provider = &bench.station.generator.provider;
    sum.update(format!("{} {threads} {device} {build:?} {}", processor_name(), env!("CARGO_PKG_VERSION")));
    sum.update(format!("{scene:?} {probe:?} {settings:?} {background} {motion} {provider:?} {}", bench.frame_ms));
    let name = format!("times-{}.json", output::hex(&sum.finalize()[..8]));
    Ok(session::cache_directory()?.join(name))
}

#[cfg(test)]
mod tests {
    use super::*;

    #[test]
    fn times_come_back_from_the_cache() {
        let mut spreads = Vec::new();
        assert_eq!(median_of([3.0, 1.0, 2.0, 9.0, 2.5], &mut spreads), 2.5);
        assert_eq!(spreads, [9.0 / 2.5]);
        let times = Times {
            render_ms: vec![([1, 1], Some(20.0)), ([32, 3], None)],
            maps_ms: Some(4.0),
            angles_ms: Some(2.0),
            without_aperture: Some(0.5),
            run_ms: [("ab".to_owned(), 30.0)].into(),
            spread: 1.2,
        };
        let again: Times = serde_json::from_str(&serde_json::to_string(&times).unwrap()).unwrap();
        assert_eq!(again, times);
        let of = |quality, maps| again.render(quality, maps);
        assert_eq!([of(FrameQuality::LQ, false), of(FrameQuality::LQ, true)], [Some(20.0), Some(24.0)]);
        let lean = FrameQuality { angles: 9, aperture: false, ..FrameQuality::LQ };
        assert_eq!(of(lean, true), Some(16.0));
        assert_eq!([of(FrameQuality::new(32, 3), false), of(FrameQuality::new(2, 3), false)], [None, None]);
    }
}
