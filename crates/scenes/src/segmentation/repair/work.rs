//! The mesh under repair.

use glam::{DVec3, Vec3};
use insonify_core::anatomy::doctor::{REGIONS_MAX, Region};
use insonify_core::anatomy::{Bounds, Mesh};

use super::report::{Action, ActionKind, Remaining, RemainingKind};

/// A mesh under repair, and the log of the repair.
pub(super) struct Work {
    pub(super) mesh: Mesh,
    /// Original position of each vertex, mm; for a vertex that the repair added, the position at which it was added.
    pub(super) home_mm: Vec<Vec3>,
    /// Vertices that were separated from each other, but still coincide.
    pub(super) split: Vec<u32>,
    pub(super) actions: Vec<Action>,
    pub(super) remaining: Vec<Remaining>,
    /// Upper bound of the moves by joining vertices, mm.
    pub(super) joined_mm: f32,
}

impl Work {
    pub(super) fn new(mesh: Mesh) -> Self {
        let home_mm = mesh.vertices_mm.clone();
        Self { mesh, home_mm, split: Vec::new(), actions: Vec::new(), remaining: Vec::new(), joined_mm: 0.0 }
    }

    /// Position of a vertex, mm.
    pub(super) fn at(&self, vertex: u32) -> DVec3 {
        self.mesh.vertices_mm[vertex as usize].as_dvec3()
    }

    /// Corners of a triangle, mm.
    pub(super) fn corners(&self, triangle: [u32; 3]) -> [DVec3; 3] {
        triangle.map(|vertex| self.at(vertex))
    }

    /// Adds a vertex, and returns its index.
    pub(super) fn push(&mut self, at_mm: DVec3) -> u32 {
        let index = self.mesh.vertices_mm.len() as u32;
        self.mesh.vertices_mm.push(at_mm.as_vec3());
        self.home_mm.push(at_mm.as_vec3());
        index
    }

    /// Adds a copy of a vertex, and returns its index.
    pub(super) fn copy(&mut self, vertex: u32) -> u32 {
        let index = self.mesh.vertices_mm.len() as u32;
        self.mesh.vertices_mm.push(self.mesh.vertices_mm[vertex as usize]);
        self.home_mm.push(self.home_mm[vertex as usize]);
        index
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

    /// Upper bound of the largest move of a vertex, mm. A vertex may have been joined first and then moved.
    pub(super) fn largest_move_mm(&self) -> f32 {
        let moved = self.mesh.vertices_mm.iter().zip(&self.home_mm).map(|(now, home)| now.distance(*home));
        self.joined_mm + moved.fold(0.0, f32::max)
    }

    /// Drops vertices that no triangle uses.
    pub(super) fn compact(&mut self) {
        let mut index = vec![u32::MAX; self.mesh.vertices_mm.len()];
        self.mesh.triangles.iter().flatten().for_each(|&vertex| index[vertex as usize] = 0);
        let used = index.iter_mut().filter(|slot| **slot == 0);
        (0u32..).zip(used).for_each(|(next, slot)| *slot = next);
        let used = |list: &mut Vec<Vec3>| {
            let mut at = index.iter();
            list.retain(|_| at.next().is_some_and(|&slot| slot != u32::MAX));
        };
        used(&mut self.mesh.vertices_mm);
        used(&mut self.home_mm);
        self.mesh.triangles.iter_mut().flatten().for_each(|vertex| *vertex = index[*vertex as usize]);
        self.split = self.split.iter().map(|&vertex| index[vertex as usize]).filter(|&v| v != u32::MAX).collect();
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
