//! Failures of the library as Python exceptions, with the library's messages.

use std::error::Error;
use std::io::ErrorKind;

use insonify::anatomy::{BvhError, SceneError, TissueError};
use insonify::dataset::DatasetError;
use insonify::generator::{GeneratorError, RuntimeError};
use insonify::measuring::MeasuringError;
use insonify::pose::PoseError;
use insonify::render::{BackendError, RenderError, UnknownBackendVariable};
use insonify::settings::SettingsError;
use insonify::station::StationError;
use pyo3::prelude::*;
use pyo3::sync::PyOnceLock;
use pyo3::types::PyType;

/// Class of a failure, one for each exception of `insonify._errors`.
#[derive(Debug, Clone, Copy, PartialEq, Eq)]
pub(crate) enum Kind {
    Input,
    MissingFile,
    Station,
    Scene,
    Pose,
    Dataset,
    Generator,
    Backend,
    Render,
    Internal,
}

impl Kind {
    fn class(self) -> &'static str {
        match self {
            Self::Input => "InputError",
            Self::MissingFile => "MissingFileError",
            Self::Station => "StationError",
            Self::Scene => "SceneError",
            Self::Pose => "PoseError",
            Self::Dataset => "DatasetError",
            Self::Generator => "GeneratorError",
            Self::Backend => "BackendError",
            Self::Render => "RenderError",
            Self::Internal => "InternalError",
        }
    }
}

/// A failure that is not yet a Python exception. It can be made without the interpreter's lock.
#[derive(Debug)]
pub(crate) struct Failure {
    kind: Kind,
    text: String,
}

impl Failure {
    pub(crate) fn new(kind: Kind, text: impl Into<String>) -> Self {
        Self { kind, text: text.into() }
    }

    pub(crate) fn kind(&self) -> Kind {
        self.kind
    }

    /// Failure with the message of `error`. A missing file has a class of its own, whatever `kind` is.
    pub(crate) fn of(kind: Kind, error: &(dyn Error + 'static)) -> Self {
        let chain = || std::iter::successors(Some(error), |&e| e.source());
        let missing =
            chain().any(|e| e.downcast_ref().is_some_and(|e: &std::io::Error| e.kind() == ErrorKind::NotFound));
        let mut text = String::new();
        for message in chain().map(ToString::to_string) {
            if text.is_empty() {
                text = message;
            } else if !text.contains(&message) {
                text = format!("{text}: {message}");
            }
        }
        Self { kind: if missing { Kind::MissingFile } else { kind }, text }
    }
}

impl From<Failure> for PyErr {
    fn from(failure: Failure) -> Self {
        static CLASSES: PyOnceLock<Py<PyModule>> = PyOnceLock::new();
        Python::attach(|py| {
            let module = CLASSES.get_or_try_init(py, || Ok::<_, Self>(py.import("insonify._errors")?.unbind()));
            let class = module.and_then(|module| module.bind(py).getattr(failure.kind.class()));
            match class.and_then(|class| Ok(class.cast_into::<PyType>()?)) {
                Ok(class) => Self::from_type(class, failure.text),
                Err(error) => error,
            }
        })
    }
}

/// Kind of each error type, one enum per line. `as` names variants that wrap an error type of another line.
macro_rules! failures {
    ($($error:ident $(as $($wrapped:ident)|+)? => $kind:ident)*) => {$(
        impl From<$error> for Failure {
            fn from(error: $error) -> Self {
                match error {
                    $($($error::$wrapped(error) => error.into(),)+)?
                    #[allow(unreachable_patterns, reason = "of an error with one shape")]
                    error => Self::of(Kind::$kind, &error),
                }
            }
        }
    )*};
}

failures! {
    StationError as Scene => Station
    SceneError => Scene
    BvhError => Scene
    TissueError => Station
    PoseError => Pose
    SettingsError => Input
    BackendError => Backend
    UnknownBackendVariable => Input
    RenderError as Backend | Bvh | Settings => Render
    MeasuringError => Render
    RuntimeError => Generator
    GeneratorError => Generator
    DatasetError as Station | Render => Dataset
}
