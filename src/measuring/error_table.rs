//! Table of picture errors of operating points (a frame quality, with or without a generator). Frames of the shipped
//! stations are compared with their converged, compounded references.
//!
//! The table holds no times, so it is the same for all machines. `insonify front` makes it.

use std::fmt;
use std::sync::OnceLock;

use serde::{Deserialize, Serialize};
use thiserror::Error;

use crate::generator::Generator;
use crate::pose::{BySpeed, ProbeSpeed};
use crate::quality::SeenError;
use crate::render::FrameQuality;
use crate::station::{SceneSource, Station};
use crate::statistics::mean;
use crate::transducer::{Probe, ProbeKind};

/// Version of the table's layout. The first layout had no errors by speed, the second no seen errors.
const FORMAT: u32 = 3;
const FORMAT_WITHOUT_SPEEDS: u32 = 1;

/// Text of the shipped table.
const SHIPPED: &str = include_str!("../../assets/quality/front.toml");

/// Errors in reading a table.
#[derive(Debug, Error, Clone, PartialEq, Eq)]
pub enum ErrorTableError {
    /// Text that is not TOML, or has another layout.
    #[error("the table of errors is damaged: {0}")]
    Parse(String),
    /// A table whose format this program does not know.
    #[error("the table of errors has format {found}; this program reads up to {FORMAT}")]
    Format {
        /// Format of the table.
        found: u32,
    },
}

/// Errors of operating points, by station.
#[derive(Debug, Clone, PartialEq, Serialize, Deserialize)]
#[serde(deny_unknown_fields)]
pub struct ErrorTable {
    /// Version of the layout.
    pub format: u32,
    /// Version of insonify that made the table.
    pub insonify: String,
    /// Command that made the table.
    pub command: String,
    /// Errors of each station.
    #[serde(rename = "station")]
    pub stations: Vec<StationErrors>,
}

/// Errors of a station's frames.
#[derive(Debug, Clone, PartialEq, Serialize, Deserialize)]
#[serde(deny_unknown_fields)]
pub struct StationErrors {
    /// Name of the station's file.
    pub name: String,
    /// Name of the scene.
    pub scene: String,
    /// Kind of the probe: convex, linear or phased.
    pub probe: String,
    /// Centre frequency, MHz.
    pub frequency_mhz: f64,
    /// Description of the reference, with its convergence.
    pub reference: String,
    /// Number of poses over which errors are averaged.
    pub poses: usize,
    /// Frames per second of rolling compounding; `None` in a table without speeds.
    #[serde(default, skip_serializing_if = "Option::is_none")]
    pub frame_rate_hz: Option<f64>,
    /// Operating points. Raw frames come first, then generators.
    #[serde(rename = "point")]
    pub points: Vec<PointError>,
}

impl StationErrors {
    /// Number that the station's points are compared by: the seen error if all of them have it.
    fn measure(&self) -> ErrorMeasure {
        let all = !self.points.is_empty() && self.points.iter().all(|point| point.measure() == ErrorMeasure::Seen);
        if all { ErrorMeasure::Seen } else { ErrorMeasure::Pixels }
    }

    fn error(
        &self,
        measure: ErrorMeasure,
        quality: FrameQuality,
        generator: Option<&GeneratorKey>,
        speed: ProbeSpeed,
    ) -> Option<f64> {
        let exact = self.points.iter().find(|p| p.quality == quality && p.generator.as_ref() == generator);
        let point = exact.or_else(|| self.nearest_angles(quality).filter(|_| generator.is_none()))?;
        point.error(measure, speed)
    }

    /// The raw point that differs from `quality` at most in its number of angles, and has the nearest number by ratio.
    fn nearest_angles(&self, quality: FrameQuality) -> Option<&PointError> {
        let alike =
            |p: &&PointError| p.generator.is_none() && FrameQuality { angles: quality.angles, ..p.quality } == quality;
        let ratio = |p: &PointError| (f64::from(p.quality.angles) / f64::from(quality.angles.max(1))).ln().abs();
        self.points.iter().filter(alike).min_by(|a, b| ratio(a).total_cmp(&ratio(b)))
    }
}

