//! Probe geometry, scanlines, beam and pulse. The probe's settings are in [`settings`](mod@crate::settings).

mod aberration;
pub mod contact;
mod housing;
pub mod placement;
mod probe;
mod scan_geometry;
mod sector;

pub use aberration::aberration;
pub use contact::{Contact, touch};
pub use housing::housing;
pub use placement::{Misplacement, misplacement};
pub use probe::BLOCK_SAMPLES;
pub use scan_geometry::ScanGeometry;
pub use sector::Sector;

pub use crate::settings::{Probe, ProbeKind};
