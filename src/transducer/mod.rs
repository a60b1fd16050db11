//! Probe geometry, scanlines, beam and pulse.

mod housing;
mod probe;
mod sector;

pub use housing::housing;
pub use probe::{Probe, ProbeError, ProbeKind};
pub use sector::Sector;
