//! Tests of scenes from patients: label maps and meshes, by the library and by the command.

// clippy.toml allows these in test functions only, not in their helpers.
#![allow(clippy::unwrap_used, clippy::panic)]

#[cfg(unix)]
mod bombs;
mod commands;
mod files;
mod frames;
mod images;
mod labels;
mod mesh_meanings;
mod meshes;
mod naming;
mod shapes;
mod slicer;
