//! ONNX session: one model in ONNX Runtime, with tensors kept between runs.

use std::fmt;
use std::path::Path;
use std::sync::{Arc, Mutex, MutexGuard, PoisonError};

use ort::ep::{self, ExecutionProviderDispatch};
use ort::memory::Allocator;
use ort::session::builder::GraphOptimizationLevel;
use ort::session::{IoBinding, RunOptions};
use ort::value::{Outlet, Tensor, TensorElementType, ValueType};
use sha2::{Digest, Sha256};

use super::maps::Geometry;
use super::{GeneratorError, Manifest, Provider, Runtime};
use crate::files::hex;

/// Stops a run from another thread.
#[derive(Clone)]
pub struct Terminator(Arc<RunControl>);

impl fmt::Debug for Terminator {
    fn fmt(&self, f: &mut fmt::Formatter<'_>) -> fmt::Result {
        f.debug_struct("Terminator").field("running", &self.running()).finish()
    }
}

impl Terminator {
    /// Number of the run in progress, counted from 1; None if there is none.
    pub fn running(&self) -> Option<u64> {
        let state = self.0.lock();
        state.running.then_some(state.number)
    }

    /// Stops the run in progress: it ends with [`GeneratorError::Terminated`] after its current operation at the
    /// latest. Returns whether there was one. Later runs are not affected.
    pub fn terminate(&self) -> bool {
        self.stop(None)
    }

    /// As [`Terminator::terminate`], but only if the run in progress has this number.
    pub fn terminate_run(&self, number: u64) -> bool {
        self.stop(Some(number))
    }

