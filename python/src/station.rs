//! Stations: their file, their settings, and their frames.

use std::path::PathBuf;
use std::sync::Arc;

use insonify::glam::DVec3;
use insonify::pose::Pose;
use insonify::render::BackendChoice;
use insonify::settings::SettingsGroup;
use insonify::station::{PlaneScene, keys};
use numpy::PyReadonlyArray2;
use pyo3::prelude::*;
use pyo3::types::PyDict;
use serde_json::json;
use toml::{Table, Value};

use crate::convert::{merge, to_python};
use crate::described::Described;
use crate::errors::{Failure, Kind};
use crate::exercise::Exercise;
use crate::frame::{Components, FrameRequest, NeedleArgument, Still, components, pose_of};
use crate::planes::Planes;
use crate::rendering::Rendering;
use crate::scene::SceneArrays;
use crate::shared::SharedStation;
use crate::stream::Stream;
use crate::work::{interruptibly, on_pool};

/// A station with its renderer.
#[pyclass(frozen, module = "insonify._insonify")]
pub(crate) struct Station(Arc<SharedStation>);

impl Station {
    fn of(described: Described) -> Self {
        Self(Arc::new(SharedStation::new(described)))
    }
}

#[pymethods]
impl Station {
    /// Reads a station file.
    #[staticmethod]
    fn load(path: PathBuf) -> PyResult<Self> {
        // Reports faults of the file, and logs keys with earlier names.
        insonify::Station::load(&path).map_err(Failure::from)?;
        let io = |error| Failure::of(Kind::Station, &error);
        let text = std::fs::read_to_string(&path).map_err(io)?;
        let table: Table = text.parse().map_err(|error: toml::de::Error| Failure::of(Kind::Station, &error))?;
        let path = std::path::absolute(&path).map_err(|error| Failure::of(Kind::Station, &error))?;
        let directory = path.parent().map(PathBuf::from).unwrap_or_default();
        Ok(Self::of(Described::new(table, directory, Some(path), None, None)?))
    }

    /// Makes a station from a dict of tables. Relative paths start at `directory`.
    #[staticmethod]
    #[pyo3(signature = (tables, directory, path=None, arrays=None, backend=None))]
    fn from_tables(
        tables: &Bound<'_, PyDict>,
        directory: PathBuf,
        path: Option<PathBuf>,
        arrays: Option<&SceneArrays>,
        backend: Option<&str>,
    ) -> PyResult<Self> {
        let mut table = Table::new();
        merge(&mut table, tables)?;
        let arrays = arrays.map(|arrays| arrays.0.clone());
        Ok(Self::of(Described::new(table, directory, path, arrays, backend_of(backend)?)?))
    }

