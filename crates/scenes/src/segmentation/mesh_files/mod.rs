//! Mesh files of other programs: STL, OBJ, PLY, VTK polydata (`.vtk`, `.vtp`) and glTF.
//!
//! [`read_meshes`] reads triangles in the file's own unit and axes. [`placing`] then determines both from the file's
//! statements, or else from the names, sizes and positions of organs. The format is recognised by content, not by the
//! file's name.

mod cells;
mod draft;
mod error;
mod frame;
mod gltf;
mod hints;
mod obj;
pub mod placing;
mod ply;
mod scanner;
#[cfg(test)]
mod silent;
mod stl;
#[cfg(test)]
mod tests;
mod vtk;
mod vtp;
mod vtp_data;

use std::collections::{HashMap, HashSet};
use std::ops::Range;
use std::path::Path;

use glam::DVec3;

pub use error::{MeshFileError, Position};
pub use hints::FileHints;

use draft::{Draft, Finisher};
use error::Fault;
use insonify_core::anatomy::groups::Groups;
use insonify_core::files::{self, FileError, FileKind};

/// A mesh of a file.
#[derive(Debug, Clone, Default, PartialEq)]
pub struct NamedMesh {
    /// Name of the object, group or solid, else the file's name without its extension; unique in the file.
    pub name: String,
    /// Vertices in the file's unit and axes; no two have the same position.
    pub vertices: Vec<DVec3>,
    /// Vertex indices, each below `vertices.len()`.
    pub triangles: Vec<[u32; 3]>,
    /// Parts that the file distinguishes: groups of an object, or materials. Together they contain all triangles. Empty
    /// for a mesh without parts.
    pub parts: Vec<MeshPart>,
}

/// Part of a mesh: a group of an object, or a material.
#[derive(Debug, Clone, PartialEq, Eq)]
pub struct MeshPart {
    /// Name; empty for triangles without a group or material.
    pub name: String,
    /// Range of the mesh's triangles.
    pub triangles: Range<usize>,
}

impl NamedMesh {
    /// Whether shared vertices connect all parts, so that they form one surface.
    pub fn is_one_surface(&self) -> bool {
        let mut part_of = vec![u32::MAX; self.vertices.len()];
        let mut groups = Groups::new(self.parts.len());
        for (number, part) in (0..).zip(&self.parts) {
            for &vertex in self.triangles[part.triangles.clone()].iter().flatten() {
                let other = std::mem::replace(&mut part_of[vertex as usize], number);
                if other != u32::MAX {
                    groups.join(other, number);
                }
            }
        }
        groups.numbered().into_iter().all(|number| number == 0)
    }

    /// The parts as meshes with their own vertices; `name` gives the name of each. Without parts, the mesh itself.
    #[must_use]
    pub fn split(self, name: impl Fn(&MeshPart) -> String) -> Vec<Self> {
        if self.parts.is_empty() {
            return vec![self];
        }
        let mut finisher = Finisher::new(&self.vertices);
        let part = |part: &MeshPart| {
            let draft = Draft::named(name(part)).with(self.triangles[part.triangles.clone()].to_vec());
            finisher.finish(vec![draft], &self.name)
        };
        self.parts.iter().map(part).collect()
    }
}

/// Content of a mesh file.
#[derive(Debug, Clone, PartialEq)]
pub struct MeshFile {
    /// Meshes in the file's order, each with at least one triangle.
    pub meshes: Vec<NamedMesh>,
    /// Axes and unit, as far as the file states them.
    pub hints: FileHints,
}

/// Content of a file as read, before drafts become meshes.
#[derive(Debug, Default)]
struct Parsed {
    vertices: Vec<DVec3>,
    drafts: Vec<Draft>,
    /// Number of points and lines in the file, which are ignored.
    others: usize,
    hints: FileHints,
}

/// Extensions of the files that [`read_meshes`] reads.
pub const EXTENSIONS: [&str; 7] = ["stl", "obj", "ply", "vtk", "vtp", "glb", "gltf"];

/// Reads the meshes of a file.
///
/// # Errors
/// A file that cannot be read, has more than 2 GiB, is no mesh file, is damaged, or has no triangles.
pub fn read_meshes(path: &Path) -> Result<MeshFile, MeshFileError> {
    let read = FileError::at("read the mesh file", path);
    let bytes = files::read(path, FileKind::Mesh).map_err(read)?;
    let extension = path.extension().and_then(|e| e.to_str()).unwrap_or_default().to_lowercase();
    if let Some(kind) = picture(&bytes, path) {
        return Err(MeshFileError::Picture { path: path.to_owned(), kind });
    }
    let is_gltf = bytes.starts_with(b"glTF") || extension == "gltf" || extension == "glb";
    if is_gltf {
        drop(bytes);
        return finish(path, gltf::read(path)?);
    }
    decode(&bytes, path)
}

