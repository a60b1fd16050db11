//! Scanned anatomy: scenes of closed tissue surfaces.

pub mod analytic;
mod axes;
pub mod bounds;
pub mod builtin;
pub mod bvh;
pub mod decimate;
pub mod doctor;
pub mod export;
pub mod groups;
pub mod import;
pub mod mesh;
pub mod motion;
pub mod organs;
pub mod planes;
pub mod ray;
pub mod scene;
pub mod sdf;
pub mod section;
pub mod skin;
pub mod specimens;
pub mod tissue;
mod wall;

pub use axes::Axes;
pub use bounds::Bounds;
pub use bvh::{Bvh, BvhError, SegmentSearch};
pub use mesh::Mesh;
pub use motion::Motion;
pub use scene::{Scene, SceneError, Surface};
pub use skin::Skin;
pub use tissue::{Tissue, TissueError, TissueTable};
pub use wall::Wall;
