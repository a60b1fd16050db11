//! Segmentations of patients: label maps and surfaces become scenes of closed surfaces.
//!
//! Patient frame: LPS as in DICOM, x left, y posterior, z superior, mm.

pub mod body;
pub mod classes;
pub mod conventions;
mod cover;
pub mod details;
pub mod from_labels;
pub mod from_meshes;
pub mod gain;
pub mod gather;
mod gather_error;
pub mod grid;
pub mod image;
pub mod inputs;
pub mod mask_folder;
pub mod meanings;
pub mod measure;
pub mod mesh_files;
pub mod meshing;
pub mod naming;
mod numbers;
pub mod part_kinds;
pub mod probe_choice;
pub mod repair;
pub mod repair_scene;
pub mod shape;
pub mod skin_points;
pub mod start;
pub mod station_text;
pub mod summary;
pub mod volume;
pub mod voxels;
pub mod windows;
