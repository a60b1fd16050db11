//! Conversion of a glTF primitive to a mesh.

use std::collections::HashMap;
use std::path::Path;

use glam::Vec3;
use gltf::Semantic;
use gltf::accessor::{DataType, Dimensions};
use gltf::mesh::Mode;

use super::document::File;
use super::walk::Part;
use super::{Finding, FindingKind, accessor, extensions};
use crate::anatomy::{Bounds, Mesh, SceneError};
use crate::files::memory_for;
use crate::pose::POSITION_LIMIT_MM;

/// A glTF primitive without any repair.
pub struct RawMesh {
    /// All vertices of the accessor, scene frame, mm; the values are not checked.
    pub vertices_mm: Vec<Vec3>,
    /// Vertex indices of each triangle. Where the node's transform mirrors, their order is reversed, so the winding is
    /// kept.
    pub triangles: Vec<[u32; 3]>,
    /// Number of surplus indices at the end of a triangle list.
    pub(crate) left_over: usize,
}

/// Mesh of `part` without any repair.
pub(super) fn raw(file: &File, part: &Part<'_>) -> Result<RawMesh, SceneError> {
    let in_part = |reason: String| file.format_error(format!("surface `{}`: {reason}", part.name));
    let positions = positions(file, part).map_err(in_part)?;
    let indices = indices(file, part, positions.len()).map_err(in_part)?;
    let (mut triangles, left_over) = triangles(part.primitive.mode(), &indices);
    if part.mirrors() {
        triangles.iter_mut().for_each(|t| t.swap(1, 2));
    }
    let vertices_mm = positions.into_iter().map(|position| part.scene_mm(position)).collect();
    Ok(RawMesh { vertices_mm, triangles, left_over })
}