    /// The tables, with all changes so far.
    fn tables<'py>(&self, py: Python<'py>) -> PyResult<Bound<'py, PyAny>> {
        to_python(py, &Value::Table(self.0.described().table))
    }

    #[getter]
    fn directory(&self) -> PathBuf {
        self.0.described().directory
    }

    #[getter]
    fn path(&self) -> Option<PathBuf> {
        self.0.described().path
    }

    #[getter]
    fn arrays(&self) -> Option<SceneArrays> {
        self.0.described().arrays.map(SceneArrays)
    }

    #[getter]
    fn backend(&self) -> Option<String> {
        self.0.described().backend.map(|choice| choice.to_string())
    }

    /// Changes settings. After an error nothing has changed.
    fn set(&self, tables: &Bound<'_, PyDict>) -> PyResult<()> {
        let Described { mut table, directory, path, arrays, backend, .. } = self.0.described();
        if arrays.is_some() && (tables.contains("scene")?) {
            let text = "the station's scene is made of arrays: make a station with another scene";
            return Err(Failure::new(Kind::Station, text).into());
        }
        merge(&mut table, tables)?;
        let next = Described::new(table, directory, path, arrays, backend)?;
        self.0.describe(next);
        Ok(())
    }

    /// Name of the device or processor that renders; none before the first frame.
    #[getter]
    fn adapter(&self, py: Python<'_>) -> PyResult<Option<String>> {
        let inner = self.0.clone();
        interruptibly(py, move || {
            let rendering = Rendering::lock(&inner.rendering)?;
            Ok(rendering.as_ref().map(|rendering| rendering.backend.to_string()))
        })
    }

    /// Current settings as JSON.
    fn settings_json(&self) -> String {
        let station = self.0.described().station;
        let settings = station.settings;
        json!({
            "probe": station.probe,
            "image": settings.image,
            "quality": settings.quality,
            "frame_budget_ms": station.frame_budget_ms,
            "look": settings.look,
            "contact": settings.contact,
            "receiver": settings.receiver,
            "needle": settings.needle,
            "background": station.background,
        })
        .to_string()
    }

    /// Names of the tissues, in the order of their numbers from 1.
    fn tissue_names(&self) -> Vec<String> {
        self.0.described().station.tissues.names().to_vec()
    }

    /// Properties of every tissue, by name.
    fn tissues<'py>(&self, py: Python<'py>) -> PyResult<Bound<'py, PyDict>> {
        let all = PyDict::new(py);
        let table = self.0.described().station.tissues;
        for (name, tissue) in table.names().iter().zip(table.tissues()) {
            let properties = PyDict::new(py);
            let mut tissue = tissue.clone();
            for setting in insonify::anatomy::Tissue::settings() {
                if let Some(stored) = tissue.stored_mut(setting.key) {
                    properties.set_item(setting.key, stored.get(0))?;
                }
            }
            all.set_item(name, properties)?;
        }
        Ok(all)
    }

    /// Pose of the station's `[pose]`.
    #[getter]
    fn pose(&self) -> Option<Components> {
        self.0.described().station.default_pose.map(|pose| components(&pose))
    }

    /// Shape of the needle: gauge, length, bevel, kind and diameter, as JSON; none for a station without a needle.
    fn needle_json(&self) -> Option<String> {
        let needle = self.0.described().station.settings.needle?;
        let mut shape = json!(needle);
        shape["diameter_mm"] = json!(needle.diameter_mm());
        Some(shape.to_string())
    }

    /// Pose at which the needle stands; none for a tracked one.
    #[getter]
    fn needle_pose(&self) -> Option<Components> {
        self.0.described().station.standing_needle().map(|needle| components(&needle.scene_from_needle))
    }

    /// Renders a frame.
    #[allow(clippy::too_many_arguments, reason = "keywords of Python")]
    fn render(
        &self,
        py: Python<'_>,
        pose: [f64; 7],
        needle: Option<NeedleArgument>,
        quality: Option<&str>,
        seed: Option<u32>,
        time_s: f64,
        maps: bool,
        lines: bool,
    ) -> PyResult<Still> {
        let (inner, described) = (self.0.clone(), self.0.described());
        let has_needle = described.station.settings.needle.is_some();
        let request = FrameRequest::new(pose, needle, has_needle, quality, seed, time_s, maps, lines)?;
        let still = interruptibly(py, move || Rendering::still(&inner.rendering, &described, &request, &mut None))?;
        Still::new(py, still)
    }

    /// Starts a thread that renders frames of the poses pushed to it.
    fn stream(&self) -> PyResult<Stream> {
        Stream::start(self.0.clone())
    }

    /// Loads the scene and makes the renderer, without rendering a frame.
    fn prepare(&self, py: Python<'_>) -> PyResult<()> {
        let (inner, described) = (self.0.clone(), self.0.described());
        interruptibly(py, move || {
            let settings = described.station.settings;
            Rendering::with(&inner.rendering, &described, &settings, |_| Ok(()))
        })
    }

    /// Decisions of the effect plan, as JSON and as a text table.
    fn plan(&self, py: Python<'_>, quality: Option<&str>) -> PyResult<(String, String)> {
        let quality = quality.map(crate::frame::quality_of).transpose()?;
        let described = self.0.described();
        interruptibly(py, move || crate::rendering::plan(&described, quality))
    }

    /// The standard planes of the scene.
    fn planes(&self, py: Python<'_>) -> PyResult<Planes> {
        let Described { station, arrays, .. } = self.0.described();
        if arrays.is_some() {
            return Err(Failure::new(Kind::Scene, "a scene of arrays has no standard planes").into());
        }
        interruptibly(py, move || {
            let PlaneScene { planes, skin } = on_pool(|| Ok(PlaneScene::open(&station)?))?;
            Ok(Planes { planes, skin, probe: station.probe, contact: station.settings.contact })
        })
    }

    /// The exercise in its scene, which is loaded; none for a station without one.
    fn exercise(&self, py: Python<'_>) -> PyResult<Option<Exercise>> {
        let described = self.0.described();
        let Some(exercise) = described.station.exercise.clone() else { return Ok(None) };
        interruptibly(py, move || Exercise::open(&described, exercise)).map(Some)
    }
}

