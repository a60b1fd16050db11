//! Tests of trackers and poses: decoders, sessions, recordings, estimation.

// clippy.toml allows this in test functions only, not in their helpers.
#[allow(clippy::unwrap_used)]
#[path = "../program/mod.rs"]
mod program;

mod interchange;
mod pose;
mod protocols;
mod recording;
mod trackers;
