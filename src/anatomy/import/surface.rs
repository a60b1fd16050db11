//! From a primitive to a mesh.

use std::collections::HashMap;

use glam::Vec3;
use gltf::Semantic;
use gltf::accessor::{DataType, Dimensions};
use gltf::mesh::Mode;

use super::document::File;
use super::walk::Part;
use super::{FindingKind, accessor};
use crate::anatomy::{Mesh, SceneError};
use crate::pose::POSITION_LIMIT_MM;

/// The mesh of `part` in the scene frame, mm: vertices of one position shared, no triangle without area, outward where
/// it is closed.
pub(super) fn mesh(file: &File, part: &Part<'_>) -> Result<(Mesh, Vec<FindingKind>), SceneError> {
    let in_part = |reason: String| file.format_error(format!("surface `{}`: {reason}", part.name));
    let mut findings = Vec::new();
    let positions = positions(file, part).map_err(in_part)?;
    let indices = indices(file, part, positions.len()).map_err(in_part)?;
    let mut mesh = Mesh::default();
    let welded = weld(file, part, &positions, &indices, &mut mesh.vertices_mm)?;
    let (triangles, left_over) = triangles(part.primitive.mode(), &indices);
    if left_over > 0 {
        findings.push(FindingKind::LeftOver { indices: left_over });
    }
    let total = triangles.len();
    let shared = triangles.into_iter().map(|t| t.map(|i| welded[i as usize]));
    mesh.triangles = shared.filter(|t| has_area(t.map(|i| mesh.vertices_mm[i as usize]))).collect();
    if mesh.triangles.is_empty() {
        findings.push(FindingKind::Empty);
        return Ok((mesh, findings));
    }
    if mesh.triangles.len() < total {
        findings.push(FindingKind::Degenerate { triangles: total - mesh.triangles.len() });
    }
    if part.mirrors() {
        mesh.flip();
    }
    match mesh.unpaired_edges() {
        0 if mesh.signed_volume_mm3() < 0.0 => {
            mesh.flip();
            findings.push(FindingKind::InsideOut);
        }
        0 => {}
        edges => findings.push(FindingKind::Open { edges }),
    }
    Ok((mesh, findings))
}

fn positions(file: &File, part: &Part<'_>) -> Result<Vec<[f32; 3]>, String> {
    let accessor = part.primitive.get(&Semantic::Positions).ok_or("it has no positions")?;
    accessor::check(&accessor, Dimensions::Vec3, &[DataType::F32], &file.buffers)?;
    let reader = part.primitive.reader(|buffer| file.buffers.get(buffer.index()).map(Vec::as_slice));
    Ok(reader.read_positions().ok_or("its positions cannot be read")?.collect())
}

/// Indices of vertices, each below `vertices`.
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

/// Appends the distinct vertices in use, in mm; the index of each position among them.
fn weld(
    file: &File,
    part: &Part<'_>,
    positions: &[[f32; 3]],
    indices: &[u32],
    vertices_mm: &mut Vec<Vec3>,
) -> Result<Vec<u32>, SceneError> {
    // Primitives often share one buffer of vertices, of which each uses a part.
    let mut used = vec![false; positions.len()];
    for &index in indices {
        used[index as usize] = true;
    }
    let mut index_at = HashMap::with_capacity(used.iter().filter(|u| **u).count());
    let mut welded = vec![0; positions.len()];
    for (vertex, &position) in positions.iter().enumerate().filter(|(vertex, _)| used[*vertex]) {
        let mm = part.scene_mm(position);
        if !mm.to_array().iter().all(|c| f64::from(c.abs()) <= POSITION_LIMIT_MM) {
            let (path, surface) = (file.path.clone(), part.name.clone());
            return Err(SceneError::BadVertex { path, surface, vertex, value: mm.to_array() });
        }
        // Adding zero makes −0 into 0.
        let key = (mm + Vec3::ZERO).to_array().map(f32::to_bits);
        let index = *index_at.entry(key).or_insert_with(|| {
            vertices_mm.push(mm);
            // There are no more distinct vertices than u32 indices address: `indices` saw to it.
            (vertices_mm.len() - 1) as u32
        });
        welded[vertex] = index;
    }
    Ok(welded)
}

/// Triangles of a list, strip or fan, wound as glTF says, and how many indices are left over.
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

fn has_area(corners: [Vec3; 3]) -> bool {
    let [a, b, c] = corners.map(|v| v.as_dvec3());
    (b - a).cross(c - a).length_squared() > 0.0
}