/// Error of an operating point.
#[derive(Debug, Clone, PartialEq, Serialize, Deserialize)]
#[serde(deny_unknown_fields)]
pub struct PointError {
    /// Quality of the raw frame.
    pub quality: FrameQuality,
    /// Generator applied to the frame; `None` for the raw frame.
    #[serde(default, skip_serializing_if = "Option::is_none")]
    pub generator: Option<GeneratorKey>,
    /// RMS difference of pixels from the reference inside the sector, mean over poses, grey levels.
    pub rmse: f64,
    /// Difference of `rmse` between two seeds, grey levels.
    pub spread: f64,
    /// Error that an eye sees, mean over poses, grey levels. `None` in a table without seen errors.
    #[serde(default, skip_serializing_if = "Option::is_none")]
    pub seen: Option<SeenError>,
    /// Error by speed of the probe, grey levels: the whole of `seen` if there is one, else the pixels'. `None` in a
    /// table without speeds; then the mean holds at every speed.
    #[serde(default, skip_serializing_if = "Option::is_none")]
    pub by_speed: Option<BySpeed>,
    /// RMS difference of pixels by speed of the probe, grey levels, of a point with `seen`.
    #[serde(default, skip_serializing_if = "Option::is_none")]
    pub rmse_by_speed: Option<BySpeed>,
}

/// Number that operating points are compared by.
#[derive(Debug, Clone, Copy, PartialEq, Eq)]
pub enum ErrorMeasure {
    /// Whole of the [`SeenError`].
    Seen,
    /// RMS difference of pixels.
    Pixels,
}

impl fmt::Display for ErrorMeasure {
    fn fmt(&self, f: &mut fmt::Formatter<'_>) -> fmt::Result {
        f.write_str(match self {
            Self::Seen => "seen error",
            Self::Pixels => "pixel error",
        })
    }
}

impl PointError {
    /// Number that [`Self::at`] gives: the seen error if the point has it.
    pub fn measure(&self) -> ErrorMeasure {
        if self.seen.is_some() { ErrorMeasure::Seen } else { ErrorMeasure::Pixels }
    }

    /// Error at a probe speed, in the point's own measure, grey levels.
    pub fn at(&self, speed: ProbeSpeed) -> f64 {
        let all = self.seen.map_or(self.rmse, |seen| seen.whole);
        self.by_speed.map_or(all, |by_speed| by_speed.at(speed))
    }

    /// Error at a probe speed in `measure`, grey levels; `None` if the point lacks it.
    pub fn error(&self, measure: ErrorMeasure, speed: ProbeSpeed) -> Option<f64> {
        match (measure, self.measure()) {
            (ErrorMeasure::Seen, ErrorMeasure::Pixels) => None,
            (ErrorMeasure::Pixels, ErrorMeasure::Seen) => Some(self.rmse_by_speed.map_or(self.rmse, |by| by.at(speed))),
            (ErrorMeasure::Seen, ErrorMeasure::Seen) | (ErrorMeasure::Pixels, ErrorMeasure::Pixels) => {
                Some(self.at(speed))
            }
        }
    }
}

/// Identity of a generator.
#[derive(Debug, Clone, PartialEq, Eq, Serialize, Deserialize)]
#[serde(deny_unknown_fields)]
pub struct GeneratorKey {
    /// Name of the generator.
    pub name: String,
    /// SHA-256 of the generator's model file.
    pub sha256: String,
}

impl GeneratorKey {
    /// Identity of a loaded generator.
    pub fn of(generator: &Generator) -> Self {
        let manifest = generator.manifest();
        Self { name: manifest.name.clone(), sha256: manifest.sha256.clone() }
    }
}

