//! Measurement of the error table, from which live sessions choose an operating point.

use std::path::{Path, PathBuf};
use std::time::{Duration, Instant};

use super::convergence::References;
use super::error_table::{ErrorTable, GeneratorKey, PointError, StationErrors, kind_name, scene_name};
use super::harness::{Harness, LiveError};
use super::reference::Reference;
use super::step::part;
use super::store::{Store, identity};
use super::{MeasuringError, Progress, Step};
use crate::anatomy::Scene;
use crate::pose::{BySpeed, LIMITS, Pose, ProbeSpeed};
use crate::quality::SeenError;
use crate::render::{Backend, FrameQuality, Renderer};
use crate::station::{Poses, Station, Track};
use crate::statistics::mean;

/// Rays and layers of the table's operating points.
pub const RAYS_LAYERS: [(u32, u32); 7] = [(1, 1), (1, 3), (2, 3), (4, 3), (8, 3), (16, 3), (32, 3)];
/// Numbers of steering angles of the table's operating points, in rolling compounding.
pub const ANGLES: [u32; 3] = [1, 3, 9];
/// Largest number of paths of operating points that are also measured with coarse samples, and without the effect
/// `aperture`.
const PATHS_OF_CHEAP_POINTS: u32 = 3;
/// Words between a table's command and the commands of tables that it was merged with.
const OTHERS: &str = "; other stations: ";
/// Number of frames rendered before each measured one: the largest number of angles minus one.
const FRAMES_BEFORE: u32 = 8;
/// Poses at which the convergence of the reference is checked, one for each speed. References at other poses have as
/// many paths.
const CHECKED: usize = ProbeSpeed::ALL.len();

/// Extent of the measurement of a station's errors.
#[derive(Debug, Clone, PartialEq, Eq)]
pub struct ErrorSettings {
    /// Recording whose motion is used for stations without one.
    pub motion: PathBuf,
    /// Number of poses, a third of them at each speed.
    pub poses: usize,
    /// Rays and layers of the operating points, from [`RAYS_LAYERS`]; empty for all.
    pub points: Vec<(u32, u32)>,
    /// Numbers of steering angles, from [`ANGLES`]; empty for all.
    pub angles: Vec<u32>,
    /// Folder of stored results.
    pub folder: PathBuf,
    /// Whether stored results of an earlier run are used.
    pub resume: bool,
    /// Time after which no further point is measured.
    pub ends: Option<Instant>,
}

impl ErrorSettings {
    /// Number of poses at each speed.
    fn poses_of_speed(&self) -> usize {
        self.poses.max(1).div_ceil(ProbeSpeed::ALL.len())
    }

    /// Checks that the recordings hold poses at each speed of the probe; needs no scene.
    ///
    /// # Errors
    /// A station without a pose, recordings that cannot be read, or a speed at which the probe never moves.
    pub fn check(&self, station: &Station) -> Result<(), MeasuringError> {
        tracks(station, &self.motion, self.poses_of_speed()).map(drop)
    }
}

impl ErrorTable {
    /// A table of the stations in `measured`, made by `command`. Other stations of the table `others` follow, in their
    /// order.
    pub fn merged(command: String, measured: Vec<StationErrors>, others: Option<Self>) -> Self {
        let mut table = Self::new(command);
        if let Some(others) = others {
            // A command that was given before is named once.
            let before: Vec<&str> = others.command.split(OTHERS).filter(|before| *before != table.command).collect();
            table.command = std::iter::once(table.command.as_str()).chain(before).collect::<Vec<_>>().join(OTHERS);
            table.stations = others.stations;
        }
        table.merge(measured);
        table
    }

    /// Text of the table's file.
    ///
    /// # Errors
    /// Numbers that TOML cannot hold.
    pub fn to_toml(&self) -> Result<String, MeasuringError> {
        let text = toml::to_string(self).map_err(MeasuringError::Text)?;
        Ok(format!("# Errors of live frames, by `insonify front`. Docs: docs/commands.md.\n{text}"))
    }

