//! Extension module of the Python package: the library's types, with JSON and NumPy arrays as parameters and results.
//! The typed interface is the package's Python code.

mod convert;
mod dataset;
mod described;
mod errors;
mod exercise;
mod frame;
mod generator;
mod log;
mod planes;
mod process;
mod rendering;
mod scene;
mod shared;
mod station;
mod stream;
mod work;

/// Extension module of `insonify`.
#[pyo3::pymodule]
mod _insonify {
    use pyo3::prelude::*;

    #[pymodule_export]
    use super::dataset::{Dataset, make_dataset};
    #[pymodule_export]
    use super::exercise::{Exercise, NeedleSession};
    #[pymodule_export]
    use super::frame::{Record, Still};
    #[pymodule_export]
    use super::generator::Generator;
    #[pymodule_export]
    use super::planes::Planes;
    #[pymodule_export]
    use super::scene::SceneArrays;
    #[pymodule_export]
    use super::station::{
        Station, builtin_tissues_json, checked_pose, inverse_pose, looking_pose, png, pose_product, station_keys,
    };
    #[pymodule_export]
    use super::stream::Stream;

    #[pymodule_init]
    fn init(module: &Bound<'_, PyModule>) -> PyResult<()> {
        super::process::note_import();
        super::log::start();
        module.add("__version__", env!("CARGO_PKG_VERSION"))
    }
}
