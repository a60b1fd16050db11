//! Times of operating points on this machine: measured once, then kept in the cache.

use std::collections::BTreeMap;
use std::path::PathBuf;
use std::time::Instant;

use serde::{Deserialize, Serialize};
use sha2::{Digest, Sha256};

use crate::files::{self, FileKind};
use crate::generator::{Generator, GeneratorError};
use crate::measuring::{self, GeneratorKey};
use crate::pose::Pose;
use crate::render::{BackendError, Effect, Frame, FrameQuality, RenderError, Renderer, processor_name};
use crate::sink::write_json;
use crate::station::Station;
use crate::statistics::{mean, nearest_rank, sorted};

/// Number of timed frames, or generator runs, of an operating point. An uncounted one comes first.
const FRAMES: usize = 5;
/// Time after which no further point is measured, s.
const ENOUGH_S: f64 = 2.5;
/// Once a point takes this multiple of the budget, points with more paths are estimated instead of measured.
const BEYOND: f64 = 1.5;
/// Spread above which a measurement counts as disturbed by another program. The next session then measures again.
const DISTURBED: f64 = 1.4;
/// Ratio of a new time to the cached time below which the measurement of the cached time counts as disturbed.
const LEAST_OF_KEPT: f64 = 0.9;

/// Median times of frames and generator runs on a machine, and their spread.
#[derive(Debug, Clone, Default, PartialEq, Serialize, Deserialize)]
pub(crate) struct Times {
    /// Frame times for rays and layers, with one angle and without maps, ms. `None` if the device lacks memory. Times
    /// far beyond the budget are estimated from the number of paths.
    render_ms: Vec<([u32; 2], Option<f64>)>,
    /// Additional frame time with maps, and with rolling compounding, ms.
    maps_ms: Option<f64>,
    angles_ms: Option<f64>,
    /// Ratio of the frame time without the effect `aperture` to the time with it.
    without_aperture: Option<f64>,
    /// Ratio of the frame time with coarse samples to the time with all.
    coarse: Option<f64>,
    /// Times of generator runs by SHA-256 of the model, ms.
    run_ms: BTreeMap<String, f64>,
    /// Ratio of the 95th percentile of times to their median.
    pub(crate) spread: f64,
}

/// A station whose frames and generator runs are timed.
pub(super) struct TimedStation<'a> {
    pub(super) station: &'a Station,
    pub(super) renderer: &'a mut Renderer,
    pub(super) generators: &'a mut [Generator],
    pub(super) pose: Pose,
    /// Largest time of a frame, ms.
    pub(super) frame_ms: f64,
}

impl Times {
    /// Time of a frame of this quality, with or without maps, ms; `None` if unknown.
    pub(super) fn render(&self, quality: FrameQuality, maps: bool) -> Option<f64> {
        let of_paths = |(known, _): &&([u32; 2], Option<f64>)| *known == [quality.rays, quality.layers];
        let (_, ms) = self.render_ms.iter().find(of_paths)?;
        let ms = ms.as_ref()? * if quality.aperture { 1.0 } else { self.without_aperture? };
        let ms = ms * if quality.coarse { self.coarse? } else { 1.0 };
        let angles_ms = if quality.angles > 1 { self.angles_ms? } else { 0.0 };
        Some(ms + angles_ms + if maps { self.maps_ms? } else { 0.0 })
    }

    /// Time of a generator run, ms; `None` if it is unknown, or if the model can't run here.
    pub(super) fn run(&self, generator: &GeneratorKey) -> Option<f64> {
        self.run_ms.get(&generator.sha256).copied()
    }

    /// Times of `qualities` and of the generators, from the cache or measured. Also returns whether anything was
    /// measured. No measurement begins after [`ENOUGH_S`] seconds, except that of the station's `own` quality.
    pub(super) fn known_or_measured(
        timed: &mut TimedStation<'_>,
        qualities: &[FrameQuality],
        own: FrameQuality,
    ) -> Result<(Self, bool), RenderError> {
        let path = path(timed, qualities);
        let kept =
            files::read(&path, FileKind::Stored).ok().and_then(|text| serde_json::from_slice::<Self>(&text).ok());
        let mut times = kept.unwrap_or_default();
        if times.were_disturbed(timed, qualities)? {
            times = Self::default();
        }
        let unknown = qualities.iter().any(|q| !times.knows([q.rays, q.layers]));
        if !unknown
            && times.maps_ms.is_some()
            && timed.generators.iter().all(|g| times.run(&GeneratorKey::of(g)).is_some())
        {
            return Ok((times, false));
        }
        times.measure(timed, qualities, own)?;
        if let Err(error) = write_json(&path, &times) {
            tracing::debug!("times are not kept: {error}");
        }
        Ok((times, true))
    }

