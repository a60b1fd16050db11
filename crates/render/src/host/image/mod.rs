//! From the scanlines' baseband to pixels, and the maps of tissue and attenuation.
//!
//! `lateral.rs`, `multiples.rs`, `receive.rs` and `detect.rs` make grey levels along scanlines. `section.rs` and `percentile.rs` make
//! the maps. `scan_convert.rs` turns both into pixels.

pub(super) mod detect;
pub(super) mod lateral;
pub(super) mod multiples;
pub(super) mod percentile;
pub(super) mod receive;
pub(super) mod scan_convert;
pub(super) mod section;