impl fmt::Display for PointError {
    /// Writes quality and generator, and the errors if they are known by speed.
    fn fmt(&self, f: &mut fmt::Formatter<'_>) -> fmt::Result {
        write!(f, "{}", self.quality)?;
        if let Some(GeneratorKey { name, .. }) = &self.generator {
            write!(f, " + {name}")?;
        }
        let Some(BySpeed { at_rest, slow, fast }) = self.by_speed else { return Ok(()) };
        write!(f, ": {} {at_rest:.1} grey levels at rest, {slow:.1} slow, {fast:.1} fast", self.measure())?;
        match self.seen {
            Some(SeenError { levels, texture, .. }) => {
                write!(f, " (mean: levels {levels:.1}, texture {texture:.1}; pixels {:.1})", self.rmse)
            }
            None => Ok(()),
        }
    }
}

impl ErrorTable {
    /// The shipped table.
    ///
    /// # Errors
    /// The table can't be read: a fault of the build.
    pub fn shipped() -> Result<&'static Self, ErrorTableError> {
        static TABLE: OnceLock<Result<ErrorTable, ErrorTableError>> = OnceLock::new();
        TABLE.get_or_init(|| ErrorTable::parse(SHIPPED)).as_ref().map_err(Clone::clone)
    }

    /// Reads a table from TOML.
    ///
    /// # Errors
    /// Text that is no table, or a table of another format.
    pub fn parse(text: &str) -> Result<Self, ErrorTableError> {
        let table: Self = toml::from_str(text).map_err(|e| ErrorTableError::Parse(e.to_string().trim().to_owned()))?;
        match table.format {
            FORMAT_WITHOUT_SPEEDS..=FORMAT => Ok(table),
            found => Err(ErrorTableError::Format { found }),
        }
    }

    /// An empty table, made by `command`.
    pub fn new(command: String) -> Self {
        Self { format: FORMAT, insonify: env!("CARGO_PKG_VERSION").to_owned(), command, stations: Vec::new() }
    }

    /// Expected errors of a station. They come from the same scene and kind of probe, at the nearest frequency. Without
    /// such a station they are means over all stations with that kind of probe, else over all stations. If some of these
    /// have seen errors, the mean is over them alone.
    pub fn expected(&self, scene: &str, probe: &Probe) -> ExpectedErrors<'_> {
        let kind = kind_name(&probe.kind);
        let of_kind = |station: &&StationErrors| station.probe == kind;
        let distance = |station: &StationErrors| (station.frequency_mhz - probe.frequency_mhz).abs();
        let same = self.stations.iter().filter(|station| station.scene == scene).filter(of_kind);
        if let Some(nearest) = same.min_by(|a, b| distance(a).total_cmp(&distance(b))) {
            let measure = nearest.measure();
            return ExpectedErrors { stations: vec![nearest], all: &self.stations, measure, measured: true };
        }
        let alike: Vec<&StationErrors> = self.stations.iter().filter(of_kind).collect();
        let mut stations = if alike.is_empty() { self.stations.iter().collect() } else { alike };
        let seen = |station: &&StationErrors| station.measure() == ErrorMeasure::Seen;
        let measure = if stations.iter().any(seen) { ErrorMeasure::Seen } else { ErrorMeasure::Pixels };
        stations.retain(|station| station.measure() == measure);
        ExpectedErrors { stations, all: &self.stations, measure, measured: false }
    }
}

/// Name of a station's scene in the table of errors.
pub fn scene_name(station: &Station) -> String {
    match &station.scene {
        SceneSource::ObstetricPhantom(_) => "obstetric".to_owned(),
        SceneSource::File(path) => path.file_stem().map(|s| s.to_string_lossy().into_owned()).unwrap_or_default(),
    }
}

/// Name of a kind of probe.
pub(super) fn kind_name(kind: &ProbeKind) -> &'static str {
    match kind {
        ProbeKind::Convex { .. } => "convex",
        ProbeKind::Linear { .. } => "linear",
        ProbeKind::Phased { .. } => "phased",
    }
}

