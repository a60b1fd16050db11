//! Check that the axes of organ meshes put the organs at plausible positions.

use anyhow::anyhow;
use glam::DVec3;
use insonify::anatomy::organs::{Aspect, Certainty, OrganFact, check_organs};
use insonify::segmentation::mesh_files::NamedMesh;
use insonify::segmentation::mesh_files::placing::{MeshAxes, Unit};

use super::super::Failure;

/// Refuses axes, stated by files or guessed, in which organs have positions that no human has. No axes fit mirrored
/// meshes.
pub(super) fn check_positions(meshes: &[NamedMesh], axes: MeshAxes, unit: Unit) -> Result<(), Failure> {
    let facts: Vec<OrganFact> = meshes.iter().filter_map(|mesh| fact(mesh, axes, unit)).collect();
    let is_exchanged = |aspect: Aspect| matches!(aspect, Aspect::Side | Aspect::Position);
    let found = check_organs(&facts);
    let wrong = found.iter().find(|f| f.certainty == Certainty::Impossible && is_exchanged(f.aspect));
    let Some(wrong) = wrong else { return Ok(()) };
    Err(Failure::Input(anyhow!(
        "with {axes} {}: none of lps, ras and y-up fits for certain, as where meshes were mirrored; export them again without \
         mirroring, or give --axes {axes} if they are right",
        wrong.what
    )))
}

/// Fact about an organ for the check: centre of its bounds, and estimated volume. `None` without vertices.
fn fact(mesh: &NamedMesh, axes: MeshAxes, unit: Unit) -> Option<OrganFact> {
    let first = *mesh.vertices.first()?;
    let (low, high) = mesh.vertices.iter().fold((first, first), |(low, high), v| (low.min(*v), high.max(*v)));
    let size_mm: DVec3 = (high - low) * unit.mm();
    Some(OrganFact {
        name: mesh.name.clone(),
        // An organ fills about half of its bounding box.
        volume_ml: 0.5e-3 * size_mm.element_product(),
        centre_mm: axes.lps_from_file() * (0.5 * (low + high) * unit.mm()),
        is_cut: true,
    })
}
