//! Requests for frames, and the frames.

use insonify::chooser::{StillFrame, StillPoses};
use insonify::needle::Needle;
use insonify::pose::Pose;
use insonify::render::{FrameQuality, Quality};
use insonify::settings::ProbeKind;
use insonify::sink::FrameRecord;
use num_complex::Complex32;
use numpy::{Element, PyArray1, PyArrayMethods};
use pyo3::prelude::*;

use crate::described::Described;
use crate::errors::{Failure, Kind};

/// Seven numbers of a pose (x, y, z in mm, qw, qx, qy, qz) as a Python tuple.
pub(crate) type Components = (f64, f64, f64, f64, f64, f64, f64);

pub(crate) fn components(pose: &Pose) -> Components {
    let [x, y, z, qw, qx, qy, qz] = pose.components();
    (x, y, z, qw, qx, qy, qz)
}

/// Checks seven numbers and makes a pose of them.
pub(crate) fn pose_of(components: [f64; 7]) -> Result<Pose, Failure> {
    Ok(Pose::from_components(components)?)
}

/// Parses a quality.
pub(crate) fn quality_of(text: &str) -> Result<FrameQuality, Failure> {
    text.parse().map_err(|error| Failure::new(Kind::Input, format!("quality is `{text}`: {error}")))
}

/// The needle of one frame as a caller gives it: a pose, or `False` for a frame without it.
#[derive(FromPyObject)]
pub(crate) enum NeedleArgument {
    #[pyo3(transparent)]
    Pose([f64; 7]),
    #[pyo3(transparent)]
    Shown(bool),
}

/// The needle of one frame.
#[derive(Clone, Copy)]
enum FrameNeedle {
    /// The station's own, where it stands.
    Own,
    At(Needle),
    Absent,
}

impl FrameNeedle {
    /// Checks an argument of a station with or without a needle.
    fn of(argument: Option<NeedleArgument>, has_needle: bool) -> Result<Self, Failure> {
        match argument {
            None | Some(NeedleArgument::Shown(true)) => Ok(Self::Own),
            Some(NeedleArgument::Shown(false)) => Ok(Self::Absent),
            Some(NeedleArgument::Pose(_)) if !has_needle => {
                let text = "a pose of the needle is given, and the station has no needle; \
                            station.set(needle=pose) gives it one";
                Err(Failure::new(Kind::Input, text))
            }
            // Only a sensor with five degrees of freedom leaves the bevel unknown.
            Some(NeedleArgument::Pose(pose)) => {
                Ok(Self::At(Needle { scene_from_needle: pose_of(pose)?, bevel_known: true }))
            }
        }
    }
}

/// Request for a frame: poses, quality, seed, time, and the arrays to return.
pub(crate) struct FrameRequest {
    pose: Pose,
    needle: FrameNeedle,
    pub(crate) quality: Option<FrameQuality>,
    seed: Option<u32>,
    time_s: f64,
    maps: bool,
    lines: bool,
}

impl FrameRequest {
    /// Checks the parts of a request to a station with or without a needle.
    #[allow(clippy::too_many_arguments, reason = "keywords of Python")]
    pub(crate) fn new(
        pose: [f64; 7],
        needle: Option<NeedleArgument>,
        has_needle: bool,
        quality: Option<&str>,
        seed: Option<u32>,
        time_s: f64,
        maps: bool,
        lines: bool,
    ) -> Result<Self, Failure> {
        if !(0.0..=1e6).contains(&time_s) {
            let text = format!("time_s is {time_s}; it must be a number of seconds from 0 to 1000000");
            return Err(Failure::new(Kind::Input, text));
        }
        let quality = quality.map(quality_of).transpose()?;
        let needle = FrameNeedle::of(needle, has_needle)?;
        Ok(Self { pose: pose_of(pose)?, needle, quality, seed, time_s, maps, lines })
    }