    /// Replaces the stations that have the same name as a measured one, and appends the other measured stations.
    pub fn merge(&mut self, measured: Vec<StationErrors>) {
        for station in measured {
            match self.stations.iter_mut().find(|known| known.name == station.name) {
                Some(known) => *known = station,
                None => self.stations.push(station),
            }
        }
    }
}

/// `each` poses of a station at each speed of the probe, with the poses of the frames before each.
fn tracks(station: &Station, motion: &Path, each: usize) -> Result<Vec<(ProbeSpeed, Track)>, MeasuringError> {
    let hand = Poses::of_recording(motion, station)?;
    let period = Duration::from_secs_f64(1.0 / station.pipeline.frame_rate_hz);
    let own = Poses::of_station(station, None)?;
    let source = if own.moves() { station.path.as_path() } else { motion };
    let [slow, fast] = LIMITS;
    own.at_speeds(&hand, each, FRAMES_BEFORE, period).map_err(|speed| MeasuringError::NoMotion {
        path: source.to_owned(),
        speed: speed.name(),
        limits: format!(
            "slow: from {} mm/s or {} degrees/s; fast: from {} mm/s or {} degrees/s",
            slow.mm_s, slow.deg_s, fast.mm_s, fast.deg_s
        ),
    })
}

/// Measures the errors of a station's operating points against a converged reference, at each speed of the probe.
/// `scene` is the station's. `None` if [`ErrorSettings::ends`] passed before all points were measured; another call
/// with [`ErrorSettings::resume`] continues.
///
/// # Errors
/// A station without a pose, a recording without one of the speeds, frames that cannot be rendered or translated, or
/// results that are damaged or cannot be written.
pub fn measure_errors(
    backend: &Backend,
    station: &Station,
    scene: &Scene,
    settings: &ErrorSettings,
    progress: &Progress<'_>,
) -> Result<Option<StationErrors>, MeasuringError> {
    let each = settings.poses_of_speed();
    let tracks = tracks(station, &settings.motion, each)?;
    let renderer = Renderer::new(backend, scene, &station.probe, &station.settings)?;
    let mut harness = Harness::new(renderer, station, scene)?;
    let planned = planned(settings, &harness, station.probe.kind.steers());
    let is_over = || settings.ends.is_some_and(|ends| Instant::now() >= ends);
    let identity = [identity(station, scene), backend.to_string()];
    let store = |key: String| Store::new(&settings.folder, settings.resume, &[&identity[..], &[key]].concat());

    // One pose of each speed, then the others.
    let mut order: Vec<usize> = (0..tracks.len()).collect();
    order.sort_by_key(|&index| index % each);
    let mut first: Vec<Pose> = Vec::new();
    for at in order.iter().map(|&index| tracks[index].1.at) {
        if first.len() < CHECKED && !first.contains(&at) {
            first.push(at);
        }
    }
    let show = |found| progress(Step::Reference(found));
    let (references, _) = References::make(&mut harness, &store(format!("{first:?}"))?, &first, false, &show)?;
    progress(Step::Converged(&references.check));
    let check = references.check;
    let mut pictures: Vec<(Pose, Reference)> = first.into_iter().zip(references.pictures).collect();
    let show_frame = part(progress, "front");
    let mut found: Vec<(ProbeSpeed, Vec<[LiveError; 2]>)> = Vec::new();
    for (nth, &index) in order.iter().enumerate() {
        let (speed, track) = &tracks[index];
        let known = match pictures.iter().position(|(pose, _)| *pose == track.at) {
            Some(known) => known,
            None if is_over() => return Ok(None),
            None => {
                let reference =
                    References::of_pose(&mut harness, &store(format!("{:?}", track.at))?, track.at, &check)?;
                pictures.push((track.at, reference));
                pictures.len() - 1
            }
        };
        let store = store(format!("{track:?}"))?;
        let mut errors = Vec::with_capacity(planned.len());
        for (number, &planned_point) in planned.iter().enumerate() {
            show_frame(nth * planned.len() + number, tracks.len() * planned.len());
            match live_error(&mut harness, &store, planned_point, &pictures[known].1, track, &is_over)? {
                Some(error) => errors.push(error),
                None => return Ok(None),
            }
        }
        found.push((*speed, errors));
    }
    let of = |(number, &(quality, generator)): (usize, &(FrameQuality, Option<usize>))| {
        let key = generator.and_then(|index| harness.generator(index)).map(GeneratorKey::of);
        let errors: Vec<_> = found.iter().map(|(speed, errors)| (*speed, errors[number])).collect();
        let point = point(quality, key, &errors);
        progress(Step::Error(&point));
        point
    };
    Ok(Some(StationErrors {
        points: planned.iter().enumerate().map(of).collect(),
        name: station.path.file_name().map(|name| name.to_string_lossy().into_owned()).unwrap_or_default(),
        scene: scene_name(station),
        probe: kind_name(&station.probe.kind).to_owned(),
        frequency_mhz: station.probe.frequency_mhz,
        reference: check.to_string(),
        poses: tracks.len(),
        frame_rate_hz: Some(station.pipeline.frame_rate_hz),
    }))
}

