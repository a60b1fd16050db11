//! Probe geometry, scanlines, beam and pulse.

mod probe;
mod sector;

pub use probe::{Probe, ProbeError, ProbeKind};
pub use sector::Sector;