    /// Whether another program disturbed the measurement of these times: their spread is large, or frames are much
    /// faster now.
    fn were_disturbed(&self, timed: &mut TimedStation<'_>, qualities: &[FrameQuality]) -> Result<bool, RenderError> {
        if self.spread > DISTURBED {
            return Ok(true);
        }
        let Some(first) = qualities.first().map(|quality| one_angle(qualities, [quality.rays, quality.layers])) else {
            return Ok(false);
        };
        let known = self.render_ms.iter().find(|(known, _)| *known == [first.rays, first.layers]);
        let Some(known_ms) = known.and_then(|(_, ms)| *ms) else { return Ok(false) };
        let now = frames(timed, first, false)?;
        Ok(now.is_some_and(|ms| median_of(ms, &mut Vec::new()) < LEAST_OF_KEPT * known_ms))
    }

    /// Whether these rays and layers have been measured.
    fn knows(&self, rays_layers: [u32; 2]) -> bool {
        self.render_ms.iter().any(|(known, _)| *known == rays_layers)
    }

    fn measure(
        &mut self,
        timed: &mut TimedStation<'_>,
        qualities: &[FrameQuality],
        own: FrameQuality,
    ) -> Result<(), RenderError> {
        let started = Instant::now();
        let late = || started.elapsed().as_secs_f64() > ENOUGH_S;
        let mut spreads = Vec::new();
        for generator in timed.generators.iter_mut() {
            let key = GeneratorKey::of(generator);
            // Generators left out here are measured at the next start.
            if self.run(&key).is_some() || late() {
                continue;
            }
            match runs(generator, timed.station, timed.frame_ms) {
                Ok(ms) => self.insert_run(&key, median_of(ms, &mut spreads)),
                Err(error) => {
                    tracing::warn!("generator {} does not run at this size and is left out: {error}", key.name)
                }
            }
        }
        let one_angle = |rays_layers| one_angle(qualities, rays_layers);
        if let Some(first) = qualities.first().map(|quality| one_angle([quality.rays, quality.layers])) {
            let aperture = first.aperture;
            let angles = qualities.iter().map(|quality| quality.angles).max().unwrap_or(1);
            let without = FrameQuality { aperture: false, ..first };
            let coarse = qualities.iter().any(|quality| quality.coarse);
            let compounded = FrameQuality { angles, ..first };
            // Least times, because the noise of so few frames would hide differences of medians.
            let mut ms = |quality, maps| Ok::<_, RenderError>(frames(timed, quality, maps)?.and_then(least));
            let alone = ms(first, false)?;
            let over = |more: Option<f64>| alone.zip(more).map(|(alone, more)| (more - alone).max(0.0));
            self.maps_ms = over(ms(first, true)?);
            self.angles_ms = if angles > 1 { over(ms(compounded, false)?) } else { Some(0.0) };
            let mut share = |applies: bool, of: FrameQuality| match applies {
                true => Ok::<_, RenderError>(alone.zip(ms(of, false)?).map(|(alone, ms)| (ms / alone).min(1.0))),
                false => Ok(Some(1.0)),
            };
            self.without_aperture = share(aperture, without)?;
            self.coarse = share(coarse, FrameQuality { coarse, ..first })?;
        }
        // Number of paths and time of the first quality far beyond the budget.
        let mut beyond: Option<(u32, f64)> = None;
        for rays_layers in qualities.iter().map(|quality| [quality.rays, quality.layers]) {
            let quality = one_angle(rays_layers);
            if self.knows(rays_layers) {
                continue;
            }
            let is_own = rays_layers == [own.rays, own.layers];
            let estimated = beyond.filter(|(paths, _)| quality.paths() >= *paths && !is_own);
            if let Some((paths, ms)) = estimated {
                self.insert(rays_layers, Some(ms * f64::from(quality.paths()) / f64::from(paths)));
                continue;
            }
            if late() && !is_own {
                continue;
            }
            let ms = frames(timed, quality, false)?.map(|ms| median_of(ms, &mut spreads));
            if let Some(ms) = ms.filter(|ms| *ms > BEYOND * timed.frame_ms && beyond.is_none()) {
                beyond = Some((quality.paths(), ms));
            }
            self.insert(rays_layers, ms);
        }
        // With so few values, the largest stands for the 95th percentile.
        if let Some(spread) = mean(spreads) {
            self.spread = spread;
        }
        self.spread = self.spread.max(1.0);
        Ok(())
    }

    pub(super) fn insert(&mut self, rays_layers: [u32; 2], ms: Option<f64>) {
        self.render_ms.push((rays_layers, ms));
    }

    pub(super) fn insert_run(&mut self, generator: &GeneratorKey, ms: f64) {
        self.run_ms.insert(generator.sha256.clone(), ms);
    }
}

/// Quality with these rays and layers and one angle. It has the effect `aperture` if any of `qualities` has it.
fn one_angle(qualities: &[FrameQuality], [rays, layers]: [u32; 2]) -> FrameQuality {
    FrameQuality { aperture: qualities.iter().any(|quality| quality.aperture), ..FrameQuality::new(rays, layers) }
}

