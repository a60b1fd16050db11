//! Repair of surfaces: closed, facing outward, without doubled or crossing triangles.
//!
//! [`repair`] mends a surface in this order:
//!
//! 1. Coincident vertices are joined, also those of rims that nearly coincide.
//! 2. Triangles without area and copies of triangles are removed. Of two triangles back to back, both are removed if
//!    they form a wall inside the surface; one is removed if they are its only border.
//! 3. The winding is made consistent in each part.
//! 4. Parts without thickness and small fragments are removed.
//! 5. Parts are turned outward. Parts within an odd number of others are cavities and face inward.
//! 6. A surface is now left as it is if it is closed, with two triangles at each edge, and doesn't pass through itself. A
//!    few folds are accepted, as by the check of scenes. Any other surface is remeshed: the result is the contour of the region
//!    with a winding number of at least ½. Plane rims, and rims along the sides of the bounding box, get flat caps.
//!    Other holes close as a soap film would. Overlapping parts become one.
//!
//! The report says how far the surface moved. The result depends only on the input, not on the number of threads.

mod caps;
mod clean;
mod edges;
mod fragments;
mod orient;
mod remesh;
mod report;
#[cfg(test)]
mod shapes;
#[cfg(test)]
mod tests;
mod weld;
mod work;

pub use report::{Action, ActionKind, Remaining, RemainingKind, SurfaceRepair};

use insonify_core::anatomy::Mesh;
use work::{Work, region};

/// Settings of a repair.
#[derive(Debug, Clone, Copy, PartialEq)]
pub struct RepairSettings {
    /// Largest distance at which vertices are joined, mm.
    pub weld_mm: f64,
    /// Largest distance at which vertices of rims are joined, mm; limited to a quarter of the mean rim edge.
    pub weld_rims_mm: f64,
    /// Largest distance by which the surface may move, mm. It limits the voxels of remeshing, and is checked afterwards.
    pub max_move_mm: f64,
    /// Size up to which a hole counts as small, mm. Larger holes that are not planar are reported as guesses.
    pub small_hole_mm: f64,
    /// Share of the largest part's volume below which a part is a fragment and is removed.
    pub fragment_share: f64,
}

impl Default for RepairSettings {
    fn default() -> Self {
        Self { weld_mm: 1e-4, weld_rims_mm: 0.01, max_move_mm: 0.5, small_hole_mm: 10.0, fragment_share: 1e-4 }
    }
}

/// Repairs a surface. Returns the mended mesh, mm, and the report. The mesh is empty if no part encloses a volume.
///
/// A triangle with a vertex index out of range is treated like one with a vertex that is not finite.
pub fn repair(name: &str, mesh: Mesh, settings: &RepairSettings) -> (Mesh, SurfaceRepair) {
    let before = mesh.triangles.len();
    let mut work = Work::new(mesh);
    drop_not_finite(&mut work);
    let within = |mm: f64| mm.clamp(0.0, settings.max_move_mm.max(0.0));
    weld::weld(&mut work, within(settings.weld_mm), within(settings.weld_rims_mm));
    clean::drop_degenerate(&mut work);
    clean::drop_copies(&mut work);
    orient::make_consistent(&mut work);
    fragments::drop_fragments(&mut work, settings.fragment_share);
    orient::face_outward(&mut work);
    let bounds = region(work.mesh.vertices_mm.iter().copied());
    if !remesh::is_sound(&work) {
        orient::check(&mut work);
        remesh::remesh(&mut work, settings);
        fragments::drop_fragments(&mut work, settings.fragment_share);
        if !remesh::is_sound(&work) {
            work.leave(RemainingKind::Crossing, 1, [bounds]);
        }
    }
    if work.mesh.triangles.is_empty() {
        work.leave(RemainingKind::Nothing, 1, [bounds]);
    }
    work.compact();
    finish(name, before, work)
}

fn finish(name: &str, before: usize, mut work: Work) -> (Mesh, SurfaceRepair) {
    let report = SurfaceRepair {
        surface: name.to_owned(),
        triangles: [before, work.mesh.triangles.len()],
        parts: orient::parts(&work.mesh).0.len(),
        volume_mm3: work.mesh.signed_volume_mm3(),
        actions: merged(std::mem::take(&mut work.actions)),
        remaining: std::mem::take(&mut work.remaining),
        largest_move_mm: work.joined_mm + work.moved_mm,
        cuts: std::mem::take(&mut work.cuts),
    };
    (work.mesh, report)
}

/// Actions with one entry per kind, in the order of first occurrence.
fn merged(actions: Vec<Action>) -> Vec<Action> {
    let mut merged: Vec<Action> = Vec::new();
    for action in actions {
        match merged.iter_mut().find(|known| known.kind == action.kind) {
            Some(known) => {
                known.count += action.count;
                known.regions = work::largest(known.regions.drain(..).chain(action.regions));
            }
            None => merged.push(action),
        }
    }
    merged
}

/// Removes triangles with vertices that are not finite or do not exist.
fn drop_not_finite(work: &mut Work) {
    let vertices = &work.mesh.vertices_mm;
    let is_bad = |vertex: &u32| vertices.get(*vertex as usize).is_none_or(|v| !v.is_finite());
    let mut bad: Vec<u32> = work.mesh.triangles.iter().flatten().copied().filter(is_bad).collect();
    if bad.is_empty() {
        // Unused vertices may have any coordinates.
        work.compact();
        return;
    }
    bad.sort_unstable();
    bad.dedup();
    let keep: Vec<bool> = work.mesh.triangles.iter().map(|t| !t.iter().any(is_bad)).collect();
    let near = work.mesh.triangles.iter().zip(&keep).filter(|(_, keep)| !**keep).flat_map(|(t, _)| *t);
    let near: Vec<_> = near.filter(|vertex| !is_bad(vertex)).map(|vertex| vertices[vertex as usize]).collect();
    work.retain(&keep);
    work.leave(RemainingKind::NotFinite, bad.len(), [region(near)]);
    work.compact();
}
