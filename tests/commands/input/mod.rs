//! Tests of input files: glTF scenes and station files, valid and broken.

#![allow(clippy::unwrap_used, reason = "clippy exempts test functions, but not the helpers they share")]

mod broken_gltf;
mod builder;
mod doctor;
mod exporters;
mod gltf_files;
mod hostile_gltf;
#[path = "../../../examples/make_scenes/scenes/mod.rs"]
#[allow(dead_code, reason = "other tests use the rest")]
mod made_scenes;
mod moving_scenes;
mod scene_size;
mod scenes;
mod station_files;
