//! Trackers and poses: decoders, sessions, recordings, estimation.

#[path = "../program/mod.rs"]
mod program;

mod interchange;
mod pose;
mod protocols;
mod recording;
mod trackers;
