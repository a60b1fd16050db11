//! Hard cases: inputs at which single precision, a missing guard or a naive formula fails.
//!
//! One file per family. Each case states what must hold: finite, in range, within tolerance of the f64 twin or of the
//! exact answer, bit-identical on repetition. Where f32 needs a remedy, the naive variant is shown failing beside it.
//! `cargo test --release --test simulation hard_cases:: -- --nocapture --test-threads 1 | grep '^|'` prints the table of the
//! documentation.

#![allow(clippy::unwrap_used, clippy::panic, reason = "clippy exempts test functions, but not the helpers they share")]

mod aperture;
mod common;
mod delays;
mod edges;
mod far;
mod incidence;
mod media;
mod metrics;
mod phase;
mod poses;
mod properties;
mod scale;
mod sizes;
mod slices;
mod surroundings;
mod triangles;