/// Expected errors of a station's operating points.
#[derive(Debug, Clone)]
pub struct ExpectedErrors<'a> {
    stations: Vec<&'a StationErrors>,
    /// All stations of the table. Generators are measured only at stations that name them.
    all: &'a [StationErrors],
    /// Number that the errors are. All of them are of one kind, so that they can be compared.
    pub measure: ErrorMeasure,
    /// Whether the errors are of the station's own scene and kind of probe.
    pub measured: bool,
}

impl ExpectedErrors<'_> {
    /// Qualities of raw frames with known errors, by increasing number of paths.
    pub fn qualities(&self) -> Vec<FrameQuality> {
        let mut known: Vec<FrameQuality> = Vec::new();
        for point in self.stations.iter().flat_map(|station| &station.points) {
            if point.generator.is_none() && !known.contains(&point.quality) {
                known.push(point.quality);
            }
        }
        known.retain(|quality| self.by_speed(*quality, None).is_some());
        known.sort_by_key(|quality| (quality.paths(), quality.layers, quality.angles));
        known
    }

    /// Errors of an operating point by speed of the probe; `None` if one is unknown, as in [`Self::of`].
    pub fn by_speed(&self, quality: FrameQuality, generator: Option<&GeneratorKey>) -> Option<BySpeed> {
        BySpeed::from_classes(|speed| self.of(quality, generator, speed))
    }

    /// Error of an operating point at a probe speed, grey levels: the mean over the chosen stations. `None` if the
    /// error is unknown at one of them.
    ///
    /// A number of angles missing in the table has the error of the nearest number. If a generator was not measured at
    /// these stations, its error is estimated. The raw frame's error is multiplied by the mean ratio of generated to
    /// raw errors at other stations.
    pub fn of(&self, quality: FrameQuality, generator: Option<&GeneratorKey>, speed: ProbeSpeed) -> Option<f64> {
        let mean_of = |generator: Option<&GeneratorKey>| {
            let error = |station: &&StationErrors| station.error(self.measure, quality, generator, speed);
            let errors: Option<Vec<f64>> = self.stations.iter().map(error).collect();
            mean(errors?)
        };
        let Some(key) = generator else { return mean_of(None) };
        let elsewhere = || {
            let ratio = |station: &StationErrors| {
                let error = |generator| station.error(self.measure, quality, generator, speed);
                Some(error(Some(key))? / error(None).filter(|raw| *raw > 0.0)?)
            };
            Some(mean(self.all.iter().filter_map(ratio))? * mean_of(None)?)
        };
        mean_of(Some(key)).or_else(elsewhere)
    }
}

#[cfg(test)]
impl StationErrors {
    /// Errors of a station with a probe of 8 MHz.
    pub(crate) fn fixture(scene: &str, probe: &str, points: Vec<PointError>) -> Self {
        Self {
            name: format!("{scene}.toml"),
            scene: scene.into(),
            probe: probe.into(),
            frequency_mhz: 8.0,
            reference: "128x3 of 9 angles".into(),
            poses: 3,
            frame_rate_hz: None,
            points,
        }
    }
}

#[cfg(test)]
impl PointError {
    /// A point with an error of pixels alone.
    pub(crate) fn fixture(quality: FrameQuality, generator: Option<GeneratorKey>, rmse: f64) -> Self {
        Self { quality, generator, rmse, spread: 0.25, seen: None, by_speed: None, rmse_by_speed: None }
    }

    /// A point with a seen error too, of equal parts.
    pub(crate) fn with_seen(self, whole: f64) -> Self {
        let part = whole * 0.5f64.sqrt();
        Self { seen: Some(SeenError { whole, levels: part, texture: part }), ..self }
    }
}

#[cfg(test)]
mod tests {
    use super::*;

    fn point(rays: u32, layers: u32, generator: Option<&str>, rmse: f64) -> PointError {
        let generator = generator.map(|name| GeneratorKey { name: name.into(), sha256: "ab".into() });
        PointError::fixture(FrameQuality::new(rays, layers), generator, rmse)
    }

    fn station(scene: &str, probe: &str, frequency_mhz: f64, points: Vec<PointError>) -> StationErrors {
        StationErrors { frequency_mhz, ..StationErrors::fixture(scene, probe, points) }
    }

