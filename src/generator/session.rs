//! Session of ONNX Runtime for one model, with tensors kept between runs.

use std::fmt;
use std::path::Path;
use std::sync::{Arc, Mutex, MutexGuard, PoisonError};

use ort::session::RunOptions;
use ort::session::builder::GraphOptimizationLevel;
use ort::value::{Outlet, TensorElementType, ValueType};
use sha2::{Digest, Sha256};

use super::external_data::check_one_file;
use super::load_options::Execution;
use super::maps::Geometry;
use super::providers::dispatch;
use super::tensor_values::{Planes, Values};
use super::tensors::{Kind, Tensors};
use super::{GeneratorError, Manifest, Provider, Runtime};
use crate::files::hex;

/// Handle that stops a run from another thread.
#[derive(Clone)]
pub struct Terminator(Arc<RunControl>);

impl fmt::Debug for Terminator {
    fn fmt(&self, f: &mut fmt::Formatter<'_>) -> fmt::Result {
        f.debug_struct("Terminator").field("running", &self.running()).finish()
    }
}

impl Terminator {
    /// Number of the run in progress, from 1; `None` if no run is in progress.
    pub fn running(&self) -> Option<u64> {
        let state = self.0.lock();
        state.running.then_some(state.number)
    }

    /// Stops the run in progress; later runs are not affected. The run ends with [`GeneratorError::Terminated`], at the
    /// latest after its current operation. Returns whether a run was stopped.
    pub fn terminate(&self) -> bool {
        self.stop(None)
    }

    /// Stops the run with this number if it is in progress. Returns whether it was stopped.
    pub fn terminate_run(&self, number: u64) -> bool {
        self.stop(Some(number))
    }

    fn stop(&self, number: Option<u64>) -> bool {
        let mut state = self.0.lock();
        if !state.running || number.is_some_and(|n| n != state.number) {
            return false;
        }
        // The lock keeps the next run from starting, and from being stopped instead.
        state.stopped = self.0.options.terminate().is_ok();
        state.stopped
    }
}

struct RunControl {
    options: RunOptions,
    state: Mutex<RunState>,
}

#[derive(Default)]
struct RunState {
    number: u64,
    running: bool,
    stopped: bool,
}

impl RunControl {
    fn lock(&self) -> MutexGuard<'_, RunState> {
        self.state.lock().unwrap_or_else(PoisonError::into_inner)
    }
}

/// Reason why a run gave no image.
pub(super) enum RunFailure {
    Stopped,
    Failed(String),
}

impl From<ort::Error> for RunFailure {
    fn from(error: ort::Error) -> Self {
        Self::Failed(error.message().to_owned())
    }
}

/// One model, ready to run.
pub(super) struct Session {
    inner: ort::session::Session,
    input_name: String,
    output_name: String,
    /// Value types of the input and of the output tensor.
    kinds: [Kind; 2],
    channels: usize,
    provider: Provider,
    tensors: Option<Tensors>,
    control: Arc<RunControl>,
}

impl Session {
    pub(super) fn new(
        runtime: &Runtime,
        path: &Path,
        model: &[u8],
        manifest: &Manifest,
        execution: Execution<'_>,
    ) -> Result<Self, GeneratorError> {
        let Execution { provider, precision, threads, sha256 } = execution;
        check_one_file(path, model)?;
        let refused = |e: ort::Error| GeneratorError::Model { path: path.to_owned(), reason: e.message().to_owned() };
        let builder = ort::session::Session::builder(runtime.environment()).map_err(refused)?;
        let builder = builder
            .with_execution_providers(dispatch(provider, precision, sha256))
            .map_err(|e| GeneratorError::Provider { provider, reason: e.message().to_owned() })?;
        // ONNX Runtime's idle threads would spin and take the processor from the renderer.
        let builder = builder.with_intra_threads(threads).map_err(|e| refused(e.into()))?;
        let builder = builder.with_intra_op_spinning(false).map_err(|e| refused(e.into()))?;
        let builder = builder.with_optimization_level(GraphOptimizationLevel::All).map_err(|e| refused(e.into()))?;
        let mut builder = builder.with_flush_to_zero().map_err(|e| refused(e.into()))?;
        let inner = builder.commit_from_memory(model).map_err(refused)?;
        let kinds = check_signature(&inner, manifest)
            .map_err(|reason| GeneratorError::Signature { path: path.to_owned(), reason })?;
        let options = RunOptions::new().map_err(refused)?;
        Ok(Self {
            inner,
            input_name: manifest.input.name.clone(),
            output_name: manifest.output.name.clone(),
            kinds,
            channels: manifest.tensor_channels(),
            provider,
            tensors: None,
            control: Arc::new(RunControl { options, state: Mutex::default() }),
        })
    }

