//! Exit codes and messages of failed commands.

use std::path::Path;
use std::process::ExitCode;

use insonify::anatomy::SceneError;
use insonify::anatomy::export::ExportError;
use insonify::anatomy::planes::PlanesError;
use insonify::dataset::DatasetError;
use insonify::exam::ExamError;
use insonify::files::OutputError;
use insonify::generator::GeneratorError;
use insonify::measuring::MeasuringError;
use insonify::phantom::{CacheError, PhantomError};
use insonify::pipeline::replay::ReplayError;
use insonify::pipeline::{LiveError, RecordError};
use insonify::pose::CalibrationError;
use insonify::quality::QualityError;
use insonify::recording::RecordingError;
use insonify::recording::interchange::InterchangeError;
use insonify::render::{BackendError, RenderError, UnknownBackendVariable};
use insonify::selftest::SelfTestError;
use insonify::settings::SettingsError;
use insonify::sink::SinkError;
use insonify::station::StationError;
use insonify::tracker::TrackerError;

use super::terminal;

/// Failure of a command.
#[derive(Debug)]
pub(crate) enum Failure {
    /// Wrong input: exit code 2.
    Input(anyhow::Error),
    /// Any other failure: exit code 1.
    Other(anyhow::Error),
    /// The reader of the output has closed it (`insonify … | head`). This is no error.
    OutputClosed,
    /// Interrupted by Ctrl-C before the end: exit code 130.
    Interrupted,
}

/// Classification of errors as wrong input or as other failures, where no `From` conversion exists.
pub(crate) trait Classify<T> {
    /// Classifies an error as wrong input.
    fn input(self) -> Result<T, Failure>;
    /// Classifies an error as wrong input, with `path` as its context.
    fn input_of(self, path: &Path) -> Result<T, Failure>;
    /// Classifies an error as another failure.
    fn other(self) -> Result<T, Failure>;
}

impl<T, E: Into<anyhow::Error>> Classify<T> for Result<T, E> {
    fn input(self) -> Result<T, Failure> {
        self.map_err(|e| Failure::Input(e.into()))
    }

    fn input_of(self, path: &Path) -> Result<T, Failure> {
        self.map_err(|e| {
            let error: anyhow::Error = e.into();
            Failure::Input(error.context(path.display().to_string()))
        })
    }

    fn other(self) -> Result<T, Failure> {
        self.map_err(|e| Failure::Other(e.into()))
    }
}

impl Failure {
    /// Prints one paragraph to stderr and returns the exit code.
    pub(crate) fn report(self) -> ExitCode {
        let (error, code) = match self {
            Self::Input(error) => (error, 2),
            Self::Other(error) => (error, 1),
            Self::OutputClosed => return ExitCode::SUCCESS,
            Self::Interrupted => return ExitCode::from(130),
        };
        terminal::say(&format!("error: {}", paragraph(&error)));
        ExitCode::from(code)
    }
}

/// An error and its causes in one paragraph. Causes whose text is already contained are left out.
fn paragraph(error: &anyhow::Error) -> String {
    let mut text = String::new();
    for message in error.chain().map(ToString::to_string) {
        if text.is_empty() {
            text = message;
        } else if !text.contains(&message) {
            text = format!("{text}: {message}");
        }
    }
    text
}

/// Failure class of each error type. `as` lists variants that wrap another error type of this macro.
macro_rules! classified {
    ($($error:ident $(as $($wrapped:ident)|+)? { $($case:pat => $class:ident),+ $(,)? })*) => {$(
        impl From<$error> for Failure {
            fn from(error: $error) -> Self {
                match error {
                    $($($error::$wrapped(error) => error.into(),)+)?
                    $($case => Self::$class(error.into()),)+
                }
            }
        }
    )*};
}

classified! {
    // The user can remedy these: install a driver, or request less.
    BackendError {
        BackendError::NoAdapter { .. }
        | BackendError::NoDevice { .. }
        | BackendError::Trace(_)
        | BackendError::Instructions(_)
        | BackendError::NoLanes { .. }
        | BackendError::Limit { .. }
        | BackendError::Memory { .. } => Input,
        _ => Other,
    }
    RenderError as Backend { RenderError::Bvh(_) | RenderError::Settings(_) => Input, _ => Other }
    SelfTestError as Render { _ => Other }
    ExamError as Recording { ExamError::OutOfReach { .. } | ExamError::TooShort { .. } => Input, _ => Other }
    CacheError as Build { _ => Other }
    InterchangeError as Recording { _ => Input }
    SinkError { SinkError::FrameRate { .. } => Input, _ => Other }
    RecordingError { RecordingError::Write { .. } => Other, _ => Input }
    ReplayError as Recording | Station | Render | Chooser | Quality | Generator | Sink { _ => Input }
    RecordError as Recording | Directory { RecordError::Recorder(_) => Other, _ => Input }
    LiveError as Render | Chooser | Record | Tracker | Sink { _ => Input }
    TrackerError { TrackerError::Thread(_) => Other, _ => Input }
    // A failed run is a fault of the model or the machine. The user can remedy the other errors.
    GeneratorError { GeneratorError::Inference { .. } | GeneratorError::Terminated { .. } => Other, _ => Input }
    ExportError { _ => Other }
    UnknownBackendVariable { _ => Input }
    StationError as Phantom | Recording { _ => Input }
    // A tissue number without a class is a fault of the renderer.
    DatasetError as Station | Exam | Render | Sink { DatasetError::Number { .. } => Other, _ => Input }
    // The user gives the images, data sets and models.
    MeasuringError as Station | Dataset | Generator | Quality | Render | SelfTest | Sink {
        MeasuringError::Table(_) | MeasuringError::Text(_) | MeasuringError::Read(_) | MeasuringError::Figure(_) => Other,
        _ => Input,
    }
    OutputError { _ => Input }
    PlanesError { _ => Input }
    SceneError { _ => Input }
    SettingsError { _ => Input }
    PhantomError { _ => Input }
    CalibrationError { _ => Input }
    QualityError { _ => Input }
}

#[cfg(test)]
mod tests {
    use insonify::files::FileError;

    use super::*;

    #[test]
    fn a_cause_is_told_once() {
        let error = FileError::at("read the station file", Path::new("a.toml"))(std::io::Error::other("gone"));
        let error = anyhow::Error::new(StationError::File(error));
        assert_eq!(paragraph(&error), "cannot read the station file a.toml: gone");
        assert_eq!(paragraph(&error.context("no demo")), "no demo: cannot read the station file a.toml: gone");
    }
}
