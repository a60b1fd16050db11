//! Changes that tests make to passes, to check that the comparison with the f64 twins then fails.
#![cfg_attr(not(feature = "test-hooks"), allow(unreachable_pub, reason = "public in tests"))]

use super::device::ShaderSet;
use super::host::{ImageConstants, TraceConstants};

/// Shaders and constants of the passes; unchanged by default.
#[derive(Debug, Clone, Default)]
pub struct TestHooks {
    /// Shaders of a device.
    pub shaders: ShaderSet,
    /// Constants of the host's `locate` and `trace`.
    pub trace: TraceConstants,
    /// Constants of the host's other passes.
    pub image: ImageConstants,
}
