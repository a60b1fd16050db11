//! Station files: a strict TOML file becomes a validated [`Station`].
//!
//! Only `[scene]` is required; everything else defaults to the paper's parameters. [`keys`] lists every key with its
//! unit, default and range. An unknown key, a wrong type, a value outside its range, or a key that does not apply to
//! the probe's kind is an error. It names the key and the accepted values.

mod accepts;
mod browser;
mod calibration;
mod display;
mod effects;
mod error;
mod examination;
mod exercise;
mod generator;
mod keys;
mod needle_table;
mod openigtlink;
mod parse;
mod plane_scene;
mod poses;
mod quality;
mod renamed;
mod scene;
mod scene_file;
mod scene_identity;
mod setup_check;
#[cfg(test)]
mod tests;
mod tracker_table;
mod values;

use std::path::{Path, PathBuf};

use crate::anatomy::doctor::{WrongSize, wrong_size};
use crate::anatomy::import::{self, FindingKind};
use crate::anatomy::planes::{self, StandardPlanes};
use crate::anatomy::{Axes, Motion, Scene, SceneError, TissueTable};
use crate::exam::needle::Exercise;
use crate::files::{self, FileError, FileKind};
use crate::generator::generator_files;
use crate::needle::Needle;
use crate::phantom::{self, PhantomOptions};
use crate::pose::{self, Calibration, CalibrationSource, FilterSettings, Fitted, Pose};
use crate::render::BackendChoice;
use crate::settings::{PipelineSettings, Probe, RenderSettings};
use crate::sink::LiveSinkKind;
use crate::sink::openigtlink as openigtlink_sink;
use crate::sink::{browser as browser_sink, window as window_sink};
use crate::tracker;

pub use accepts::Accepts;
pub use error::StationError;
pub use examination::Examination;
pub use keys::{KeyDoc, keys, print_keys};
pub use plane_scene::PlaneScene;
pub use poses::{Poses, Track};
pub use renamed::RenamedKey;
pub use scene_file::SceneFile;
pub use scene_identity::{SceneIdentity, other_scene};
pub use setup_check::{SetupFinding, check_setup, missing_calibration};

/// Source of a station's surfaces.
#[derive(Debug, Clone, PartialEq)]
pub enum SceneSource {
    /// A `.glb` or `.gltf` file.
    File(PathBuf),
    /// The generated obstetric phantom.
    ObstetricPhantom(PhantomOptions),
}

/// Settings of a tracked needle's estimator.
#[derive(Debug, Clone, PartialEq)]
pub struct NeedleTracking {
    /// Settings with the needle's mounting in place of the probe's.
    pub settings: pose::Settings,
    /// Whether the sensor's mounting says to which side the bevel faces.
    pub bevel_known: bool,
}

/// A station: scene, probe, image settings, tracker, generators and outputs.
#[derive(Debug, Clone, PartialEq)]
pub struct Station {
    /// Source of the surfaces.
    pub scene: SceneSource,
    /// Name in `tissues` of the tissue outside all surfaces.
    pub background: String,
    /// Whether the scene's motion is simulated.
    pub motion: bool,
    /// The probe.
    pub probe: Probe,
    /// Settings of image and quality.
    pub settings: RenderSettings,
    /// Rendering backend, unless a flag or the environment overrides it.
    pub backend: BackendChoice,
    /// Time budget to render and generate a frame, ms. A live session chooses rays, layers, angles, samples and
    /// generator by it; a still image only rays and layers. `None`: all stay as set.
    pub frame_budget_ms: Option<f64>,
    /// Whether the budget also chooses the angles of compounding, because `[look]` has neither angles nor a preset.
    pub angles_open: bool,
    /// Generators.
    pub generator: crate::generator::Settings,
    /// Built-in tissues with the station's changes and additions.
    pub tissues: TissueTable,
    /// Probe pose from `[pose]`, if the station has one.
    pub default_pose: Option<Pose>,
    /// Filtering, prediction and staleness of live tracker poses.
    pub filter: FilterSettings,
    /// Source of the calibration of tracker, sensor and probe. Parsing does not open its file.
    pub calibration: CalibrationSource,
    /// Source of live poses. Its device options have the needle's sensor.
    pub tracker: tracker::Settings,
    /// Pose `scene_from_needle` of a needle that no tracker moves, from `[needle]`.
    pub needle_pose: Option<Pose>,
    /// OpenIGTLink server, if the station has one.
    pub openigtlink: Option<openigtlink_sink::Settings>,
    /// Browser page, if the station has one.
    pub browser: Option<browser_sink::Settings>,
    /// Native window, if the station has one.
    pub window: Option<window_sink::Settings>,
    /// Frame rate, deadline and picture choice of a live session.
    pub pipeline: PipelineSettings,
    /// Exercise with a needle, if the station has one.
    pub exercise: Option<Exercise>,
    /// Sinks of a live session.
    pub sinks: Vec<LiveSinkKind>,
    /// Keys in the file that have another name today. [`Station::load`] logs a hint for each.
    pub renamed_keys: Vec<RenamedKey>,
    /// Path of the station file; for a station parsed from text, the directory at which relative paths start.
    pub path: PathBuf,
}