    pub(super) fn terminator(&self) -> Terminator {
        Terminator(self.control.clone())
    }

    /// The input tensor, for the caller to fill. It is reallocated only if the size changes.
    pub(super) fn input(&mut self, geometry: &Geometry) -> Result<Planes<'_>, RunFailure> {
        if self.tensors.as_ref().is_none_or(|t| t.geometry != *geometry) {
            self.tensors = None;
            let [input, output] = self.kinds;
            let names = [(&*self.input_name, input), (&*self.output_name, output)];
            self.tensors = Some(Tensors::new(&self.inner, self.provider, geometry, self.channels, names)?);
        }
        match &mut self.tensors {
            Some(tensors) => Ok(tensors.planes()?),
            None => Err(RunFailure::Failed("no tensors".to_owned())),
        }
    }

    /// Runs the model on the input that [`Self::input`] filled, and returns the output.
    pub(super) fn run(&mut self) -> Result<Values<'_>, RunFailure> {
        let Some(tensors) = &mut self.tensors else { return Err(RunFailure::Failed("no input".to_owned())) };
        if self.provider != Provider::Cpu {
            tensors.bind_input(&self.input_name)?;
        }
        {
            let mut state = self.control.lock();
            self.control.options.unterminate()?;
            *state = RunState { number: state.number.wrapping_add(1), running: true, stopped: false };
        }
        let result = self.inner.run_binding_with_options(&tensors.binding, &self.control.options).map(drop);
        let stopped = {
            let mut state = self.control.lock();
            state.running = false;
            state.stopped
        };
        match result {
            Ok(()) => Ok(tensors.values()?),
            Err(_) if stopped => Err(RunFailure::Stopped),
            Err(e) => Err(e.into()),
        }
    }
}

/// Checks the SHA-256 of a model's file.
///
/// # Errors
/// The hash differs from `expected`, the hash in the manifest.
pub(super) fn check_hash(path: &Path, model: &[u8], expected: &str) -> Result<(), GeneratorError> {
    let found = hex(&Sha256::digest(model));
    if found.eq_ignore_ascii_case(expected) {
        return Ok(());
    }
    Err(GeneratorError::Sha256 { path: path.to_owned(), expected: expected.to_owned(), found })
}

/// Checks the model's tensors against the manifest. Returns the value types of input and output. The error describes
/// the difference.
fn check_signature(session: &ort::session::Session, manifest: &Manifest) -> Result<[Kind; 2], String> {
    let [input] = session.inputs() else {
        return Err(format!("it has {} inputs; a generator has one", session.inputs().len()));
    };
    let output = session.outputs().iter().find(|o| o.name() == manifest.output.name).ok_or_else(|| {
        let names: Vec<_> = session.outputs().iter().map(Outlet::name).collect();
        format!("it has no output `{}`; its outputs are {}", manifest.output.name, names.join(", "))
    })?;
    if input.name() != manifest.input.name {
        return Err(format!("its input is `{}`; the manifest says `{}`", input.name(), manifest.input.name));
    }
    Ok([check_tensor(input, manifest.tensor_channels())?, check_tensor(output, 1)?])
}

fn check_tensor(outlet: &Outlet, channels: usize) -> Result<Kind, String> {
    let name = outlet.name();
    let (kind, shape) = match outlet.dtype() {
        ValueType::Tensor { ty: TensorElementType::Float32, shape, .. } => (Kind::Floats, shape),
        ValueType::Tensor { ty: TensorElementType::Uint8, shape, .. } => (Kind::Bytes, shape),
        other => return Err(format!("`{name}` is {other}; it must be a tensor of float32 or uint8")),
    };
    let [batch, found, height, width] = shape[..] else {
        return Err(format!("`{name}` has {} dimensions; it must have 4", shape.len()));
    };
    // −1 stands for a dimension that the model leaves open.
    if !matches!(batch, -1 | 1) {
        return Err(format!("`{name}` has a batch of {batch}; it must be 1"));
    }
    if found != -1 && usize::try_from(found).ok() != Some(channels) {
        return Err(format!("`{name}` has {found} channels; the manifest's are {channels}"));
    }
    if (height, width) != (-1, -1) {
        return Err(format!("`{name}` has a fixed size of {height} x {width}; export it with open height and width"));
    }
    Ok(kind)
}
