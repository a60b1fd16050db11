//! From the baseband of the scanlines to pixels, and the maps.

pub(super) mod detect;
pub(super) mod lateral;
pub(super) mod percentile;
pub(super) mod receive;
pub(super) mod scan_convert;
pub(super) mod section;