/// Errors of a live frame with two seeds, from the store or measured. `None` if they are not stored
/// and `is_over` is true.
fn live_error(
    harness: &mut Harness,
    store: &Store,
    (quality, generator): (FrameQuality, Option<usize>),
    reference: &Reference,
    track: &Track,
    is_over: &dyn Fn() -> bool,
) -> Result<Option<[LiveError; 2]>, MeasuringError> {
    let key = generator.and_then(|index| harness.generator(index)).map(GeneratorKey::of);
    // The name differs from that of stored results with the pixels' error alone.
    let file = format!("seen {quality:?} {key:?}").replace(|c: char| !c.is_alphanumeric(), "_");
    match store.read::<[LiveError; 2]>(&file)? {
        Some(kept) => Ok(Some(kept)),
        None if is_over() => Ok(None),
        None => {
            let measured = harness.live_error(quality, generator, reference, track)?;
            store.write(&file, &measured)?;
            Ok(Some(measured))
        }
    }
}

/// An entry of the table, from the errors with two seeds at each pose.
fn point(
    quality: FrameQuality,
    generator: Option<GeneratorKey>,
    errors: &[(ProbeSpeed, [LiveError; 2])],
) -> PointError {
    let rounded = |value: f64| (1e3 * value).round() / 1e3;
    let by_seed = |of: Option<ProbeSpeed>, value: fn(&LiveError) -> f64| {
        let some = || errors.iter().filter(|(speed, _)| of.is_none_or(|of| of == *speed));
        [0, 1].map(|seed| mean(some().map(|(_, errors)| value(&errors[seed]))).unwrap_or(f64::NAN))
    };
    let middle = |of: Option<ProbeSpeed>, value: fn(&LiveError) -> f64| {
        let [first, second] = by_seed(of, value);
        rounded(0.5 * (first + second))
    };
    let by_speed = |value: fn(&LiveError) -> f64| BySpeed::new(ProbeSpeed::ALL.map(|speed| middle(Some(speed), value)));
    let [first, second] = by_seed(None, |e| e.rmse);
    PointError {
        quality,
        generator,
        rmse: middle(None, |e| e.rmse),
        spread: rounded((first - second).abs()),
        seen: Some(SeenError {
            whole: middle(None, |e| e.seen.whole),
            levels: middle(None, |e| e.seen.levels),
            texture: middle(None, |e| e.seen.texture),
        }),
        by_speed: Some(by_speed(|e| e.seen.whole)),
        rmse_by_speed: Some(by_speed(|e| e.rmse)),
    }
}