/// Times of generator runs on frames of the station's size, ms. Only one run is timed if it takes far longer than a
/// frame may.
fn runs(generator: &mut Generator, station: &Station, frame_ms: f64) -> Result<Vec<f64>, GeneratorError> {
    let image = station.settings.image;
    let mut ms = |runs| {
        let times = generator.measure(image.width, image.height, runs)?;
        Ok::<_, GeneratorError>(times.iter().map(|time| 1e3 * time.as_secs_f64()).collect::<Vec<_>>())
    };
    let first = ms(1)?;
    if first.iter().all(|ms| *ms > BEYOND * frame_ms) { Ok(first) } else { ms(FRAMES) }
}

/// Times of frames of this quality, ms; `None` if the device lacks memory for them.
fn frames(timed: &mut TimedStation<'_>, quality: FrameQuality, maps: bool) -> Result<Option<Vec<f64>>, RenderError> {
    let Station { probe, settings, .. } = timed.station;
    let aperture = settings.effects.of(Effect::Aperture);
    let mut settings = quality.apply(settings, aperture);
    settings.maps = maps;
    match timed.renderer.reconfigure(probe, &settings) {
        Ok(()) => {}
        Err(RenderError::Backend(BackendError::Limit { .. } | BackendError::Memory { .. })) => return Ok(None),
        Err(error) => return Err(error),
    }
    let mut frame = Frame::default();
    let ms = measuring::timed(1, FRAMES, || {
        timed.renderer.submit(&timed.pose)?;
        timed.renderer.receive(&mut frame)?;
        Ok::<_, RenderError>(frame.times.total_ms)
    });
    Ok(Some(ms?))
}

/// Median of `ms`. Appends the ratio of the largest value to the median to `spreads`.
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

/// Cache file of the times. Its name depends on machine, build, settings, the largest number of angles, and whether any
/// quality has coarse samples.
fn path(timed: &TimedStation<'_>, qualities: &[FrameQuality]) -> PathBuf {
    let mut sum = Sha256::new();
    let Station { scene, probe, settings, background, motion, .. } = timed.station;
    let mut settings = *settings;
    // These settings don't belong to the name, because times are measured for all their values.
    settings.quality = Default::default();
    settings.look.angles = 1;
    settings.coarse_samples = false;
    let build =
        std::env::current_exe().and_then(|path| path.metadata()).and_then(|data| Ok((data.len(), data.modified()?)));
    let threads = std::thread::available_parallelism().map_or(1, usize::from);
    let device = if timed.renderer.on_host() { "host" } else { "device" };
    let generator = &timed.station.generator;
    let (provider, runs_on) = (&generator.provider, generator.threads);
    let precisions: Vec<_> = timed.generators.iter().map(Generator::precision).collect();
    let angles = qualities.iter().map(|quality| quality.angles).max().unwrap_or(1);
    let coarse = qualities.iter().any(|quality| quality.coarse);
    sum.update(format!("{} {threads} {device} {build:?} {}", processor_name(), env!("CARGO_PKG_VERSION")));
    sum.update(format!(
        "{scene:?} {probe:?} {settings:?} {background} {motion} {provider:?} {precisions:?} {runs_on:?} {angles} {coarse} {}",
        timed.frame_ms
    ));
    let name = format!("times-{}.json", files::hex(&sum.finalize()[..8]));
    files::cache_directory().join(name)
}

/// Ratio of times with coarse samples in tests.
#[cfg(test)]
const COARSE: f64 = 0.8;

#[cfg(test)]
impl Times {
    /// Sets the additional times of maps and of angles, and the time ratio without the effect `aperture`. Coarse samples
    /// take [`COARSE`] of the time.
    pub(super) fn insert_differences(&mut self, maps_ms: f64, angles_ms: f64, without_aperture: f64) {
        self.coarse = Some(COARSE);
        (self.maps_ms, self.angles_ms) = (Some(maps_ms), Some(angles_ms));
        self.without_aperture = Some(without_aperture);
    }
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
            coarse: Some(0.75),
            run_ms: [("ab".to_owned(), 30.0)].into(),
            spread: 1.2,
        };
        let again: Times = serde_json::from_str(&serde_json::to_string(&times).unwrap()).unwrap();
        assert_eq!(again, times);
        let of = |quality, maps| again.render(quality, maps);
        assert_eq!([of(FrameQuality::LQ, false), of(FrameQuality::LQ, true)], [Some(20.0), Some(24.0)]);
        let lean = FrameQuality { angles: 9, aperture: false, ..FrameQuality::LQ };
        assert_eq!(of(lean, true), Some(16.0));
        assert_eq!(of(FrameQuality { coarse: true, ..FrameQuality::LQ }, true), Some(19.0));
        assert_eq!([of(FrameQuality::new(32, 3), false), of(FrameQuality::new(2, 3), false)], [None, None]);
    }
}
