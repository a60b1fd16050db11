//! Tests of frames against wave theory, with reference data from independent programs, which README.md here names.

#![allow(clippy::unwrap_used, clippy::panic, reason = "a test fails by panicking")]

mod edges;
pub(crate) mod fixtures;
mod leaving;
mod needle;
mod refraction;
mod shadow;
