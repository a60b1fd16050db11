//! Stand-in for the graphics device in a build without the feature `gpu`. It can't be opened.

use std::convert::Infallible;
use std::time::Duration;

use super::compute_device::ComputeDevice;
use super::configuration::FrameInputs;
use super::error::BackendError;
use super::maker::FrameMaker;
use super::trace_by::TraceBy;

/// A graphics device. No value of it exists.
#[derive(Debug, Clone)]
pub(super) struct Gpu(Infallible);

/// Shaders of a device: none.
#[derive(Debug, Clone, Default)]
#[cfg_attr(not(feature = "test-hooks"), allow(unreachable_pub, reason = "public in tests"))]
pub struct ShaderSet;

impl Gpu {
    pub(super) fn may_exist() -> bool {
        false
    }

    pub(super) fn open(_software: bool) -> Result<Self, BackendError> {
        Err(BackendError::NotBuilt)
    }

    pub(super) fn reopen(&self) -> Result<Self, BackendError> {
        match self.0 {}
    }

    pub(super) fn answering_within(self, _: Duration) -> Self {
        match self.0 {}
    }

    pub(super) fn with_frames_at_once(self, _: u32) -> Self {
        match self.0 {}
    }

    pub(super) fn has_trace_by_lanes(&self) -> bool {
        match self.0 {}
    }

    pub(super) fn tracing_by(self, _: TraceBy) -> Result<Self, BackendError> {
        match self.0 {}
    }

    pub(super) fn trace(&self) -> Option<String> {
        match self.0 {}
    }

    pub(super) fn maker(&self, _: FrameInputs<'_>, _: &ShaderSet) -> Result<Box<dyn FrameMaker>, BackendError> {
        match self.0 {}
    }

    pub(super) fn adapter_name(&self) -> String {
        match self.0 {}
    }

    pub(super) fn driver(&self) -> String {
        match self.0 {}
    }

    pub(super) fn compute_device(&self) -> ComputeDevice {
        match self.0 {}
    }

    pub(super) fn is_software(&self) -> bool {
        match self.0 {}
    }
}
