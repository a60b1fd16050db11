//! Scene: closed surfaces, each filled with a tissue, nested by priority in a background.

use std::path::PathBuf;

use thiserror::Error;

use super::motion::Motion;
use super::{Axes, Mesh, TissueTable};
use crate::files::FileError;
use crate::suggest::did_you_mean;

/// Largest number of surfaces in a scene: the state of a ray path has one bit per surface.
pub const SURFACES_MAX: usize = 256;

/// A closed surface and its tissue.
#[derive(Debug, Clone, PartialEq)]
pub struct Surface {
    /// Name of the glTF node.
    pub name: String,
    /// Index of its tissue in the scene's [`TissueTable`].
    pub tissue: usize,
    /// Priority: where closed surfaces overlap, the surface of highest priority is the medium; among equals, the later
    /// surface.
    pub priority: i32,
    /// Mesh of the surface, scene frame, mm.
    pub mesh: Mesh,
}

/// Surfaces in a background tissue.
#[derive(Debug, Clone, PartialEq)]
pub struct Scene {
    /// Tissues that the surfaces and the background may have.
    pub tissues: TissueTable,
    /// Index in `tissues` of the tissue outside all surfaces.
    pub background: usize,
    /// Surfaces, ascending in priority. Where several overlap, the last one is the medium.
    pub surfaces: Vec<Surface>,
    /// Motion of the surfaces.
    pub motion: Motion,
    /// Meaning of the scene's axes.
    pub axes: Axes,
}

/// Errors in reading a scene.
#[derive(Debug, Error)]
pub enum SceneError {
    /// The file could not be read.
    #[error(transparent)]
    File(#[from] FileError),
    /// Not a glTF file, or a truncated one.
    #[error("{path} is not a whole glTF file: {reason}")]
    Format {
        /// Path of the file.
        path: PathBuf,
        /// Fault of the file, in words.
        reason: String,
    },
    /// An unreadable file that the glTF refers to.
    #[error("cannot read {buffer}, a buffer of the scene {path}: {source}")]
    Buffer {
        /// Path of the file.
        path: PathBuf,
        /// Path of the unreadable file.
        buffer: PathBuf,
        /// Cause.
        source: std::io::Error,
    },
    /// Invalid extras of a node.
    #[error("`extras.{key}` of node `{node}` of {path} is {value}; it must be {expected}")]
    BadExtras {
        /// Path of the file.
        path: PathBuf,
        /// Name of the glTF node.
        node: String,
        /// Key in the extras.
        key: &'static str,
        /// JSON value found.
        value: String,
        /// Accepted values.
        expected: &'static str,
    },
    /// Invalid motion of the scene.
    #[error("`extras.motion` of the scene of {path}: {reason}")]
    BadMotion {
        /// Path of the file.
        path: PathBuf,
        /// Fault and correct form.
        reason: String,
    },
    /// Unknown axes of the scene.
    #[error("`extras.axes` of the scene of {path} is {value}; it must be `depth`, `anatomical` or `lps`")]
    BadAxes {
        /// Path of the file.
        path: PathBuf,
        /// JSON value found.
        value: String,
    },
    /// A surface with an unknown tissue.
    #[error("surface `{surface}` of {path} names the unknown tissue `{tissue}`{suggestion}")]
    UnknownTissue {
        /// Path of the file.
        path: PathBuf,
        /// Name of the surface's glTF node.
        surface: String,
        /// Name of the tissue looked up.
        tissue: String,
        /// Nearest known name, as text to append, or empty.
        suggestion: String,
    },
    /// A tissue that the scene's table lacks.
    #[error("{what} is of the unknown tissue `{tissue}`{suggestion}; the tissues are {known}")]
    TissueNotInTable {
        /// The surface, or the background, in words.
        what: String,
        /// Name of the tissue looked up.
        tissue: String,
        /// Nearest known name, as text to append, or empty.
        suggestion: String,
        /// Names of all tissues.
        known: String,
    },
    /// Neither the node nor its material names a tissue.
    #[error(
        "surface `{surface}` of {path} has no tissue: give its node `extras.tissue` or its material a tissue's name"
    )]
    NoTissue {
        /// Path of the file.
        path: PathBuf,
        /// Name of the surface's glTF node.
        surface: String,
    },
    /// More surfaces than a ray path can track.
    #[error(
        "{path} has {count} surfaces; at most {SURFACES_MAX} are traced: join disjoint parts of the same tissue and priority into one mesh"
    )]
    TooManySurfaces {
        /// Path of the file.
        path: PathBuf,
        /// Number of surfaces found.
        count: usize,
    },
    /// A file without any triangle.
    #[error("{path} holds no triangles")]
    Empty {
        /// Path of the file.
        path: PathBuf,
    },
    /// A scene larger than a body, likely in a wrong unit: an image would show no surface.
    #[error(
        "{path}: {what}, and no surface is thinner than {thinnest_mm:.0} mm, so an image {depth_mm:.0} mm deep shows \
         nothing: {remedy}"
    )]
    WrongUnit {
        /// Path of the file.
        path: PathBuf,
        /// Size found, and the factor by which it is likely wrong.
        what: String,
        /// Smallest extent of any surface along an axis, mm.
        thinnest_mm: f32,
        /// Depth of the image, mm.
        depth_mm: f64,
        /// Advice for the modelling program.
        remedy: &'static str,
    },
    /// A triangle with a vertex index that is out of range.
    #[error("triangle {triangle} of surface `{surface}` names vertex {index}; the surface has {vertices} vertices")]
    BadIndex {
        /// Name of the surface.
        surface: String,
        /// Index of the triangle.
        triangle: usize,
        /// Vertex index found.
        index: u32,
        /// Number of the surface's vertices.
        vertices: usize,
    },
    /// A vertex that is not finite or too far away.
    #[error(
        "vertex {vertex} of surface `{surface}` of {path} is {value:?} mm; coordinates must be finite and within ±1e5 mm"
    )]
    BadVertex {
        /// Path of the file.
        path: PathBuf,
        /// Name of the surface's glTF node.
        surface: String,
        /// Index of the vertex.
        vertex: usize,
        /// Coordinates of the vertex, mm.
        value: [f32; 3],
    },
}