    fn stop(&self, number: Option<u64>) -> bool {
        let mut state = self.0.lock();
        if !state.running || number.is_some_and(|n| n != state.number) {
            return false;
        }
        // Under the lock, so that it cannot stop the next run.
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

/// Tensors of one size.
struct Tensors {
    geometry: Geometry,
    binding: IoBinding,
    input: Tensor<f32>,
    output: Tensor<f32>,
}

/// One model, ready to run.
pub(super) struct Session {
    inner: ort::session::Session,
    input_name: String,
    output_name: String,
    channels: usize,
    tensors: Option<Tensors>,
    control: Arc<RunControl>,
    /// Set for devices with their own memory: binding copies the input.
    bind_each_run: bool,
}

impl Session {
    pub(super) fn new(
        runtime: &Runtime,
        path: &Path,
        model: &[u8],
        manifest: &Manifest,
        provider: Provider,
        threads: usize,
    ) -> Result<Self, GeneratorError> {
        let refused = |e: ort::Error| GeneratorError::Model { path: path.to_owned(), reason: e.message().to_owned() };
        let builder = ort::session::Session::builder(runtime.environment()).map_err(refused)?;
        let builder = builder
            .with_execution_providers(dispatch(provider))
            .map_err(|e| GeneratorError::Provider { provider, reason: e.message().to_owned() })?;
        // Waiting threads that spin would take the processors from the renderer.
        let builder = builder.with_intra_threads(threads).map_err(|e| refused(e.into()))?;
        let builder = builder.with_intra_op_spinning(false).map_err(|e| refused(e.into()))?;
        let builder = builder.with_optimization_level(GraphOptimizationLevel::All).map_err(|e| refused(e.into()))?;
        let mut builder = builder.with_flush_to_zero().map_err(|e| refused(e.into()))?;
        let inner = builder.commit_from_memory(model).map_err(refused)?;
        check_signature(&inner, manifest)
            .map_err(|reason| GeneratorError::Signature { path: path.to_owned(), reason })?;
        let options = RunOptions::new().map_err(refused)?;
        Ok(Self {
            inner,
            input_name: manifest.input.name.clone(),
            output_name: manifest.output.name.clone(),
            channels: manifest.tensor_channels(),
            tensors: None,
            control: Arc::new(RunControl { options, state: Mutex::default() }),
            bind_each_run: provider != Provider::Cpu,
        })
    }

    pub(super) fn terminator(&self) -> Terminator {
        Terminator(self.control.clone())
    }

    /// The input tensor [channels × padded height × padded width], for the caller to fill; reallocated only if the size
    /// changed.
    pub(super) fn input(&mut self, geometry: &Geometry) -> Result<&mut [f32], RunFailure> {
        if self.tensors.as_ref().is_none_or(|t| t.geometry != *geometry) {
            self.tensors = None;
            self.tensors = Some(self.make_tensors(geometry)?);
        }
        match &mut self.tensors {
            Some(tensors) => Ok(tensors.input.extract_tensor_mut().1),
            None => Err(RunFailure::Failed("no tensors".to_owned())),
        }
    }

    fn make_tensors(&self, geometry: &Geometry) -> Result<Tensors, RunFailure> {
        let allocator = Allocator::default();
        let shape = |channels: usize| [1, channels, geometry.padded_height, geometry.padded_width];
        let mut input = Tensor::<f32>::new(&allocator, shape(self.channels))?;
        // Fresh memory is uninitialised.
        input.extract_tensor_mut().1.fill(0.0);
        let mut output = Tensor::<f32>::new(&allocator, shape(1))?;
        output.extract_tensor_mut().1.fill(0.0);
        let mut binding = self.inner.create_binding()?;
        binding.bind_input(&*self.input_name, &input)?;
        binding.bind_output(&*self.output_name, &mut output)?;
        Ok(Tensors { geometry: *geometry, binding, input, output })
    }

    /// Runs the model on the filled input and returns the output [padded height × padded width].
    pub(super) fn run(&mut self) -> Result<&[f32], RunFailure> {
        let Some(tensors) = &mut self.tensors else { return Err(RunFailure::Failed("no input".to_owned())) };
        if self.bind_each_run {
            tensors.binding.bind_input(&*self.input_name, &tensors.input)?;
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
            Ok(()) => Ok(tensors.output.extract_tensor().1),
            Err(_) if stopped => Err(RunFailure::Stopped),
            Err(e) => Err(e.into()),
        }
    }
}

/// Providers to request from ONNX Runtime; empty for the CPU.
fn dispatch(provider: Provider) -> Vec<ExecutionProviderDispatch> {
    let cuda = || ep::CUDA::default().build().error_on_failure();
    match provider {
        Provider::Cpu => Vec::new(),
        Provider::Cuda => vec![cuda()],
        Provider::TensorRt => vec![ep::TensorRT::default().build().error_on_failure(), cuda()],
    }
}

/// Checks the sum of a model's file.
///
/// # Errors
/// The file is another than its manifest is of.
pub(super) fn check_hash(path: &Path, model: &[u8], expected: &str) -> Result<(), GeneratorError> {
    let found = hex(&Sha256::digest(model));
    if found.eq_ignore_ascii_case(expected) {
        return Ok(());
    }
    Err(GeneratorError::Sha256 { path: path.to_owned(), expected: expected.to_owned(), found })
}

/// Checks the model's tensors against the manifest; the error is the difference.
fn check_signature(session: &ort::session::Session, manifest: &Manifest) -> Result<(), String> {
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
    check_tensor(input, manifest.tensor_channels())?;
    check_tensor(output, 1)
}

fn check_tensor(outlet: &Outlet, channels: usize) -> Result<(), String> {
    let name = outlet.name();
    let ValueType::Tensor { ty: TensorElementType::Float32, shape, .. } = outlet.dtype() else {
        return Err(format!("`{name}` is {}; it must be a tensor of float32", outlet.dtype()));
    };
    let [batch, found, height, width] = shape[..] else {
        return Err(format!("`{name}` has {} dimensions; it must have 4", shape.len()));
    };
    // -1 is a dimension that the model leaves open.
    if !matches!(batch, -1 | 1) {
        return Err(format!("`{name}` has a batch of {batch}; it must be 1"));
    }
    if found != -1 && usize::try_from(found).ok() != Some(channels) {
        return Err(format!("`{name}` has {found} channels; the manifest's are {channels}"));
    }
    if (height, width) != (-1, -1) {
        return Err(format!("`{name}` has a fixed size of {height} x {width}; export it with open height and width"));
    }
    Ok(())
}