/// Checks that memory suffices for all parts together. Parts may share one accessor, so a small file can expand to a
/// lot of data.
pub(super) fn check_memory(file: &File, parts: &[Part<'_>]) -> Result<(), SceneError> {
    /// Memory of a vertex and of an index while they are read and merged, bytes.
    const VERTEX_BYTES: u64 = 64;
    const INDEX_BYTES: u64 = 16;
    let bytes = parts.iter().map(|part| {
        let of = |accessor: Option<gltf::Accessor<'_>>| accessor.map_or(0, |a| accessor::elements(&a, &file.buffers));
        let (vertices, indices) = (of(part.primitive.get(&Semantic::Positions)), of(part.primitive.indices()));
        let indices = if part.primitive.indices().is_some() { indices } else { vertices };
        VERTEX_BYTES.saturating_mul(vertices).saturating_add(INDEX_BYTES.saturating_mul(indices))
    });
    let needed = bytes.fold(0u64, u64::saturating_add);
    memory_for(needed)
        .map_err(|none| file.format_error(format!("{none}: its {} surfaces are too large; decimate them", parts.len())))
}

/// Mesh of `part` in the scene frame, mm: equal vertices merged, zero-area triangles dropped, facing outward if closed.
pub(super) fn mesh(file: &File, part: &Part<'_>) -> Result<(Mesh, Vec<FindingKind>), SceneError> {
    raw(file, part)?.mended(&file.path, &part.name)
}

/// Mesh of `surface` from arrays, mended like a mesh from a file: equal vertices merged, zero-area triangles dropped,
/// facing outward if closed. A finding reports an empty mesh.
///
/// # Errors
/// A triangle with a vertex index out of range, or a vertex in use that is not finite or beyond ±1e5 mm.
pub fn mesh_of_arrays(
    surface: &str,
    vertices_mm: Vec<Vec3>,
    triangles: Vec<[u32; 3]>,
) -> Result<(Mesh, Vec<Finding>), SceneError> {
    let vertices = vertices_mm.len();
    let is_beyond = |index: &u32| *index as usize >= vertices;
    let beyond = triangles.iter().enumerate().find_map(|(at, t)| t.iter().copied().find(is_beyond).map(|i| (at, i)));
    if let Some((triangle, index)) = beyond {
        return Err(SceneError::BadIndex { surface: surface.to_owned(), triangle, index, vertices });
    }
    let raw = RawMesh { vertices_mm, triangles, left_over: 0 };
    let (mesh, kinds) = raw.mended(Path::new("the arrays"), surface)?;
    Ok((mesh, kinds.into_iter().map(|kind| Finding { surface: surface.to_owned(), kind }).collect()))
}

/// Number of unpaired edges with or without the `fillers` of T-junctions, whichever is lower.
fn unpaired_edges(mesh: &mut Mesh, fillers: &[[u32; 3]]) -> usize {
    let without = mesh.unpaired_edges();
    if without == 0 || fillers.is_empty() {
        return without;
    }
    let count = mesh.triangles.len();
    mesh.triangles.extend(fillers);
    let with = mesh.unpaired_edges();
    mesh.triangles.truncate(count);
    without.min(with)
}

/// Volume below which an inward part is not reported, as a fraction of the surface's volume.
const FRAGMENT: f64 = 1e-4;

/// Largest number of parts for the check of inward parts, which compares each part with all others.
const PARTS_MAX: usize = 1000;

/// Finding about parts of a closed mesh that face inward and lie outside the bounds of every outward part. A cavity
/// lies within an outward part.
fn inward_parts(mesh: &Mesh) -> Option<FindingKind> {
    let (part_of, of) = mesh.pieces();
    if !(2..=PARTS_MAX).contains(&of) {
        return None;
    }
    let mut parts = vec![(Bounds::EMPTY, 0.0); of];
    for (corners, part) in mesh.corners_mm().zip(part_of) {
        let (bounds, volume) = &mut parts[part as usize];
        *bounds = corners.into_iter().fold(*bounds, Bounds::with);
        let [a, b, c] = corners.map(|v| v.as_dvec3());
        *volume += a.dot(b.cross(c)) / 6.0;
    }
    let whole = mesh.signed_volume_mm3();
    let outward: Vec<Bounds> = parts.iter().filter(|(_, v)| *v > 0.0).map(|(bounds, _)| *bounds).collect();
    let is_inward = |(bounds, volume): &&(Bounds, f64)| {
        *volume < -FRAGMENT * whole && !outward.iter().any(|other| other.holds(*bounds))
    };
    let parts = parts.iter().filter(is_inward).count();
    (parts > 0).then_some(FindingKind::Inward { parts, of })
}

impl RawMesh {
    /// Usable mesh, and the defects that were mended. Errors name `path` and `surface`.
    fn mended(&self, path: &Path, surface: &str) -> Result<(Mesh, Vec<FindingKind>), SceneError> {
        if let Some(vertex) = self.bad_vertices().next() {
            let (path, surface) = (path.to_owned(), surface.to_owned());
            let value = self.vertices_mm[vertex].to_array();
            return Err(SceneError::BadVertex { path, surface, vertex, value });
        }
        let mut findings = Vec::new();
        if self.left_over > 0 {
            findings.push(FindingKind::LeftOver { indices: self.left_over });
        }
        let mut mesh = self.welded();
        let total = mesh.triangles.len();
        let fillers = mesh.drop_flat();
        if mesh.triangles.is_empty() {
            findings.push(FindingKind::Empty);
            return Ok((mesh, findings));
        }
        if mesh.triangles.len() < total {
            findings.push(FindingKind::Degenerate { triangles: total - mesh.triangles.len() });
        }
        match unpaired_edges(&mut mesh, &fillers) {
            0 => {
                if mesh.signed_volume_mm3() < 0.0 {
                    mesh.flip();
                    findings.push(FindingKind::InsideOut);
                }
                findings.extend(inward_parts(&mesh));
            }
            edges => findings.push(FindingKind::Open { edges }),
        }
        Ok((mesh, findings))
    }

    /// Whether each vertex belongs to a triangle: primitives often use only a part of a shared buffer.
    fn used(&self) -> Vec<bool> {
        let mut used = vec![false; self.vertices_mm.len()];
        for &index in self.triangles.iter().flatten() {
            used[index as usize] = true;
        }
        used
    }

    /// Indices of vertices in use that are not finite or too far away.
    pub(crate) fn bad_vertices(&self) -> impl Iterator<Item = usize> + '_ {
        let used = self.used();
        let numbered = self.vertices_mm.iter().enumerate();
        numbered.filter(move |(index, v)| used[*index] && !is_usable(**v)).map(|(index, _)| index)
    }

    /// Mesh with one vertex for each distinct position that triangles use; keeps zero-area triangles.
    pub(crate) fn welded(&self) -> Mesh {
        let used = self.used();
        let mut index_at = HashMap::with_capacity(used.iter().filter(|u| **u).count());
        let mut mesh = Mesh::default();
        let mut welded = vec![0; self.vertices_mm.len()];
        for (vertex, &mm) in self.vertices_mm.iter().enumerate().filter(|(vertex, _)| used[*vertex]) {
            // Adding zero turns −0 into 0.
            let key = (mm + Vec3::ZERO).to_array().map(f32::to_bits);
            welded[vertex] = *index_at.entry(key).or_insert_with(|| {
                mesh.vertices_mm.push(mm);
                // `indices` ensured that all vertex numbers fit into u32.
                (mesh.vertices_mm.len() - 1) as u32
            });
        }
        mesh.triangles = self.triangles.iter().map(|t| t.map(|i| welded[i as usize])).collect();
        mesh
    }
}

