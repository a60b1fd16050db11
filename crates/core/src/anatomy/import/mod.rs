//! Import of scenes from glTF files.
//!
//! A **surface** is one triangle primitive of one node of the default scene (else the first scene, else every root
//! node).
//!
//! - Tissue: `extras.tissue` of its node, else of the node's mesh, else of the nearest ancestor that has one, else the
//!   name of its material. A suffix such as `.001`, which Blender adds to a name in use, is not part of a tissue's
//!   name.
//! - Priority: `extras.priority` (an integer) of its node, else of the mesh, else of the nearest ancestor, else 0. A
//!   mesh's extras apply to its nodes only, not to their children.
//! - Positions are in metres, as glTF prescribes, and are converted to mm of the scene frame.
//! - A surface should be closed. Usable defects are reported as [`Finding`]s.
//! - Axes: `extras.axes` of the glTF scene: `depth` (the default), `anatomical` or `lps` ([`Axes`](super::Axes)).
//! - Motion: `extras.motion` of the glTF scene ([`crate::anatomy::Motion`]). glTF's own animations, skins and morph
//!   targets are not applied.
//!
//! Buffers may be in the `.glb`, in files next to a `.gltf`, or in `data:` URIs. Compressed or quantised geometry
//! (extensions) is refused by name; extensions of appearance are ignored.

mod accessor;
mod document;
mod extensions;
mod scene_extras;
mod surface;
mod walk;

pub use document::files_of;
pub use surface::mesh_of_arrays;

use std::fmt;
use std::path::{Path, PathBuf};

use rayon::prelude::*;

pub(crate) use surface::{RawMesh, is_usable};

use super::export::SceneExtras;
use super::scene::SURFACES_MAX;
use super::{Scene, SceneError, TissueTable};
use crate::suggest::did_you_mean;

/// A defect in a file that was mended, skipped or merely noted.
#[derive(Debug, Clone, PartialEq)]
pub struct Finding {
    /// Name of the surface.
    pub surface: String,
    /// Kind of the finding.
    pub kind: FindingKind,
}

/// Kind of a finding about a surface.
#[derive(Debug, Clone, Copy, PartialEq, Eq)]
#[non_exhaustive]
pub enum FindingKind {
    /// Zero-area triangles, dropped.
    Degenerate {
        /// Number of triangles.
        triangles: usize,
    },
    /// A closed surface that faced inward; its triangles are reversed.
    InsideOut,
    /// Edges that have only one triangle, or two triangles of opposite orientation: the surface has no reliable inside.
    Open {
        /// Number of edges.
        edges: usize,
    },
    /// Closed parts of a surface that face inward and lie in no other part, so they are no cavities.
    Inward {
        /// Number of such parts.
        parts: usize,
        /// Number of all parts of the surface.
        of: usize,
    },
    /// Points or lines, skipped.
    NotTriangles,
    /// Surplus indices at the end of a triangle list, dropped.
    LeftOver {
        /// Number of indices.
        indices: usize,
    },
    /// Surface in which no triangle has an area; skipped.
    Empty,
    /// The node has a skin, which is not applied.
    Skin,
    /// Nodes with meshes that are not in the scene, skipped. The finding's `surface` names them.
    NotInScene {
        /// Number of nodes.
        nodes: usize,
    },
}

impl fmt::Display for Finding {
    fn fmt(&self, f: &mut fmt::Formatter<'_>) -> fmt::Result {
        let name = &self.surface;
        match self.kind {
            FindingKind::Degenerate { triangles } => {
                write!(f, "surface `{name}`: dropped {triangles} triangles without area")
            }
            FindingKind::InsideOut => write!(f, "surface `{name}` faced inward: turned over"),
            FindingKind::Open { edges } => {
                write!(
                    f,
                    "surface `{name}` is not closed or not wound consistently: {edges} unpaired edges; it is simulated \
                     wrongly (`insonify doctor` says where)"
                )
            }
            FindingKind::Inward { parts, of } => write!(
                f,
                "{parts} of the {of} parts of surface `{name}` face inward: they are simulated wrongly (`insonify doctor` \
                 says where)"
            ),
            FindingKind::NotTriangles => write!(f, "primitive `{name}` holds points or lines: left out"),
            FindingKind::LeftOver { indices } => {
                write!(f, "surface `{name}`: the last {indices} indices make no whole triangle: dropped")
            }
            FindingKind::Empty => write!(f, "surface `{name}` has no triangle with an area: left out"),
            FindingKind::Skin => write!(f, "surface `{name}` has a skin, which is not applied"),
            FindingKind::NotInScene { nodes } => {
                write!(f, "{nodes} nodes with meshes are not in `{name}`, the scene that is read: left out")
            }
        }
    }
}

/// Reads the scene of the `.glb` or `.gltf` file at `path`, logging each [`Finding`] as a warning.
///
/// `background` is the index in `tissues` of the tissue outside all surfaces.
///
/// # Errors
/// A file that cannot be read, or is not complete, valid glTF; a surface without a known tissue; invalid extras; a
/// vertex that is not finite or beyond ±1e5 mm; more than [`SURFACES_MAX`] surfaces; no triangle at all.
pub fn load(path: &Path, tissues: &TissueTable, background: usize) -> Result<Scene, SceneError> {
    let (scene, findings) = load_with_findings(path, tissues, background)?;
    for finding in findings {
        tracing::warn!(scene = %path.display(), "{finding}");
    }
    Ok(scene)
}

