//! The mesh under repair.

use glam::{DVec3, Vec3};
use insonify_core::anatomy::doctor::{REGIONS_MAX, Region};
use insonify_core::anatomy::{Bounds, Mesh};

use super::report::{Action, ActionKind, Remaining, RemainingKind};

/// A mesh under repair, and the log of the repair.
pub(super) struct Work {
    pub(super) mesh: Mesh,
    pub(super) actions: Vec<Action>,
    pub(super) remaining: Vec<Remaining>,
    /// Upper bound of the moves by joining vertices, mm.
    pub(super) joined_mm: f32,
    /// Largest move of the surface by remeshing, mm.
    pub(super) moved_mm: f32,
    /// Regions of all caps of cuts.
    pub(super) cuts: Vec<Region>,
}

impl Work {
    pub(super) fn new(mesh: Mesh) -> Self {
        Self { mesh, actions: Vec::new(), remaining: Vec::new(), joined_mm: 0.0, moved_mm: 0.0, cuts: Vec::new() }
    }

    /// Position of a vertex, mm.
    pub(super) fn at(&self, vertex: u32) -> DVec3 {
        self.mesh.vertices_mm[vertex as usize].as_dvec3()
    }

    /// Corners of a triangle, mm.
    pub(super) fn corners(&self, triangle: [u32; 3]) -> [DVec3; 3] {
        triangle.map(|vertex| self.at(vertex))
    }

    /// Keeps the triangles for which `keep` is true.
    pub(super) fn retain(&mut self, keep: &[bool]) {
        let mut keep = keep.iter();
        self.mesh.triangles.retain(|_| keep.next().copied().unwrap_or(true));
    }

    /// Logs an action, unless its count is zero.
    pub(super) fn log(&mut self, kind: ActionKind, count: usize, regions: impl IntoIterator<Item = Region>) {
        if count > 0 {
            self.actions.push(Action { kind, count, regions: largest(regions) });
        }
    }

    /// Logs a defect that remains, unless its count is zero.
    pub(super) fn leave(&mut self, kind: RemainingKind, count: usize, regions: impl IntoIterator<Item = Region>) {
        if count > 0 {
            self.remaining.push(Remaining { kind, count, regions: largest(regions) });
        }
    }

    /// Region of some triangles, given by their vertices.
    pub(super) fn region_of(&self, triangles: impl IntoIterator<Item = [u32; 3]>) -> Region {
        region(triangles.into_iter().flatten().map(|vertex| self.mesh.vertices_mm[vertex as usize]))
    }

    /// Drops vertices that no triangle uses.
    pub(super) fn compact(&mut self) {
        let mut index = vec![u32::MAX; self.mesh.vertices_mm.len()];
        self.mesh.triangles.iter().flatten().for_each(|&vertex| index[vertex as usize] = 0);
        let used = index.iter_mut().filter(|slot| **slot == 0);
        (0u32..).zip(used).for_each(|(next, slot)| *slot = next);
        let mut at = index.iter();
        self.mesh.vertices_mm.retain(|_| at.next().is_some_and(|&slot| slot != u32::MAX));
        self.mesh.triangles.iter_mut().flatten().for_each(|vertex| *vertex = index[*vertex as usize]);
    }
}

/// Region of some points: the centre and the diagonal of their bounding box.
pub(super) fn region(points: impl IntoIterator<Item = Vec3>) -> Region {
    let Bounds { min, max } = Bounds::of(points).unwrap_or(Bounds::around(Vec3::ZERO, Vec3::ZERO));
    Region { at_mm: (0.5 * (min + max)).to_array(), size_mm: (max - min).length() }
}

pub(super) fn largest(regions: impl IntoIterator<Item = Region>) -> Vec<Region> {
    let mut regions: Vec<Region> = regions.into_iter().collect();
    regions.sort_by(|a, b| b.size_mm.total_cmp(&a.size_mm));
    regions.truncate(REGIONS_MAX);
    regions
}

/// Area of a triangle, mm².
pub(super) fn area([a, b, c]: [DVec3; 3]) -> f64 {
    0.5 * (b - a).cross(c - a).length()
}

/// Signed volume of the tetrahedron between a triangle and the origin, mm³.
pub(super) fn volume([a, b, c]: [DVec3; 3]) -> f64 {
    a.dot(b.cross(c)) / 6.0
}