/// Whether a vertex is finite and within the scene's limits.
pub(crate) fn is_usable(vertex_mm: Vec3) -> bool {
    vertex_mm.to_array().iter().all(|c| f64::from(c.abs()) <= POSITION_LIMIT_MM)
}

fn positions(file: &File, part: &Part<'_>) -> Result<Vec<[f32; 3]>, String> {
    let accessor = part.primitive.get(&Semantic::Positions).ok_or("it has no positions")?;
    if accessor.dimensions() == Dimensions::Vec3 && accessor.data_type() != DataType::F32 {
        return Err(extensions::quantised(accessor.index(), accessor.data_type()));
    }
    accessor::check(&accessor, Dimensions::Vec3, &[DataType::F32], &file.buffers)?;
    let reader = part.primitive.reader(|buffer| file.buffers.get(buffer.index()).map(Vec::as_slice));
    Ok(reader.read_positions().ok_or("its positions cannot be read")?.collect())
}

/// Vertex indices, each below `vertices`.
fn indices(file: &File, part: &Part<'_>, vertices: usize) -> Result<Vec<u32>, String> {
    let Some(accessor) = part.primitive.indices() else {
        return (0..vertices).map(|i| u32::try_from(i).map_err(|_| format!("{vertices} vertices"))).collect();
    };
    let types = [DataType::U8, DataType::U16, DataType::U32];
    accessor::check(&accessor, Dimensions::Scalar, &types, &file.buffers)?;
    let reader = part.primitive.reader(|buffer| file.buffers.get(buffer.index()).map(Vec::as_slice));
    let indices: Vec<u32> = reader.read_indices().ok_or("its indices cannot be read")?.into_u32().collect();
    match indices.iter().find(|&&i| i as usize >= vertices) {
        Some(index) => Err(format!("index {index} of {vertices} vertices")),
        None => Ok(indices),
    }
}

/// Triangles of a list, strip or fan, wound as glTF prescribes, and the number of surplus indices at the end.
fn triangles(mode: Mode, indices: &[u32]) -> (Vec<[u32; 3]>, usize) {
    let too_few = if indices.len() < 3 { indices.len() } else { 0 };
    match mode {
        Mode::TriangleStrip => {
            let turned = |(i, w): (usize, &[u32])| if i % 2 == 0 { [w[0], w[1], w[2]] } else { [w[0], w[2], w[1]] };
            (indices.windows(3).enumerate().map(turned).collect(), too_few)
        }
        Mode::TriangleFan => {
            let rim = indices.get(1..).unwrap_or_default();
            (rim.windows(2).map(|w| [w[0], w[1], indices[0]]).collect(), too_few)
        }
        _ => {
            let (whole, rest) = indices.as_chunks::<3>();
            (whole.to_vec(), rest.len())
        }
    }
}

impl Mesh {
    /// Corners of the first zero-area triangle, mm.
    pub(crate) fn first_flat(&self) -> Option<[Vec3; 3]> {
        self.corners_mm().find(|corners| !has_area(*corners))
    }

    /// Drops zero-area triangles. Returns the dropped triangles with three distinct vertices: such a triangle closes a
    /// T-junction, between a long edge and both its halves.
    pub(crate) fn drop_flat(&mut self) -> Vec<[u32; 3]> {
        let Self { vertices_mm, triangles } = self;
        let is_flat = |t: &mut [u32; 3]| !has_area(t.map(|i| vertices_mm[i as usize]));
        triangles.extract_if(.., is_flat).filter(|[a, b, c]| a != b && b != c && c != a).collect()
    }
}

fn has_area(corners: [Vec3; 3]) -> bool {
    let [a, b, c] = corners.map(|v| v.as_dvec3());
    (b - a).cross(c - a).length_squared() > 0.0
}
