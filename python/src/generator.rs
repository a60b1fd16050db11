//! Generators for frames in NumPy arrays.

use std::path::PathBuf;
use std::sync::{Arc, Mutex, PoisonError};

use insonify::generator::{Input, LoadOptions, Precision, Runtime};
use insonify::glam::DVec2;
use insonify::settings::ProbeKind;
use insonify::transducer::{ScanGeometry, Sector};
use numpy::{PyArray1, PyArrayMethods, PyReadonlyArray2};
use pyo3::prelude::*;

use crate::errors::{Failure, Kind};
use crate::work::{interruptibly, on_pool};

/// A model that was checked on this machine.
#[pyclass(frozen, module = "insonify._insonify")]
pub(crate) struct Generator {
    generator: Arc<Mutex<insonify::generator::Generator>>,
    process: u32,
}

/// Geometry of the scanlines in a picture: kind of the probe, radius or width in mm, field of view in degrees, depth
/// in mm.
type Face = (String, f64, f64, f64);

fn geometry(
    (kind, size_mm, fov_deg, depth_mm): Face,
    [height, width]: [usize; 2],
    pixel_mm: f64,
    corner_mm: (f64, f64),
) -> Result<ScanGeometry, Failure> {
    let kind = match kind.as_str() {
        "convex" => ProbeKind::Convex { radius_mm: size_mm, fov_deg },
        "linear" => ProbeKind::Linear { width_mm: size_mm },
        "phased" => ProbeKind::Phased { fov_deg },
        _ => return Err(Failure::new(Kind::Input, format!("`{kind}` is no kind of probe"))),
    };
    let corner_mm = DVec2::new(corner_mm.0, corner_mm.1);
    let sector = Sector { width: width as u32, height: height as u32, pixel_mm, corner_mm };
    Ok(ScanGeometry { kind, depth_mm, sector })
}

fn precision_of(name: &str) -> Result<Precision, Failure> {
    let known = || format!("precision is `{name}`; it must be one of {}", Precision::NAMES.join(", "));
    Precision::named(name).ok_or_else(|| Failure::new(Kind::Input, known()))
}

#[pymethods]
impl Generator {
    /// Loads the model at `path` for frames with these tissues. Their names are in the order of their numbers, from
    /// 1.
    #[new]
    fn new(py: Python<'_>, path: PathBuf, tissues: Vec<String>, threads: u32, precision: &str) -> PyResult<Self> {
        let precision = precision_of(precision)?;
        let generator = interruptibly(py, move || {
            let runtime = Runtime::get()?;
            let options = LoadOptions { threads, precision, tissues: &tissues, ..LoadOptions::default() };
            on_pool(|| Ok(insonify::generator::Generator::load(&path, runtime, &options)?))
        })?;
        Ok(Self { generator: Arc::new(Mutex::new(generator)), process: std::process::id() })
    }

    /// Name in the manifest.
    #[getter]
    fn name(&self) -> String {
        self.generator.lock().unwrap_or_else(PoisonError::into_inner).manifest().name.clone()
    }

    /// Precision of the model's weights.
    #[getter]
    fn precision(&self) -> &'static str {
        self.generator.lock().unwrap_or_else(PoisonError::into_inner).precision().name()
    }

    /// Translates a frame: grey levels [height, width].
    #[allow(clippy::too_many_arguments, reason = "the arrays of a frame")]
    fn run<'py>(
        &self,
        py: Python<'py>,
        bmode: PyReadonlyArray2<'py, u8>,
        segmentation: PyReadonlyArray2<'py, u8>,
        attenuation: PyReadonlyArray2<'py, f32>,
        mask: PyReadonlyArray2<'py, u8>,
        face: Face,
        mm_per_pixel: f64,
        corner_mm: (f64, f64),
    ) -> PyResult<Py<PyAny>> {
        if self.process != std::process::id() {
            let text = "a generator can't be used after a fork; load it in this process, or start processes by `spawn`";
            return Err(Failure::new(Kind::Generator, text).into());
        }
        let [height, width] = [bmode.as_array().nrows(), bmode.as_array().ncols()];
        let contiguous = |_| Failure::new(Kind::Input, "a frame's maps must be C-ordered arrays [height, width]");
        let scan = geometry(face, [height, width], mm_per_pixel, corner_mm)?;
        // Copies the arrays, because another thread may write into them while the generator runs.
        let image = bmode.as_slice().map_err(contiguous)?.to_vec();
        let segmentation = segmentation.as_slice().map_err(contiguous)?.to_vec();
        let attenuation = attenuation.as_slice().map_err(contiguous)?.to_vec();
        let mask = mask.as_slice().map_err(contiguous)?.to_vec();
        let input = Input {
            width: width as u32,
            height: height as u32,
            image: &image,
            segmentation: &segmentation,
            attenuation: &attenuation,
            mask: &mask,
            scan: Some(scan),
        };
        let levels = py.detach(|| {
            let mut generator = self.generator.lock().unwrap_or_else(PoisonError::into_inner);
            let generator = &mut *generator;
            on_pool(|| {
                let mut levels = Vec::new();
                generator.run(&input, &mut levels)?;
                Ok(levels)
            })
        })?;
        Ok(PyArray1::from_vec(py, levels).reshape([height, width])?.into_any().unbind())
    }
}