    fn table() -> ErrorTable {
        let stations = vec![
            station("fetus", "convex", 8.0, vec![point(1, 1, None, 20.0), point(1, 1, Some("fast"), 10.0)]),
            station("fetus", "convex", 4.0, vec![point(1, 1, None, 22.0), point(2, 3, None, 12.0)]),
            station("lung", "linear", 8.0, vec![point(1, 1, None, 30.0), point(2, 3, None, 14.0)]),
        ];
        ErrorTable { stations, ..ErrorTable::new("insonify front".into()) }
    }

    #[test]
    fn a_table_comes_back_as_it_was_written() {
        let text = toml::to_string(&table()).unwrap();
        assert_eq!(ErrorTable::parse(&text).unwrap(), table());
        let other = text.replace("format = 3", "format = 4");
        assert_eq!(ErrorTable::parse(&other), Err(ErrorTableError::Format { found: 4 }));
        let error = ErrorTable::parse(&text.replace("rmse", "rms")).unwrap_err().to_string();
        assert!(error.contains("unknown field `rms`"), "{error}");
    }

    #[test]
    fn a_table_without_speeds_has_one_error_for_all_of_them() {
        let old = toml::to_string(&table()).unwrap().replace("format = 3", "format = 1");
        assert!(!old.contains("speed") && !old.contains("frame_rate"), "{old}");
        let probe = Probe { frequency_mhz: 8.0, ..Probe::default() };
        let by_speed = |table: &ErrorTable| table.expected("fetus", &probe).by_speed(FrameQuality::LQ, None);
        assert_eq!(by_speed(&ErrorTable::parse(&old).unwrap()), Some(BySpeed::all(20.0)));
        let mut new = table();
        let moving = BySpeed::new([18.0, 20.0, 22.0]);
        new.stations[0].points[0].by_speed = Some(moving);
        let again = ErrorTable::parse(&toml::to_string(&new).unwrap()).unwrap();
        assert_eq!((by_speed(&again), &again), (Some(moving), &new));
    }

    #[test]
    fn seen_errors_count_where_a_station_has_them() {
        use ErrorMeasure::{Pixels, Seen};
        let [rest, fast] = [ProbeSpeed::AtRest, ProbeSpeed::Fast];
        let mut new = table();
        // Smoothing: the generator halves the pixels' error, and doubles the seen one.
        new.stations[0].points =
            vec![point(1, 1, None, 20.0).with_seen(5.0), point(1, 1, Some("fast"), 10.0).with_seen(10.0)];
        let raw = &mut new.stations[0].points[0];
        raw.by_speed = Some(BySpeed::new([4.0, 5.0, 6.0]));
        raw.rmse_by_speed = Some(BySpeed::new([16.0, 20.0, 22.0]));
        assert_eq!([raw.at(rest), raw.at(fast)], [4.0, 6.0]);
        assert_eq!([raw.error(Pixels, fast), raw.error(Seen, fast)], [Some(22.0), Some(6.0)]);
        assert!(raw.to_string().contains("seen error 4.0 grey levels at rest, 5.0 slow, 6.0 fast"), "{raw}");
        let text = toml::to_string(&new).unwrap();
        assert!(text.contains("[station.point.seen]\nwhole = 5.0\n"), "{text}");
        let new = ErrorTable::parse(&text).unwrap();
        let key = new.stations[0].points[1].generator.as_ref();
        let probe = |frequency_mhz, kind| Probe { frequency_mhz, kind, ..Probe::default() };
        let convex = |frequency_mhz| probe(frequency_mhz, Probe::default().kind);
        let of = |scene: &str, probe: &Probe| {
            let expected = new.expected(scene, probe);
            let [raw, generated] = [None, key].map(|key| expected.of(FrameQuality::LQ, key, rest).unwrap());
            (expected.measure, raw, generated)
        };
        assert_eq!(of("fetus", &convex(8.0)), (Seen, 4.0, 10.0));
        // A station without seen errors goes by its pixels, and estimates the generator from pixels.
        assert_eq!(of("fetus", &convex(4.0)), (Pixels, 22.0, 13.75));
        // The mean of unknown scenes is over the stations with seen errors, if there are any of the probe's kind.
        assert_eq!(of("liver", &convex(8.0)), (Seen, 4.0, 10.0));
        let linear = probe(8.0, ProbeKind::Linear { width_mm: 40.0 });
        assert_eq!(of("liver", &linear), (Pixels, 30.0, 18.75));
    }