/// Reads a scene like [`load`], and returns the findings in the file's order instead of logging them.
///
/// # Errors
/// As [`load`].
pub fn load_with_findings(
    path: &Path,
    tissues: &TissueTable,
    background: usize,
) -> Result<(Scene, Vec<Finding>), SceneError> {
    let file = document::File::read(path)?;
    let mut findings = Vec::new();
    let mut problems = Vec::new();
    let parts = walk::parts(&file, &mut findings, &mut problems);
    if let Some(problem) = problems.into_iter().next() {
        return Err(problem);
    }
    if parts.len() > SURFACES_MAX {
        return Err(SceneError::TooManySurfaces { path: path.to_owned(), count: parts.len() });
    }
    surface::check_memory(&file, &parts)?;
    let tissue_of = parts.iter().map(|part| tissue_index(part, tissues, path)).collect::<Result<Vec<_>, _>>()?;
    let meshes: Vec<_> = parts.par_iter().map(|part| surface::mesh(&file, part)).collect();
    let mut surfaces = Vec::with_capacity(parts.len());
    for ((part, tissue), result) in parts.iter().zip(tissue_of).zip(meshes) {
        let (mesh, kinds) = result?;
        findings.extend(kinds.into_iter().map(|kind| Finding { surface: part.name.clone(), kind }));
        if !mesh.triangles.is_empty() {
            surfaces.push(super::Surface { name: part.name.clone(), tissue, priority: part.priority, mesh });
        }
    }
    if surfaces.is_empty() {
        return Err(SceneError::Empty { path: path.to_owned() });
    }
    let motion = scene_extras::motion(&file, surfaces.iter().map(|s| s.name.as_str()))?;
    let axes = scene_extras::axes(&file)?;
    let mut scene = Scene { tissues: tissues.clone(), background, surfaces, motion, axes };
    scene.sort_by_priority();
    Ok((scene, findings))
}

/// Axes of the scene in the `.glb` or `.gltf` file at `path`, without its surfaces.
///
/// # Errors
/// The file cannot be read, is not valid glTF, or its axes are unknown.
pub fn axes(path: &Path) -> Result<super::Axes, SceneError> {
    scene_extras::axes(&document::File::read(path)?)
}

/// Content of a file without any repair, for the [scene check](super::doctor).
pub struct RawScene {
    /// Surfaces in the order of the file.
    pub surfaces: Vec<RawSurface>,
    /// Findings about content that is skipped.
    pub(crate) findings: Vec<Finding>,
    /// Errors of nodes, extras, motion and axes for which [`load`] refuses the file.
    pub problems: Vec<SceneError>,
    /// Motion and axes; defaults where the file's values are wrong.
    pub extras: SceneExtras,
}

/// A surface of a file without any repair.
pub struct RawSurface {
    /// Name of the surface's node or mesh.
    pub name: String,
    /// Index of the surface's node.
    pub node: usize,
    /// Tissue named by the extras or the material.
    pub tissue: Option<String>,
    /// Priority where solids overlap: the highest wins.
    pub priority: i32,
    /// Mesh, or the reason for refusing it.
    pub mesh: Result<RawMesh, SceneError>,
}

/// Reads a file without mending anything. Only a file that is not complete, valid glTF is an error.
pub fn read_raw(path: &Path) -> Result<RawScene, SceneError> {
    let file = document::File::read(path)?;
    let (mut findings, mut problems) = (Vec::new(), Vec::new());
    let parts = walk::parts(&file, &mut findings, &mut problems);
    surface::check_memory(&file, &parts)?;
    let motion = scene_extras::motion(&file, parts.iter().map(|part| part.name.as_str()));
    let axes = scene_extras::axes(&file);
    let source = scene_extras::source(&file);
    let mut of = |problem: SceneError| problems.push(problem);
    let extras = SceneExtras {
        motion: motion.map_err(&mut of).unwrap_or_default(),
        axes: axes.map_err(&mut of).unwrap_or_default(),
        source,
    };
    let read = |part: walk::Part<'_>| {
        let mesh = surface::raw(&file, &part);
        RawSurface { name: part.name, node: part.node, tissue: part.tissue, priority: part.priority, mesh }
    };
    let surfaces = parts.into_par_iter().map(read).collect();
    Ok(RawScene { surfaces, findings, problems, extras })
}

/// Index in `tissues` of the tissue that a file calls `name`, with or without Blender's suffix; `None` if unknown.
pub(crate) fn tissue_named(name: &str, tissues: &TissueTable) -> Option<usize> {
    tissues.index_of(name).or_else(|| {
        let (base, number) = name.rsplit_once('.')?;
        let is_blenders = number.len() >= 3 && number.bytes().all(|b| b.is_ascii_digit());
        if is_blenders { tissues.index_of(base) } else { None }
    })
}

fn tissue_index(part: &walk::Part<'_>, tissues: &TissueTable, path: &Path) -> Result<usize, SceneError> {
    let (path, surface) = (PathBuf::from(path), part.name.clone());
    let Some(name) = &part.tissue else { return Err(SceneError::NoTissue { path, surface }) };
    tissue_named(name, tissues).ok_or_else(|| {
        let suggestion = did_you_mean(name, tissues.names().iter().map(String::as_str));
        SceneError::UnknownTissue { path, surface, tissue: name.clone(), suggestion }
    })
}
