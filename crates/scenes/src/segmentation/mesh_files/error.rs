//! Errors of mesh files.

use std::fmt;
use std::path::PathBuf;

use insonify_core::anatomy::SceneError;
use insonify_core::files::FileError;

/// Position of a fault in a file.
#[derive(Debug, Clone, Copy, PartialEq, Eq)]
pub enum Position {
    /// Offset of a byte, from 0.
    Byte(usize),
    /// Number of a line, from 1.
    Line(usize),
}

impl fmt::Display for Position {
    fn fmt(&self, f: &mut fmt::Formatter<'_>) -> fmt::Result {
        match self {
            Self::Byte(byte) => write!(f, "byte {byte}"),
            Self::Line(line) => write!(f, "line {line}"),
        }
    }
}

/// Error in reading a mesh file.
#[derive(Debug, thiserror::Error)]
#[non_exhaustive]
pub enum MeshFileError {
    /// The file cannot be read, or has more than 2 GiB.
    #[error(transparent)]
    File(#[from] FileError),
    /// A picture or a volume instead of a mesh.
    #[error("{path} is {kind}, not a mesh: `insonify scene from-labels` reads label maps (NIfTI, NRRD)")]
    Picture {
        /// Path of the file.
        path: PathBuf,
        /// Kind of the file.
        kind: &'static str,
    },
    /// An unsupported format.
    #[error("{path} is of an unknown format: export it as STL, OBJ, PLY, VTK polydata (.vtk, .vtp) or glTF (.glb)")]
    Unknown {
        /// Path of the file.
        path: PathBuf,
    },
    /// A damaged file, or an unknown variant of the format.
    #[error("{path}, {at}: {reason}")]
    Format {
        /// Path of the file.
        path: PathBuf,
        /// Position of the fault.
        at: Position,
        /// Description of the fault, with its remedy if known.
        reason: String,
    },
    /// No triangle in the whole file.
    #[error("{path} has no triangles{found}: export the surface as a mesh with faces")]
    NoTriangles {
        /// Path of the file.
        path: PathBuf,
        /// Other content of the file, such as points, as text to append, or empty.
        found: String,
    },
    /// A vertex with a coordinate that is not finite.
    #[error("{path}: vertex {vertex} (from 0) of `{mesh}` is {value:?}; export the mesh again without it")]
    NotFinite {
        /// Path of the file.
        path: PathBuf,
        /// Name of the mesh.
        mesh: String,
        /// Index of the vertex.
        vertex: usize,
        /// Coordinates of the vertex.
        value: [f64; 3],
    },
    /// An error of a glTF file.
    #[error(transparent)]
    Scene(#[from] SceneError),
}

/// A fault at a position in the file.
#[derive(Debug)]
pub(super) struct Fault {
    pub(super) at: Position,
    pub(super) reason: String,
}

impl Fault {
    /// A fault at a byte.
    pub(super) fn byte(at: usize, reason: impl Into<String>) -> Self {
        Self { at: Position::Byte(at), reason: reason.into() }
    }

    /// A fault in a line.
    pub(super) fn line(at: usize, reason: impl Into<String>) -> Self {
        Self { at: Position::Line(at), reason: reason.into() }
    }
}
