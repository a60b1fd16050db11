//! Repair of the surfaces of a scene file.

use std::path::Path;

use insonify_core::anatomy::export::{LabelledSurface, SceneExtras};
use insonify_core::anatomy::import::read_raw;
use insonify_core::anatomy::{Mesh, SceneError};

use super::repair::{RepairSettings, SurfaceRepair, repair};

/// Repairs the surfaces of the scene at `path` one by one. Returns the repaired surfaces that have a triangle left, and
/// a report on each surface. `progress` receives the number of surfaces done and their total.
///
/// # Errors
/// A file that is not complete, valid glTF; a surface that cannot be read or has no tissue.
pub fn repair_scene(
    path: &Path,
    settings: &RepairSettings,
    progress: &dyn Fn(usize, usize),
) -> Result<(Vec<LabelledSurface>, Vec<SurfaceRepair>, SceneExtras), SceneError> {
    let raw = read_raw(path)?;
    if let Some(problem) = raw.problems.into_iter().next() {
        return Err(problem);
    }
    let extras = raw.extras;
    let count = raw.surfaces.len();
    let (mut surfaces, mut reports) = (Vec::new(), Vec::new());
    for (done, surface) in raw.surfaces.into_iter().enumerate() {
        progress(done, count);
        let mesh = surface.mesh?;
        let Some(tissue) = surface.tissue else {
            return Err(SceneError::NoTissue { path: path.to_owned(), surface: surface.name });
        };
        let mesh = Mesh { vertices_mm: mesh.vertices_mm, triangles: mesh.triangles };
        let (mesh, report) = repair(&surface.name, mesh, settings);
        reports.push(report);
        if !mesh.triangles.is_empty() {
            surfaces.push(LabelledSurface { name: surface.name, tissue, priority: surface.priority, mesh });
        }
    }
    Ok((surfaces, reports, extras))
}
