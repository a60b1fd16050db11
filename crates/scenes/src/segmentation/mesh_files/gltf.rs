//! glTF files, read by the scene's reader.

use std::collections::HashMap;
use std::path::Path;

use glam::DVec3;
use insonify_core::anatomy::Axes;
use insonify_core::anatomy::import::read_raw;

use super::Parsed;
use super::draft::Draft;
use super::error::MeshFileError;
use super::frame::{MeshAxes, Unit};

/// Millimetres per metre: [`read_raw`] converts the file's metres to mm.
const METRE_MM: f64 = 1000.0;

/// Meshes of the scene, one for each node. The primitives of a node are the parts of its mesh, named by their tissue or
/// material. Positions are in metres, y up.
pub(super) fn read(path: &Path) -> Result<Parsed, MeshFileError> {
    let scene = read_raw(path)?;
    if let Some(problem) = scene.problems.into_iter().next() {
        return Err(problem.into());
    }
    let mut parsed = Parsed::default();
    // Patient scenes written by insonify state their axes.
    let (axes, said) = match scene.extras.axes {
        Axes::Patient => (MeshAxes::Lps, "extras.axes: lps"),
        _ => (MeshAxes::YUp, "glTF is in metres, y up"),
    };
    parsed.hints.of_format = axes == MeshAxes::YUp;
    parsed.hints.axes = Some(axes);
    parsed.hints.unit = Some(Unit::M);
    parsed.hints.said = Some(said.to_owned());
    let mut name_of = HashMap::new();
    for surface in scene.surfaces {
        let mesh = surface.mesh?;
        // The scene reader appends a number to the names of a node's primitives. The mesh is named without the number.
        let name = || surface.name.strip_suffix("/0").unwrap_or(&surface.name).to_owned();
        let name: &String = name_of.entry(surface.node).or_insert_with(name);
        let first = parsed.vertices.len() as u32;
        parsed.vertices.extend(mesh.vertices_mm.iter().map(|v| v.as_dvec3() / METRE_MM));
        let triangles = mesh.triangles.iter().map(|t| t.map(|vertex| vertex + first)).collect();
        let (part, whole) = (Some(surface.tissue.unwrap_or_default()), Some(surface.node));
        parsed.drafts.push(Draft { part, whole, ..Draft::named(name).with(triangles) });
    }
    parsed.vertices.iter_mut().for_each(|v| *v += DVec3::ZERO);
    Ok(parsed)
}
