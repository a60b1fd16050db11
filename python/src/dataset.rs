//! Reading and making of data sets.

use std::ops::Range;
use std::path::PathBuf;
use std::sync::atomic::{AtomicBool, Ordering};
use std::sync::mpsc;
use std::sync::{Arc, Mutex};

use insonify::dataset::{Made, Maker, Recipe, Shard, Split, Step};
use insonify::render::{Backend, BackendChoice};
use numpy::{PyArray1, PyArrayMethods};
use pyo3::prelude::*;
use pyo3::types::PyDict;

use crate::errors::{Failure, Kind};
use crate::frame::quality_of;
use crate::work::{on_pool, wait};

/// A data set on disk: header and rows in memory.
#[pyclass(frozen, module = "insonify._insonify")]
pub(crate) struct Dataset(insonify::dataset::Dataset);

fn json(value: &impl serde::Serialize) -> PyResult<String> {
    Ok(serde_json::to_string(value).map_err(|error| Failure::of(Kind::Internal, &error))?)
}

impl Dataset {
    fn row(&self, row: usize) -> Result<&insonify::dataset::Row, Failure> {
        let missing = || Failure::new(Kind::Input, format!("row {row} of {}", self.0.rows.len()));
        self.0.rows.get(row).ok_or_else(missing)
    }
}

#[pymethods]
impl Dataset {
    #[new]
    fn new(py: Python<'_>, directory: PathBuf) -> PyResult<Self> {
        let opened = py.detach(|| insonify::dataset::Dataset::open(&directory));
        Ok(Self(opened.map_err(Failure::from)?))
    }

    /// Content of `dataset.json`.
    fn header_json(&self) -> PyResult<String> {
        json(&self.0.header)
    }

    /// Positions of the rows of a split; of all rows without a split.
    fn rows(&self, split: Option<&str>) -> PyResult<Vec<usize>> {
        let split = match split {
            None => None,
            Some("train") => Some(Split::Train),
            Some("test") => Some(Split::Test),
            Some(other) => {
                let text = format!("split is `{other}`; it must be `train`, `test` or None");
                return Err(Failure::new(Kind::Input, text).into());
            }
        };
        let numbered = self.0.rows.iter().enumerate();
        Ok(numbered.filter(|(_, row)| split.is_none_or(|split| row.split == split)).map(|(place, _)| place).collect())
    }

    /// A row of the manifests as JSON.
    fn row_json(&self, row: usize) -> PyResult<String> {
        json(self.row(row)?)
    }

    /// Arrays of a row, by name.
    fn tuple<'py>(&self, py: Python<'py>, row: usize) -> PyResult<Bound<'py, PyDict>> {
        let row = self.row(row)?;
        let tuple = py.detach(|| self.0.tuple(row)).map_err(Failure::from)?;
        let [width, height] = tuple.size;
        let arrays = PyDict::new(py);
        let attenuation = tuple.attenuation_map();
        for (name, levels) in
            [("lq", tuple.lq), ("hq", tuple.hq), ("segmentation", tuple.segmentation), ("mask", tuple.mask)]
        {
            arrays.set_item(name, PyArray1::from_vec(py, levels).reshape([height, width])?)?;
        }
        arrays.set_item("attenuation", PyArray1::from_vec(py, attenuation).reshape([height, width])?)?;
        Ok(arrays)
    }
}

/// Message of the thread that makes a data set.
enum Message {
    Tuples(usize, usize),
    Ended(Result<(Made, Range<usize>), Failure>),
}

/// Panic payload that ends the work of a thread whose caller no longer waits.
struct Cancelled;

/// Makes a shard of a data set. Returns the number of tuples made, the number that existed, and the manifest's path.
#[pyfunction]
#[allow(clippy::too_many_arguments, reason = "keywords of Python")]
pub(crate) fn make_dataset(
    py: Python<'_>,
    stations: Vec<PathBuf>,
    directory: PathBuf,
    frames: usize,
    seed: u64,
    phantoms: Option<usize>,
    frames_per_exam: usize,
    test_share: f64,
    lq: Vec<String>,
    hq: &str,
    angles: (u32, u32),
    shard: &str,
    backend: Option<&str>,
    progress: Option<Bound<'_, PyAny>>,
) -> PyResult<(usize, usize, PathBuf, usize, usize)> {
    let pair = |text: &str| quality_of(text).map(|quality| [quality.rays, quality.layers]);
    let lq = lq.iter().map(|text| pair(text)).collect::<Result<Vec<_>, _>>()?;
    let hq = pair(hq)?;
    let shard: Shard = shard.parse().map_err(|reason| Failure::new(Kind::Input, format!("shard: {reason}")))?;
    let stations: Result<Vec<_>, _> = stations.iter().map(|path| insonify::Station::load(path)).collect();
    let recipe = Recipe {
        frames,
        seed,
        phantoms,
        frames_per_exam,
        test_share,
        lq,
        hq,
        lq_angles: angles.0,
        hq_angles: angles.1,
        shard,
        ..Recipe::new(stations.map_err(Failure::from)?)
    };
    let choice = match backend.map(str::parse::<BackendChoice>).transpose() {
        Ok(Some(choice)) => choice,
        Ok(None) => {
            let own = recipe.stations.first().map(|station| station.backend).unwrap_or_default();
            BackendChoice::from_environment().map_err(Failure::from)?.unwrap_or(own)
        }
        Err(error) => return Err(Failure::new(Kind::Input, format!("backend: {error}")).into()),
    };
    let (sender, receiver) = mpsc::channel();
    let cancelled = Arc::new(AtomicBool::new(false));
    let stop = cancelled.clone();
    let thread = std::thread::Builder::new().name("insonify-dataset".into()).spawn(move || {
        let report = |step: Step| {
            if stop.load(Ordering::Relaxed) {
                // An interrupted run is like a killed one: the next run continues from the manifest.
                std::panic::resume_unwind(Box::new(Cancelled));
            }
            if let Step::Tuples { done, total } = step {
                let _ = sender.send(Message::Tuples(done, total));
            }
        };
        let made = on_pool(|| {
            let backend = Backend::open(choice)?;
            let maker = Maker::new(recipe)?;
            Ok((maker.make(&directory, &backend, &report)?, maker.tuples()))
        });
        let _ = sender.send(Message::Ended(made));
    });
    thread.map_err(|e| Failure::new(Kind::Internal, format!("no thread can be started: {e}")))?;
    let receiver = Mutex::new(receiver);
    let followed = || loop {
        match wait(py, &receiver)? {
            Message::Ended(made) => return Ok::<_, PyErr>(made?),
            Message::Tuples(done, total) => {
                if let Some(progress) = &progress {
                    progress.call1((done, total))?;
                }
            }
        }
    };
    let (made, tuples) = followed().inspect_err(|_| cancelled.store(true, Ordering::Relaxed))?;
    Ok((made.made, made.kept, made.manifest, tuples.start, tuples.end))
}
