//! Tensors of a session, kept between runs.

use ort::memory::{AllocationDevice, Allocator, AllocatorType, MemoryInfo, MemoryType};
use ort::session::{IoBinding, Session};
use ort::value::Tensor;

use super::Provider;
use super::maps::Geometry;
use super::tensor_values::{Planes, Values};

/// Type of a tensor's values.
#[derive(Debug, Clone, Copy, PartialEq, Eq)]
pub(super) enum Kind {
    /// float32.
    Floats,
    /// uint8.
    Bytes,
}

/// A tensor in memory that the processor can read and write.
enum Kept {
    Floats(Tensor<f32>),
    Bytes(Tensor<u8>),
}

impl Kept {
    /// Allocates a tensor filled with zeros, because fresh memory is uninitialised.
    fn zeros(kind: Kind, allocator: &Allocator, shape: [usize; 4]) -> Result<Self, ort::Error> {
        Ok(match kind {
            Kind::Floats => {
                let mut tensor = Tensor::<f32>::new(allocator, shape)?;
                tensor.try_extract_tensor_mut::<f32>()?.1.fill(0.0);
                Self::Floats(tensor)
            }
            Kind::Bytes => {
                let mut tensor = Tensor::<u8>::new(allocator, shape)?;
                tensor.try_extract_tensor_mut::<u8>()?.1.fill(0);
                Self::Bytes(tensor)
            }
        })
    }
}

/// Input and output tensors for one frame size.
pub(super) struct Tensors {
    pub(super) geometry: Geometry,
    pub(super) binding: IoBinding,
    input: Kept,
    output: Kept,
}

impl Tensors {
    /// Allocates the tensors of a session, and binds them to its input and output by name.
    pub(super) fn new(
        session: &Session,
        provider: Provider,
        geometry: &Geometry,
        channels: usize,
        [(input_name, input), (output_name, output)]: [(&str, Kind); 2],
    ) -> Result<Self, ort::Error> {
        let [to_model, from_model] = allocators(session, provider);
        let shape = |channels: usize| [1, channels, geometry.padded_height, geometry.padded_width];
        let input = Kept::zeros(input, &to_model, shape(channels))?;
        let mut output = Kept::zeros(output, &from_model, shape(1))?;
        let mut binding = session.create_binding()?;
        match &mut output {
            Kept::Floats(tensor) => binding.bind_output(output_name, tensor)?,
            Kept::Bytes(tensor) => binding.bind_output(output_name, tensor)?,
        };
        let mut tensors = Self { geometry: *geometry, binding, input, output };
        tensors.bind_input(input_name)?;
        Ok(tensors)
    }

    /// Binds the input tensor. If the device has its own memory, this copies the input.
    pub(super) fn bind_input(&mut self, name: &str) -> Result<(), ort::Error> {
        match &self.input {
            Kept::Floats(tensor) => self.binding.bind_input(name, tensor),
            Kept::Bytes(tensor) => self.binding.bind_input(name, tensor),
        }
    }

    /// The input tensor, for the caller to fill.
    pub(super) fn planes(&mut self) -> Result<Planes<'_>, ort::Error> {
        Ok(match &mut self.input {
            Kept::Floats(tensor) => Planes::Floats(tensor.try_extract_tensor_mut::<f32>()?.1),
            Kept::Bytes(tensor) => Planes::Bytes(tensor.try_extract_tensor_mut::<u8>()?.1),
        })
    }

    /// The output tensor of the last run.
    pub(super) fn values(&self) -> Result<Values<'_>, ort::Error> {
        Ok(match &self.output {
            Kept::Floats(tensor) => Values::Floats(tensor.try_extract_tensor::<f32>()?.1),
            Kept::Bytes(tensor) => Values::Bytes(tensor.try_extract_tensor::<u8>()?.1),
        })
    }
}

/// Allocators for input and output: pinned memory, from and to which a GPU copies directly. Without pinned memory,
/// ordinary memory is used.
fn allocators(session: &Session, provider: Provider) -> [Allocator; 2] {
    let pinned = |kind: MemoryType| {
        let info = MemoryInfo::new(AllocationDevice::CUDA_PINNED, 0, AllocatorType::Device, kind)?;
        Allocator::new(session, info)
    };
    if provider == Provider::Cpu {
        return [Allocator::default(), Allocator::default()];
    }
    match (pinned(MemoryType::CPUInput), pinned(MemoryType::CPUOutput)) {
        (Ok(input), Ok(output)) => [input, output],
        (Err(error), _) | (_, Err(error)) => {
            tracing::debug!("tensors are not in pinned memory: {}", error.message());
            [Allocator::default(), Allocator::default()]
        }
    }
}

#[cfg(test)]
mod tests {
    use super::super::Runtime;
    use super::*;

    #[test]
    fn without_pinned_memory_the_processors_serves() {
        let model = include_bytes!("../../tests/data/generators/identity.onnx");
        // This unit test is skipped where `scripts/setup` didn't install the library.
        let Ok(runtime) = Runtime::get() else { return eprintln!("no ONNX Runtime: not tested") };
        let session = Session::builder(runtime.environment()).unwrap().commit_from_memory(model).unwrap();
        for provider in [Provider::Cpu, Provider::Cuda] {
            let names = [("input", Kind::Floats), ("output", Kind::Floats)];
            let mut tensors = Tensors::new(&session, provider, &Geometry::new(5, 3, 4), 2, names).unwrap();
            assert!(matches!(tensors.planes().unwrap(), Planes::Floats(values) if values.len() == 2 * 8 * 4));
            assert!(matches!(tensors.values().unwrap(), Values::Floats(values) if values.len() == 8 * 4));
        }
    }
}
