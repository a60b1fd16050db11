//! Hard cases: inputs at which single precision, a missing guard or a naive formula fails.
//!
//! There is one file per family of cases. Each case states what must hold: numbers finite and in range, results within
//! tolerance of the f64 twin or of the exact answer, repetitions bit-identical. Where f32 needs a remedy, the naive
//! variant is shown to fail. `cargo test --release --test simulation hard_cases:: -- --nocapture --test-threads 1 |
//! grep '^|'` prints the documentation's table.

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
