//! Generators: ONNX models that give a rendered frame the appearance of a better one.
//!
//! A generator is an `.onnx` file with a [`Manifest`] next to it. [`Generator::load`] checks both. It runs the bundled
//! parity pair on this machine, and refuses a model that does not reproduce it.
//!
//! [`Generator::run`] translates the whole field of view: it normalises, pads to the model's multiple, infers, crops,
//! clears pixels outside the sector, and rounds to grey levels. A model in beam coordinates ([`BeamGrid`]) has
//! scanlines × range cells as input and output; the picture is resampled before and after.
//!
//! The controller of operating points in the pipeline chooses which generator runs. Without ONNX Runtime's library, or
//! without the feature `generator`, [`Runtime::get`] returns an error that names the remedy; rendering works all the
//! same.

mod beam_sampling;
mod compute_device;
mod error;
#[cfg(feature = "generator")]
mod external_data;
mod feature_scale;
#[cfg(feature = "generator")]
mod features;
#[cfg(not(feature = "generator"))]
#[path = "no_features.rs"]
mod features;
#[expect(clippy::module_inception, reason = "the type of that name has a file of its own")]
mod generator;
mod input;
mod load;
mod load_options;
mod manifest;
mod maps;
mod parity;
mod precision;
#[cfg(feature = "generator")]
mod providers;
mod run_times;
#[cfg(feature = "generator")]
mod runtime;
#[cfg(not(feature = "generator"))]
#[path = "no_runtime.rs"]
mod runtime;
#[cfg(feature = "generator")]
mod session;
#[cfg(not(feature = "generator"))]
#[path = "no_session.rs"]
mod session;
mod tensor_values;
#[cfg(feature = "generator")]
mod tensors;

pub use crate::settings::{GeneratorSettings as Settings, Precision, Provider};
#[cfg(feature = "live")]
pub(crate) use compute_device::compute_device_of;
pub use error::{GeneratorError, RuntimeError};
pub use feature_scale::FeatureScale;
pub use features::OnnxFeatures;
pub use generator::Generator;
pub use input::Input;
pub use load::{LoadedGenerators, RefusedModel, load_generators};
pub use load_options::LoadOptions;
pub use manifest::{
    Affine, BeamGrid, Channel, Encoding, InputManifest, Kind, Manifest, OutputManifest, ParityManifest, Quality,
    Quantised, SegmentationManifest, Training, Variant, generator_files,
};
pub use parity::ParityReport;
pub use run_times::RunTimes;
pub use runtime::Runtime;
pub use session::Terminator;