impl Scene {
    /// A scene of the tissue `background` without surfaces. A renderer needs at least one surface: see [`Scene::add`].
    ///
    /// # Errors
    /// `tissues` lacks the background.
    pub fn new(tissues: TissueTable, background: &str) -> Result<Self, SceneError> {
        let background = tissue_of(&tissues, "the background", background)?;
        Ok(Self { tissues, background, surfaces: Vec::new(), motion: Motion::default(), axes: Axes::default() })
    }

    /// Adds a closed surface filled with `tissue`, after existing surfaces of the same or a lower priority.
    ///
    /// # Errors
    /// The scene's table lacks the tissue.
    pub fn add(&mut self, name: &str, tissue: &str, priority: i32, mesh: Mesh) -> Result<(), SceneError> {
        let tissue = tissue_of(&self.tissues, &format!("surface `{name}`"), tissue)?;
        let position = self.surfaces.partition_point(|surface| surface.priority <= priority);
        self.surfaces.insert(position, Surface { name: name.to_owned(), tissue, priority, mesh });
        Ok(())
    }

    /// Number of triangles of all surfaces.
    pub fn triangle_count(&self) -> usize {
        self.surfaces.iter().map(|s| s.mesh.triangles.len()).sum()
    }

    /// The scene with its surfaces moved to their positions at `time_s`; its drift is not applied.
    #[must_use]
    pub fn displaced(&self, time_s: f64) -> Self {
        let amounts: Vec<[f32; 2]> = self.motion.fields.iter().map(|f| f.amounts(time_s)).collect();
        let mut scene = self.clone();
        for surface in &mut scene.surfaces {
            let fields = self.motion.mask_of(&surface.name);
            surface.mesh.vertices_mm.iter_mut().for_each(|v| *v = self.motion.moved(*v, fields, &amounts));
        }
        scene
    }

    /// Sorts surfaces by priority, keeping the order among equals.
    pub fn sort_by_priority(&mut self) {
        self.surfaces.sort_by_key(|s| s.priority);
    }
}

/// Index of the tissue called `tissue`. Errors give `what` as the item of that tissue.
fn tissue_of(tissues: &TissueTable, what: &str, tissue: &str) -> Result<usize, SceneError> {
    tissues.index_of(tissue).ok_or_else(|| SceneError::TissueNotInTable {
        what: what.to_owned(),
        tissue: tissue.to_owned(),
        suggestion: did_you_mean(tissue, tissues.names().iter().map(String::as_str)),
        known: tissues.names().join(", "),
    })
}

#[cfg(test)]
mod tests {
    use super::*;

    #[test]
    fn surfaces_lie_in_the_order_of_their_priorities_and_unknown_tissues_are_named() {
        let mut scene = Scene::new(TissueTable::builtin().unwrap(), "liver").unwrap();
        for (name, priority) in [("b", 2), ("a", 1), ("c", 2)] {
            scene.add(name, "kidney", priority, Mesh::default()).unwrap();
        }
        assert_eq!(scene.surfaces.iter().map(|s| s.name.as_str()).collect::<String>(), "abc");
        let error = scene.add("d", "kidny", 1, Mesh::default()).unwrap_err().to_string();
        assert!(error.contains("surface `d`") && error.contains("did you mean `kidney`"), "{error}");
        let error = Scene::new(TissueTable::default(), "liver").unwrap_err().to_string();
        assert!(error.contains("the background") && error.contains("`liver`"), "{error}");
        assert_eq!(scene.surfaces.len(), 3);
    }
}
