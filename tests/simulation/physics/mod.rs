//! Tests of the renderer against closed formulas of acoustics, on scenes of exactly known geometry.
//!
//! Everything is measured on frames: lines, maps and grey levels. No internals of the renderer are read.

#![allow(clippy::unwrap_used, clippy::panic, reason = "clippy exempts test functions, but not the helpers they share")]

mod bench;
mod contact;
mod elevation;
mod in_place;
mod interfaces;
mod look;
mod maps;
mod mistakes;
mod multiples;
mod points;
mod qa;
mod reflections;
mod refraction;
#[path = "../../../examples/make_scenes/scenes/mod.rs"]
#[allow(dead_code, reason = "other tests use the rest")]
mod scenes;
mod selftest;
mod sizes;
mod slice;
mod specimens;
mod speckle;