/// Meshes in `bytes`, the content of a file of any format except glTF. `path` gives the file's extension, and its name
/// in errors.
///
/// # Errors
/// Bytes that are not a mesh file, are damaged, or have no triangles.
pub fn decode(bytes: &[u8], path: &Path) -> Result<MeshFile, MeshFileError> {
    let extension = path.extension().and_then(|e| e.to_str()).unwrap_or_default().to_lowercase();
    let fault = |Fault { at, reason }| MeshFileError::Format { path: path.to_owned(), at, reason };
    if bytes.starts_with(b"\xff\xfe") || bytes.starts_with(b"\xfe\xff") {
        return Err(fault(Fault::byte(0, "the text is UTF-16: save it as UTF-8")));
    }
    // A UTF-8 byte order mark is not part of the first line.
    let bytes = bytes.strip_prefix(b"\xef\xbb\xbf").unwrap_or(bytes);
    let parse = format(bytes, &extension).ok_or_else(|| MeshFileError::Unknown { path: path.to_owned() })?;
    finish(path, parse(bytes).map_err(fault)?)
}

/// Reader of a format, for the bytes of a file.
type Parse = fn(&[u8]) -> Result<Parsed, Fault>;

/// Reader for the format that the content shows, else for the extension's format; `None` for unknown files.
fn format(bytes: &[u8], extension: &str) -> Option<Parse> {
    let start = bytes[..bytes.len().min(4096)].trim_ascii_start();
    if start.starts_with(b"ply\n") || start.starts_with(b"ply\r") {
        Some(ply::parse)
    } else if start.starts_with(b"# vtk DataFile") {
        Some(vtk::parse)
    } else if start.starts_with(b"<?xml") || start.starts_with(b"<VTKFile") {
        start.windows(8).any(|w| w == b"<VTKFile").then_some(vtp::parse)
    } else if extension == "obj" {
        Some(obj::parse)
    } else if stl::is_text(bytes) || stl::is_binary(bytes) || extension == "stl" {
        Some(stl::parse)
    } else {
        None
    }
}

/// Kind of a file that contains a picture or a volume; `None` for other files.
fn picture(bytes: &[u8], path: &Path) -> Option<&'static str> {
    let name = path.file_name().and_then(|name| name.to_str()).unwrap_or_default().to_lowercase();
    let nifti = [&b"n+1\0"[..], b"ni1\0"].iter().any(|magic| bytes.get(344..348) == Some(*magic));
    if nifti || name.ends_with(".nii") || name.ends_with(".nii.gz") {
        Some("a volume (NIfTI)")
    } else if bytes.starts_with(b"NRRD") || name.ends_with(".nrrd") || name.ends_with(".nhdr") {
        Some("a volume (NRRD)")
    } else if bytes.starts_with(b"\x89PNG") {
        Some("a picture (PNG)")
    } else if bytes.starts_with(b"\xff\xd8\xff") {
        Some("a picture (JPEG)")
    } else if bytes.starts_with(b"II*\0") || bytes.starts_with(b"MM\0*") {
        Some("a picture (TIFF)")
    } else if bytes.get(128..132) == Some(b"DICM") {
        Some("a picture or volume (DICOM)")
    } else if name.ends_with(".mha") || name.ends_with(".mhd") {
        Some("a volume (MetaImage)")
    } else if name.ends_with(".png") {
        Some("a picture (PNG)")
    } else {
        None
    }
}

fn finish(path: &Path, parsed: Parsed) -> Result<MeshFile, MeshFileError> {
    let Parsed { vertices, drafts, others, hints } = parsed;
    let stem = path.file_stem().and_then(|stem| stem.to_str()).unwrap_or("mesh");
    let mut finisher = Finisher::new(&vertices);
    let mut meshes: Vec<NamedMesh> =
        draft::by_mesh(drafts).into_iter().map(|drafts| finisher.finish(drafts, stem)).collect();
    if meshes.is_empty() {
        let found = match (others, vertices.len()) {
            (0, 0) => String::new(),
            (0, points) => format!(", only {points} points"),
            (others, points) => format!(", only {points} points and {others} lines or points drawn"),
        };
        return Err(MeshFileError::NoTriangles { path: path.to_owned(), found });
    }
    for mesh in &meshes {
        if let Some((vertex, at)) = mesh.vertices.iter().enumerate().find(|(_, at)| !at.is_finite()) {
            let (mesh, value) = (mesh.name.clone(), at.to_array());
            return Err(MeshFileError::NotFinite { path: path.to_owned(), mesh, vertex, value });
        }
    }
    make_unique(&mut meshes);
    Ok(MeshFile { meshes, hints })
}

/// Appends a number to the name of each mesh that has the name of an earlier mesh.
fn make_unique(meshes: &mut [NamedMesh]) {
    let mut taken: HashSet<String> = HashSet::new();
    let mut next: HashMap<String, usize> = HashMap::new();
    for mesh in meshes {
        if taken.insert(mesh.name.clone()) {
            continue;
        }
        let number = next.entry(mesh.name.clone()).or_insert(2);
        let name = loop {
            let name = format!("{}_{number}", mesh.name);
            *number += 1;
            if taken.insert(name.clone()) {
                break name;
            }
        };
        mesh.name = name;
    }
}
