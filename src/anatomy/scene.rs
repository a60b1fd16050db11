//! A scene: closed surfaces, each filled with a tissue, nested by priority in a background.

use std::path::PathBuf;

use thiserror::Error;

use super::motion::Motion;
use super::{Mesh, TissueTable};

/// Most surfaces of a scene: a path keeps one bit for each.
pub const SURFACES_MAX: usize = 256;

/// A closed surface and what fills it.
#[derive(Debug, Clone, PartialEq)]
pub struct Surface {
    /// Name of the glTF node.
    pub name: String,
    /// Index of its tissue in the scene's [`TissueTable`].
    pub tissue: usize,
    /// Where closed surfaces overlap, the highest priority is the medium; among equals the later surface.
    pub priority: i32,
    /// The surface, scene frame.
    pub mesh: Mesh,
}

/// Surfaces in a background tissue.
#[derive(Debug, Clone, PartialEq)]
pub struct Scene {
    /// Every tissue that the scene may refer to.
    pub tissues: TissueTable,
    /// Index of the tissue outside of every surface.
    pub background: usize,
    /// Surfaces, ascending in priority: a later one wins where they overlap.
    pub surfaces: Vec<Surface>,
    /// What moves, if anything.
    pub motion: Motion,
}

/// Why a scene could not be read.
#[derive(Debug, Error)]
pub enum SceneError {
    /// The file could not be read.
    #[error("cannot read the scene {path}: {source}")]
    Io {
        /// File.
        path: PathBuf,
        /// Cause.
        source: std::io::Error,
    },
    /// Not a glTF file, or a truncated one.
    #[error("{path} is not a whole glTF file: {reason}")]
    Format {
        /// File.
        path: PathBuf,
        /// What is wrong.
        reason: String,
    },
    /// A file that the glTF refers to could not be read.
    #[error("cannot read {buffer}, a buffer of the scene {path}: {source}")]
    Buffer {
        /// File.
        path: PathBuf,
        /// The buffer's file.
        buffer: PathBuf,
        /// Cause.
        source: std::io::Error,
    },
    /// A node's extras are not what they should be.
    #[error("`extras.{key}` of node `{node}` of {path} is {value}; it must be {expected}")]
    BadExtras {
        /// File.
        path: PathBuf,
        /// glTF node.
        node: String,
        /// Key.
        key: &'static str,
        /// JSON found.
        value: String,
        /// What would be right.
        expected: &'static str,
    },
    /// The scene's motion is not what it should be.
    #[error("`extras.motion` of the scene of {path}: {reason}")]
    BadMotion {
        /// File.
        path: PathBuf,
        /// What is wrong, and what would be right.
        reason: String,
    },
    /// A surface names a tissue that no table has.
    #[error("surface `{surface}` of {path} names the unknown tissue `{tissue}`{suggestion}")]
    UnknownTissue {
        /// File.
        path: PathBuf,
        /// glTF node.
        surface: String,
        /// Name looked up.
        tissue: String,
        /// Nearest known name, ready to print, or empty.
        suggestion: String,
    },
    /// Neither the node nor its material says what the tissue is.
    #[error(
        "surface `{surface}` of {path} has no tissue: give its node `extras.tissue` or its material a tissue's name"
    )]
    NoTissue {
        /// File.
        path: PathBuf,
        /// glTF node.
        surface: String,
    },
    /// More surfaces than a path can keep track of.
    #[error(
        "{path} has {count} surfaces; at most {SURFACES_MAX} are traced: join disjoint parts of the same tissue and priority into one mesh"
    )]
    TooManySurfaces {
        /// File.
        path: PathBuf,
        /// Surfaces found.
        count: usize,
    },
    /// No triangle at all.
    #[error("{path} holds no triangles")]
    Empty {
        /// File.
        path: PathBuf,
    },
    /// A vertex that is not a number, or too far away.
    #[error(
        "vertex {vertex} of surface `{surface}` of {path} is {value:?} mm; coordinates must be finite and within ±1e5 mm"
    )]
    BadVertex {
        /// File.
        path: PathBuf,
        /// glTF node.
        surface: String,
        /// Index of the vertex.
        vertex: usize,
        /// Its coordinates.
        value: [f32; 3],
    },
}

impl Scene {
    /// Triangles of all surfaces.
    pub fn triangle_count(&self) -> usize {
        self.surfaces.iter().map(|s| s.mesh.triangles.len()).sum()
    }

    /// Sorts surfaces so that a later one wins where they overlap, keeping the order among equal priorities.
    pub fn sort_by_priority(&mut self) {
        self.surfaces.sort_by_key(|s| s.priority);
    }
}
