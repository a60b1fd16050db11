//! Tests of the program as its users see it: commands, files, scenes, generators, the page.

// clippy.toml allows this in test functions only, not in their helpers.
#[allow(clippy::unwrap_used)]
#[path = "../program/mod.rs"]
mod program;

mod browser;
mod cli;
mod dataset;
mod exam;
mod examples;
mod files;
mod generator;
mod input;
mod plan;
mod segmentation;
