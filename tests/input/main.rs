//! Input files: glTF scenes and station files, valid and broken.

#![allow(clippy::unwrap_used, reason = "clippy exempts test functions, but not the helpers they share")]

mod broken_gltf;
mod builder;
mod doctor;
mod exporters;
mod gltf_files;
mod moving_scenes;
mod scenes;
mod station_files;