impl Station {
    /// Reads the station file at `path`.
    ///
    /// # Errors
    /// The file cannot be read, or an error of [`Station::parse`]. Each error names the file.
    pub fn load(path: &Path) -> Result<Self, StationError> {
        let text = files::read_text(path, FileKind::Station).map_err(FileError::at("read the station file", path))?;
        let dir = path.parent().unwrap_or(Path::new(""));
        let station = Self::parse(&text, dir)
            .map_err(|source| StationError::InFile { path: path.to_owned(), source: Box::new(source) })?;
        for key in &station.renamed_keys {
            tracing::warn!("{}: {key}", path.display());
        }
        Ok(Self { path: path.to_owned(), ..station })
    }

    /// Parses the text of a station file. Relative paths start at `dir`. The scene's file is not opened.
    ///
    /// # Errors
    /// The text is not TOML; a key is unknown, missing, misplaced or of the wrong type; a value is outside its range;
    /// or the background tissue is unknown.
    pub fn parse(text: &str, dir: &Path) -> Result<Self, StationError> {
        parse::station(text, dir)
    }

    /// Path of the scene file; none for a generated phantom.
    pub fn scene_file(&self) -> Option<&Path> {
        match &self.scene {
            SceneSource::File(path) => Some(path),
            SceneSource::ObstetricPhantom(_) => None,
        }
    }

    /// Directions of the axes of `scene`, which must be the station's scene.
    pub fn axes(&self, scene: &Scene) -> Axes {
        match self.scene {
            SceneSource::ObstetricPhantom(_) => Axes::Anatomical,
            SceneSource::File(_) => scene.axes,
        }
    }

    /// Sinks of the station's live session: those in `display.sinks`, and every display that has a table.
    pub fn live_sinks(&self) -> Vec<LiveSinkKind> {
        let mut kinds = self.sinks.clone();
        kinds.extend(self.browser.as_ref().map(|_| LiveSinkKind::Browser));
        kinds.extend(self.window.as_ref().map(|_| LiveSinkKind::Window));
        kinds.extend(self.openigtlink.as_ref().map(|_| LiveSinkKind::OpenIgtLink));
        LiveSinkKind::each_once(kinds)
    }

    /// Whether a live session reads segmentation or attenuation, for its generator or its page.
    pub fn reads_maps(&self) -> bool {
        (self.generator.enabled && !self.generator.models.is_empty())
            || self.live_sinks().contains(&LiveSinkKind::Browser)
    }

    /// Recording that is played instead of a tracker, if the station names one.
    pub fn recording(&self) -> Option<&Path> {
        match &self.tracker.transport {
            tracker::Transport::Recording { path, .. } => Some(path),
            _ => None,
        }
    }

    /// Makes the station play a recording instead of its tracker: once, in real time, with the sensor that the
    /// recording names.
    pub fn play(&mut self, path: &Path) {
        let (path, speed) = (path.to_owned(), tracker::Speed::Factor(1.0));
        self.tracker.transport = tracker::Transport::Recording { path, speed, repeat: false };
        (self.tracker.device.sensor, self.tracker.device.tool, self.tracker.device.needle) = (None, None, None);
    }

    /// The needle at its fixed pose; `None` if the station gives none. Stills show it, and sessions that don't track
    /// the needle.
    pub fn standing_needle(&self) -> Option<Needle> {
        let scene_from_needle = self.needle_pose.filter(|_| self.settings.needle.is_some())?;
        Some(Needle { scene_from_needle, bevel_known: true })
    }

    /// Files from which the station is read; the station file is the first. Some of them may be missing.
    pub fn files(&self) -> Vec<PathBuf> {
        let mut files = vec![self.path.clone()];
        if let Some(scene) = self.scene_file() {
            files.extend(import::files_of(scene));
            files.push(planes::planes_path(scene));
        }
        files.extend(self.calibration.path.clone());
        files.extend(self.generator.models.iter().flat_map(|model| generator_files(model)));
        files.extend(self.tracker.device.ndi.rom_files.iter().cloned());
        files.extend(self.recording().map(Path::to_owned));
        files
    }