fn backend_of(name: Option<&str>) -> Result<Option<BackendChoice>, Failure> {
    let choice = name.map(str::parse).transpose();
    choice.map_err(|error: insonify::settings::UnknownBackend| Failure::new(Kind::Input, format!("backend: {error}")))
}

/// Keys of station files: table, key, unit, default, accepted values, meaning.
#[pyfunction]
pub(crate) fn station_keys() -> Vec<(&'static str, &'static str, &'static str, String, String, String)> {
    let row = |doc: &'static insonify::station::KeyDoc| {
        (doc.table, doc.key, doc.unit, doc.default.to_string(), doc.range.to_string(), doc.meaning.to_string())
    };
    keys().iter().map(row).collect()
}

/// Checks a pose (x, y, z, qw, qx, qy, qz) and returns it with a normalised quaternion.
#[pyfunction]
pub(crate) fn checked_pose(pose: [f64; 7]) -> PyResult<Components> {
    Ok(components(&pose_of(pose)?))
}

/// Inverse of a pose: `b_from_a` for an `a_from_b`.
#[pyfunction]
pub(crate) fn inverse_pose(pose: [f64; 7]) -> PyResult<Components> {
    Ok(components(&pose_of(pose)?.inverse()))
}

/// Product of two poses: `a_from_c` for `a_from_b` and `b_from_c`.
#[pyfunction]
pub(crate) fn pose_product(a_from_b: [f64; 7], b_from_c: [f64; 7]) -> PyResult<Components> {
    let product = pose_of(a_from_b)? * pose_of(b_from_c)?;
    // The position of the product may be out of range.
    Ok(components(&pose_of(product.components())?))
}

/// Pose at a position (mm) whose z axis points along `direction`, with the x axis as close as possible to `lateral`.
#[pyfunction]
pub(crate) fn looking_pose(position_mm: [f64; 3], direction: [f64; 3], lateral: [f64; 3]) -> PyResult<Components> {
    let (along, aside) = (DVec3::from_array(direction), DVec3::from_array(lateral));
    for (name, given, axis) in [("direction", direction, along), ("lateral", lateral, aside)] {
        if axis.try_normalize().is_none() {
            let text = format!("{name} is {given:?}; it must be three finite numbers, not all of them 0");
            return Err(Failure::new(Kind::Pose, text).into());
        }
    }
    let pose = Pose::looking(DVec3::from_array(position_mm), along, aside);
    // The position may be out of range.
    Ok(components(&pose_of(pose.components())?))
}

/// Built-in tissues with ranges and sources, as JSON.
#[pyfunction]
pub(crate) fn builtin_tissues_json() -> PyResult<String> {
    let tissues = insonify::anatomy::builtin::sourced_tissues().map_err(Failure::from)?;
    Ok(serde_json::to_string(&tissues).map_err(|error| Failure::of(Kind::Internal, &error))?)
}

/// A grey image [height, width] as the bytes of a PNG file.
#[pyfunction]
pub(crate) fn png(grey: PyReadonlyArray2<'_, u8>) -> PyResult<Vec<u8>> {
    use image::{ExtendedColorType, ImageEncoder, codecs::png::PngEncoder};

    let [height, width] = *grey.as_array().shape() else {
        return Err(Failure::new(Kind::Input, "a picture must be an array [height, width]").into());
    };
    let pixels = grey.as_array().iter().copied().collect::<Vec<u8>>();
    let mut png = Vec::new();
    PngEncoder::new(&mut png)
        .write_image(&pixels, width as u32, height as u32, ExtendedColorType::L8)
        .map_err(|error| Failure::of(Kind::Input, &error))?;
    Ok(png)
}