    #[test]
    fn a_station_finds_its_own_scene_and_the_nearest_probe() {
        let table = table();
        let probe = |frequency_mhz| Probe { frequency_mhz, ..Probe::default() };
        let lq = FrameQuality::LQ;
        let of = |errors: &ExpectedErrors<'_>, key: Option<&GeneratorKey>| errors.of(lq, key, ProbeSpeed::AtRest);
        let fast = GeneratorKey { name: "fast".into(), sha256: "ab".into() };
        let near = table.expected("fetus", &probe(7.0));
        assert_eq!((near.measured, of(&near, None), of(&near, Some(&fast))), (true, Some(20.0), Some(10.0)));
        let trained_anew = GeneratorKey { sha256: "cd".into(), ..fast.clone() };
        assert_eq!(of(&near, Some(&trained_anew)), None);
        assert_eq!(of(&table.expected("fetus", &probe(5.0)), None), Some(22.0));
        // For another scene, errors are means over stations with its kind of probe, for points that all of them have.
        // The generator halves the error there.
        let other = table.expected("liver", &probe(4.0));
        assert_eq!((other.measured, of(&other, None), of(&other, Some(&fast))), (false, Some(21.0), Some(10.5)));
        assert_eq!(other.qualities(), [lq]);
        let phased = Probe { kind: ProbeKind::Phased { fov_deg: 90.0 }, ..Probe::default() };
        assert_eq!(of(&table.expected("lung", &phased), None), Some(24.0));
        assert_eq!(table.expected("fetus", &probe(4.0)).qualities(), [lq, FrameQuality::new(2, 3)]);
    }

    #[test]
    fn the_shipped_table_is_sound() {
        let table = ErrorTable::shipped().unwrap();
        assert!(table.command.starts_with("insonify front "), "{}", table.command);
        for station in &table.stations {
            assert!(station.points.iter().all(|p| p.rmse.is_finite() && p.rmse > 0.0), "{}", station.name);
            let plain = |p: &&PointError| p.generator.is_none() && p.quality.aperture;
            let of =
                |quality: FrameQuality| station.points.iter().filter(plain).find(|p| p.quality == quality).unwrap();
            // With one angle, the error may be speckle alone, which rays don't change.
            let angles = station.points.iter().filter(plain).map(|p| p.quality.angles).max().unwrap();
            let averaged = station.points.iter().filter(plain).filter(|p| p.quality.angles == angles);
            let most = averaged.max_by_key(|p| p.quality.paths()).unwrap();
            let least = of(FrameQuality { angles, ..FrameQuality::new(1, 1) });
            let [most, least] = [most, least].map(|point| point.at(ProbeSpeed::AtRest));
            assert!(most < least, "{}: {most} and {least} grey levels", station.name);
            for key in station.points.iter().filter_map(|point| point.generator.as_ref()) {
                let path = format!("{}/assets/generators/{1}/{1}.toml", env!("CARGO_MANIFEST_DIR"), key.name);
                let manifest = std::fs::read_to_string(&path).unwrap();
                assert!(manifest.contains(&key.sha256), "{path}: another model than the table's");
            }
            for point in &station.points {
                let at = ProbeSpeed::ALL.map(|speed| point.at(speed));
                assert!(at.iter().all(|error| error.is_finite() && *error > 0.0), "{}: {point:?}", station.name);
            }
            let least = station.points.iter().map(|p| p.rmse).fold(f64::INFINITY, f64::min);
            assert!(least < 0.9 * of(FrameQuality::new(1, 1)).rmse, "{}", station.name);
        }
    }
}
