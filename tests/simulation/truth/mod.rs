//! Frames against wave theory: fixtures of programs that are not ours. README.md here says which.

#![allow(clippy::unwrap_used, clippy::panic, reason = "a test fails by panicking")]

mod edges;
pub(crate) mod fixtures;
mod leaving;
mod refraction;
mod shadow;