    /// Settings of a live tracker's estimator. Reads the calibration file, if the station names one.
    ///
    /// # Errors
    /// Errors of [`CalibrationSource::load`].
    pub fn pose_settings(&self) -> Result<pose::Settings, StationError> {
        Ok(pose::Settings {
            filter: self.filter,
            calibration: self.calibration.load()?,
            initial_pose: self.default_pose.unwrap_or(Pose::IDENTITY),
        })
    }

    /// Settings of the estimator of a tracked needle; `None` for a station without `[needle]`. Reads the calibration file,
    /// if the station names one. A mock's sensor is the needle's frame; so is that of a recording, if there is no
    /// calibration file.
    ///
    /// # Errors
    /// Errors of [`Self::pose_settings`], or nothing says how the sensor is mounted on the needle.
    pub fn needle_settings(&self) -> Result<Option<NeedleTracking>, StationError> {
        if self.settings.needle.is_none() {
            return Ok(None);
        }
        let settings = self.pose_settings()?;
        let is_given = match &self.tracker.transport {
            tracker::Transport::Mock(_) | tracker::Transport::None => true,
            tracker::Transport::Recording { .. } => self.calibration.path.is_none(),
            _ => false,
        };
        let is_mock = matches!(self.tracker.transport, tracker::Transport::Mock(_));
        let (sensor_from_needle, bevel_known) = match settings.calibration.needle.filter(|_| !is_mock) {
            Some(known) => {
                let mount = known.mount().map_err(StationError::NeedleCalibration)?;
                (mount.sensor_from_needle(), mount.bevel.is_some())
            }
            None if is_given => (Pose::IDENTITY, true),
            None => return Err(StationError::NeedleMount { calibration: self.calibration.path.clone() }),
        };
        let sensor_from_probe = Some(Fitted::known(sensor_from_needle));
        let calibration = Calibration { sensor_from_probe, ..settings.calibration };
        Ok(Some(NeedleTracking { settings: pose::Settings { calibration, ..settings }, bevel_known }))
    }

    /// Standard planes of the scene: the phantom's own, or those in the file next to the scene file.
    ///
    /// # Errors
    /// Errors of [`planes::read_planes`].
    pub fn standard_planes(&self) -> Result<StandardPlanes, StationError> {
        match &self.scene {
            SceneSource::File(path) => Ok(planes::read_planes(path)?),
            SceneSource::ObstetricPhantom(options) => Ok(phantom::planes(&options.parameters)),
        }
    }

    /// Reads the surfaces of the glTF file at `path`, with this station's tissues and background.
    ///
    /// # Errors
    /// Errors of [`import::load_with_findings`]; `tissues` lacks the background tissue; the exercise names a surface that
    /// the scene lacks; or the scene's unit is evidently wrong, because an image would show nothing. Other sizes that no body has are logged as warnings.
    pub fn load_scene_from(&self, path: &Path) -> Result<Scene, StationError> {
        let background = parse::tissue_index(&self.tissues, &self.background)?;
        let (mut scene, findings) = import::load_with_findings(path, &self.tissues, background)?;
        let is_generated = matches!(self.scene, SceneSource::ObstetricPhantom(_));
        for finding in findings {
            // Degenerate triangles change no picture, and nobody can mend them in a generated scene.
            if is_generated && matches!(finding.kind, FindingKind::Degenerate { .. }) {
                tracing::debug!(scene = %path.display(), "{finding}");
            } else {
                tracing::warn!(scene = %path.display(), "{finding}");
            }
        }
        self.check_size(&scene, path)?;
        if let Some(exercise) = &self.exercise {
            let names: Vec<&str> = scene.surfaces.iter().map(|surface| surface.name.as_str()).collect();
            exercise.check(&names)?;
        }
        if !self.motion {
            scene.motion = Motion::default();
        }
        Ok(scene)
    }

    /// Refuses a scene in which every extent of every surface exceeds the image depth. Warns of other sizes that the
    /// doctor calls an error.
    fn check_size(&self, scene: &Scene, path: &Path) -> Result<(), SceneError> {
        let Some(WrongSize { finding, thinnest_mm }) = wrong_size(scene) else { return Ok(()) };
        let depth_mm = self.probe.depth_mm;
        if f64::from(thinnest_mm) > depth_mm {
            let (path, what, remedy) = (path.to_owned(), finding.what, finding.remedy);
            return Err(SceneError::WrongUnit { path, what, thinnest_mm, depth_mm, remedy });
        }
        tracing::warn!(scene = %path.display(), "{}: {}", finding.what, finding.remedy);
        Ok(())
    }
}
