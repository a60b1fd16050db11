//! Scenes from patients: label maps and meshes, by the library and by the command.

// clippy.toml allows these in test functions only, not in their helpers.
#![allow(clippy::unwrap_used)]

mod commands;
mod files;
mod frames;
mod labels;
mod mesh_meanings;
mod meshes;
mod shapes;
mod slicer;

#[path = "../program/mod.rs"]
mod program;