/// Operating points to measure: qualities of raw frames, then generators with the frame qualities that they take.
/// `steers` tells whether the probe can steer.
fn planned(settings: &ErrorSettings, harness: &Harness, steers: bool) -> Vec<(FrameQuality, Option<usize>)> {
    let ErrorSettings { points, angles: chosen, .. } = settings;
    let wanted = |quality: &FrameQuality| {
        let points = points.is_empty() || points.contains(&(quality.rays, quality.layers));
        points && (chosen.is_empty() || chosen.contains(&quality.angles))
    };
    let angles = ANGLES.into_iter().filter(|&angles| steers || angles == 1);
    let with = angles.flat_map(|angles| {
        RAYS_LAYERS.map(move |(rays, layers)| FrameQuality { angles, ..FrameQuality::new(rays, layers) })
    });
    let with: Vec<FrameQuality> = with.filter(wanted).collect();
    let few = with.iter().filter(|quality| quality.paths() <= PATHS_OF_CHEAP_POINTS);
    let (by_aperture, by_samples) = (harness.base().aperture, harness.takes_coarse_samples());
    let cheaper = |quality: &FrameQuality| {
        [(true, true), (false, false), (true, false)]
            .map(|(coarse, aperture)| FrameQuality { coarse, aperture, ..*quality })
            .into_iter()
            .filter(move |cheap| (by_samples || !cheap.coarse) && (by_aperture || cheap.aperture))
    };
    let cheap: Vec<FrameQuality> = few.flat_map(cheaper).collect();
    let raw = with.into_iter().chain(cheap).map(|quality| (quality, None));
    let generated = harness.generated_points().into_iter().filter(|(lq, _)| wanted(lq));
    raw.chain(generated.map(|(lq, index)| (lq, Some(index)))).collect()
}

#[cfg(test)]
mod tests {
    use super::*;

    #[test]
    fn a_point_has_the_mean_of_each_speed_and_of_all() {
        use ProbeSpeed::{AtRest, Fast, Slow};
        let of = |rmse: f64| {
            let (levels, texture) = (0.3 * rmse, 0.4 * rmse);
            LiveError { rmse, seen: SeenError { whole: 0.5 * rmse, levels, texture } }
        };
        let errors = [(AtRest, [10.0, 12.0]), (AtRest, [14.0, 16.0]), (Slow, [20.0, 21.0]), (Fast, [30.0, 30.0])];
        let found = point(FrameQuality::LQ, None, &errors.map(|(speed, errors)| (speed, errors.map(of))));
        assert_eq!(found.rmse_by_speed, Some(BySpeed::new([13.0, 20.5, 30.0])));
        assert_eq!(found.by_speed, Some(BySpeed::new([6.5, 10.25, 15.0])));
        assert_eq!((found.rmse, found.spread), (19.125, 1.25));
        assert_eq!(found.seen, Some(SeenError { whole: 9.563, levels: 5.738, texture: 7.65 }));
    }

    #[test]
    fn other_stations_of_a_merged_table_stay() {
        let station = |name: &str, poses| StationErrors {
            name: name.into(),
            poses,
            ..StationErrors::fixture("", "convex", Vec::new())
        };
        let old = ErrorTable { stations: vec![station("a", 3), station("b", 3)], ..ErrorTable::new("old".into()) };
        let new = ErrorTable::merged("new".into(), vec![station("b", 12), station("c", 12)], Some(old));
        let poses: Vec<(&str, usize)> = new.stations.iter().map(|s| (s.name.as_str(), s.poses)).collect();
        assert_eq!(poses, [("a", 3), ("b", 12), ("c", 12)]);
        assert_eq!(new.command, "new; other stations: old");
        let again = ErrorTable::merged("old".into(), Vec::new(), Some(new));
        assert_eq!(again.command, "old; other stations: new");
    }
}