    /// Poses of the tools of a station, and time.
    pub(crate) fn at(&self, station: &insonify::Station) -> StillPoses {
        let needle = match self.needle {
            FrameNeedle::Own => station.standing_needle(),
            FrameNeedle::At(needle) => Some(needle),
            FrameNeedle::Absent => None,
        };
        StillPoses { probe: self.pose, needle, time_s: self.time_s }
    }

    /// Settings of the requested frame, chosen as `insonify render` chooses them.
    pub(crate) fn settings(&self, described: &Described) -> insonify::render::RenderSettings {
        let mut settings = described.station.settings;
        settings.lines = self.lines;
        settings.maps = self.maps;
        let seed = self.seed.unwrap_or(settings.quality.seed);
        settings.quality = match self.quality {
            Some(quality) => quality.with_seed(seed),
            None => Quality { seed, ..settings.quality },
        };
        settings
    }
}

/// A rendered frame; NumPy owns its arrays.
#[pyclass(frozen, get_all, module = "insonify._insonify")]
pub(crate) struct Still {
    bmode: Py<PyAny>,
    mask: Py<PyAny>,
    segmentation: Option<Py<PyAny>>,
    attenuation: Option<Py<PyAny>>,
    lines: Option<Py<PyAny>>,
    mm_per_pixel: f64,
    corner_mm: (f64, f64),
    /// Kind of the probe, its radius or width in mm, its field of view in degrees, and its depth in mm.
    face: (&'static str, f64, f64, f64),
    attenuation_p98: f32,
    overflows: u32,
    total_ms: f64,
    chosen: Option<String>,
    record: Py<Record>,
}

/// Inputs and times of a frame, as `frame.json` has them.
#[pyclass(frozen, module = "insonify._insonify")]
pub(crate) struct Record(FrameRecord);

#[pymethods]
impl Record {
    /// The record as JSON.
    fn json(&self) -> PyResult<String> {
        Ok(serde_json::to_string(&self.0).map_err(|error| Failure::of(Kind::Internal, &error))?)
    }
}

/// A two-dimensional array with `rows` rows that owns `values`.
fn owned_array<T: Element>(py: Python<'_>, values: Vec<T>, rows: usize) -> PyResult<Py<PyAny>> {
    let columns = values.len().checked_div(rows).unwrap_or(0);
    Ok(PyArray1::from_vec(py, values).reshape([rows, columns])?.into_any().unbind())
}

impl Still {
    pub(crate) fn new(py: Python<'_>, StillFrame { frame, record, chosen }: StillFrame) -> PyResult<Self> {
        let rows = frame.height as usize;
        let map = |levels: Vec<u8>| (!levels.is_empty()).then(|| owned_array(py, levels, rows)).transpose();
        let attenuation =
            (!frame.attenuation.is_empty()).then(|| owned_array(py, frame.attenuation, rows)).transpose()?;
        let lines = if frame.lines.is_empty() {
            None
        } else {
            let complex: Vec<Complex32> = bytemuck::cast_vec(frame.lines);
            Some(owned_array(py, complex, record.probe.scanlines as usize)?)
        };
        let (kind, size_mm, fov_deg) = match record.probe.kind {
            ProbeKind::Convex { radius_mm, fov_deg } => ("convex", radius_mm, fov_deg),
            ProbeKind::Linear { width_mm } => ("linear", width_mm, 0.0),
            ProbeKind::Phased { fov_deg } => ("phased", 0.0, fov_deg),
        };
        Ok(Self {
            bmode: owned_array(py, frame.bmode, rows)?,
            // Frames share one mask, but a caller may write into its own copy.
            mask: owned_array(py, frame.mask.to_vec(), rows)?,
            segmentation: map(frame.segmentation)?,
            attenuation,
            lines,
            mm_per_pixel: record.image.pixel_mm,
            corner_mm: record.image.corner_mm.into(),
            face: (kind, size_mm, fov_deg, record.probe.depth_mm),
            attenuation_p98: frame.attenuation_p98,
            overflows: frame.overflows,
            total_ms: frame.times.total_ms,
            chosen: chosen.map(|chosen| chosen.to_string()),
            record: Py::new(py, Record(record))?,
        })
    }
}
