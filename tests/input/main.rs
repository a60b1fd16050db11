//! What comes in from files: glTF scenes and station files, sound and broken.

mod broken_gltf;
mod builder;
mod gltf_files;
mod scenes;
mod station_files;
