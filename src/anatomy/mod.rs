//! What is scanned: closed surfaces of tissues.

pub mod analytic;
pub mod builtin;
pub mod bvh;
pub mod decimate;
pub mod exam;
pub mod export;
pub mod import;
pub mod mesh;
pub mod phantom;
pub mod scene;
pub mod specimens;
pub mod tissue;

pub use bvh::{Bvh, BvhError};
pub use mesh::Mesh;
pub use scene::{Scene, SceneError, Surface};
pub use tissue::{Tissue, TissueError, TissueTable};
