//! Hard cases: inputs at which single precision, a missing guard or a plain formula gives nonsense.
//!
//! One file a family. Each case says what must hold: finite, in range, within tolerance of the f64 twin or of the exact
//! answer, bit-identical on repeat. Where f32 needs help, the naive variant stands beside the remedy and is shown failing.
//! `cargo test --release --test hard_cases -- --nocapture --test-threads 1 | grep '^|'` prints ARCHITECTURE.md's table.

#![allow(clippy::unwrap_used, clippy::panic, reason = "clippy exempts test functions, but not the helpers they share")]

mod common;
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
mod surroundings;
mod triangles;
