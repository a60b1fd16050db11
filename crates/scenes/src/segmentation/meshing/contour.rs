//! Surface of a solid that can be asked whether a point lies within: dual contouring (Ju 2002) on voxels.
//!
//! The net of the voxels has a vertex in each cell that the surface passes. The vertex is put where the planes at the
//! crossings of the cell's edges meet, so edges and corners of the solid stay sharp. It never leaves its cell. Where
//! triangles cross nevertheless, vertices return towards the middle of their cells: there, none can cross.

use std::collections::{HashMap, HashSet};

use glam::{DMat3, DVec3, Vec3};
use insonify_core::anatomy::doctor::crossing;
use insonify_core::anatomy::doctor::tree::Tree;
use insonify_core::anatomy::{Bounds, Mesh};
use rayon::prelude::*;

use super::smooth::Kind;
use super::{Complex, Net, make_well_composed};

/// Side of the blocks of voxels that are tested as a whole.
const BLOCK: usize = 8;
/// Voxels around the bounds, and a shift of the grid: surfaces along its axes don't pass through voxel centres.
const MARGIN: f64 = 2.371;
/// Largest distance of a vertex from its cell's centre along each axis, voxels.
const REACH: f32 = 0.48;
/// Steps towards the planes of a cell.
const STEPS: usize = 24;
/// Rounds of returning crossing vertices to the middle of their cells.
const ROUNDS: usize = 12;
/// Largest error of decimation, voxels.
const ERROR_VOXELS: f64 = 0.05;
/// Most voxels of a grid.
const VOXELS_MAX: f64 = 8e7;

/// Source of a crossing.
#[derive(Debug, Clone, Copy, PartialEq, Eq)]
pub enum Origin {
    /// A given surface.
    Given,
    /// A flat cap of a cut.
    Cap,
    /// The fill of a hole.
    Fill,
    /// A voxel that was changed to keep the surface from touching itself.
    Change,
}

/// Crossing of the surface and the edge between two voxels.
#[derive(Debug, Clone, Copy)]
pub struct Crossing {
    /// Place, mm.
    pub at_mm: DVec3,
    /// Unit normal of the surface, or zero if unknown.
    pub normal: DVec3,
    /// Source of the crossing.
    pub origin: Origin,
}

/// Points at equal distances.
#[derive(Debug, Clone, Copy)]
pub struct Grid {
    /// First point, mm.
    pub low_mm: DVec3,
    /// Distance of neighbours, mm.
    pub step_mm: f64,
    /// Number of points along each axis.
    pub counts: [usize; 3],
}

impl Grid {
    /// A point, mm.
    pub fn point(&self, index: [usize; 3]) -> DVec3 {
        self.low_mm + self.step_mm * DVec3::from_array(index.map(|n| n as f64))
    }

    /// All points, mm, x fastest.
    pub fn points(&self) -> impl Iterator<Item = DVec3> {
        let [nx, ny, nz] = self.counts;
        (0..nx * ny * nz).map(move |n| self.point([n % nx, n / nx % ny, n / (nx * ny)]))
    }
}

/// A solid.
pub trait Solid: Sync {
    /// Whether a point lies within.
    fn holds(&self, at_mm: DVec3) -> bool;

    /// Whether a whole box lies within or without; `None` if the surface may pass.
    fn whole(&self, low_mm: DVec3, high_mm: DVec3) -> Option<bool>;

    /// Whether the points of a grid lie within, x fastest, if all together can be told faster than one by one.
    fn grid(&self, _: &Grid) -> Option<Vec<bool>> {
        None
    }

    /// Crossing of the surface between two points, one within and one without.
    fn crossing(&self, from_mm: DVec3, to_mm: DVec3) -> Crossing;
}

/// Point between `from_mm`, where `holds` is what it isn't at `to_mm`, at which it changes.
pub fn bisected(from_mm: DVec3, to_mm: DVec3, holds: impl Fn(DVec3) -> bool) -> DVec3 {
    let first = holds(from_mm);
    let (mut low, mut high) = (0.0, 1.0);
    for _ in 0..10 {
        let middle = 0.5 * (low + high);
        if holds(from_mm.lerp(to_mm, middle)) == first { low = middle } else { high = middle }
    }
    from_mm.lerp(to_mm, 0.5 * (low + high))
}

/// A vertex of the contour before decimation.
#[derive(Debug, Clone, Copy)]
pub struct Vertex {
    /// Place, mm.
    pub at_mm: Vec3,
    /// Cell.
    pub cell: [u16; 3],
    /// Source of its crossings: a cap, a fill or a change, if any has it.
    pub origin: Origin,
}

/// Surface of a solid.
#[derive(Debug, Clone)]
pub struct Contour {
    /// Closed surface that faces outward; empty if the solid holds no voxel.
    pub mesh: Mesh,
    /// Vertices before decimation.
    pub vertices: Vec<Vertex>,
    /// Side of the voxels, mm.
    pub voxel_mm: f64,
    low_mm: DVec3,
}

impl Contour {
    /// Contour of a solid within `bounds`, on voxels of about `voxel_mm`: larger ones if there would be more than 80
    /// million. Decimated to `triangles`, if that moves it by no more than a twentieth of a voxel.
    pub fn of(solid: &impl Solid, bounds: Bounds, voxel_mm: f64, triangles: usize) -> Self {
        let size_mm = bounds.size().as_dvec3();
        let voxel_mm = voxel_mm.max((size_mm.max(DVec3::splat(voxel_mm)).element_product() / VOXELS_MAX).cbrt());
        let low_mm = bounds.min.as_dvec3() - MARGIN * voxel_mm;
        let size: [usize; 3] = std::array::from_fn(|n| ((size_mm[n] / voxel_mm) + 2.0 * MARGIN).ceil() as usize + 1);
        let grid = Grid { low_mm, step_mm: voxel_mm, counts: size };
        let mut labels = labels(solid, &grid);
        let asked = labels.clone();
        make_well_composed(&mut labels, size, &|label| u64::from(label));
        let mut net = Net::of(&labels, size);
        drop(labels);
        let origins = place(solid, &asked, &mut net, &grid);
        let mut this = Self { mesh: Mesh::default(), vertices: Vec::new(), voxel_mm, low_mm };
        let Some(complex) = this.uncrossed(&mut net) else { return this };
        let mm = |v: usize| this.low_mm + net.position(v).as_dvec3() * voxel_mm;
        let vertex = |(v, &origin)| Vertex { at_mm: mm(v).as_vec3(), cell: net.cells[v], origin };
        this.vertices = origins.iter().enumerate().map(vertex).collect();
        this.mesh = this.decimated(complex, triangles);
        this
    }

    /// Cell that a point lies in.
    pub fn cell(&self, at_mm: Vec3) -> [u16; 3] {
        ((at_mm.as_dvec3() - self.low_mm) / self.voxel_mm + 1.0).to_array().map(|v| v.floor().max(0.0) as u16)
    }

    /// Surface of label 1 in mm.
    fn surface(&self, complex: &Complex) -> Option<Mesh> {
        let part = complex.parts().remove(&1)?;
        Some(part.mesh(&glam::DAffine3::from_translation(self.low_mm)))
    }

    /// Triangles of the net, with vertices returned to the middle of their cells until none cross. `None` without a
    /// triangle.
    fn uncrossed(&self, net: &mut Net) -> Option<Complex> {
        let mut complex = Complex::of(net, DVec3::splat(self.voxel_mm));
        for _ in 0..ROUNDS {
            let mesh = self.surface(&complex)?;
            let pairs = crossing::pairs(&Tree::new(&mesh)?);
            if pairs.is_empty() {
                break;
            }
            // The surface's triangles have the order of the complex: all of them separate the solid from its outside.
            let mut crossed: Vec<u32> = pairs
                .iter()
                .flat_map(|pair| pair.triangles)
                .flat_map(|triangle| complex.triangles[triangle as usize].corners)
                .collect();
            crossed.sort_unstable();
            crossed.dedup();
            crossed.into_iter().for_each(|vertex| net.offsets[vertex as usize] *= 0.6);
            complex = Complex::of(net, DVec3::splat(self.voxel_mm));
        }
        (!complex.triangles.is_empty()).then_some(complex)
    }

    /// The surface with fewer triangles. Where fewer would cross, it keeps all.
    fn decimated(&self, mut complex: Complex, triangles: usize) -> Mesh {
        for _ in 0..ROUNDS {
            let mut fewer = complex.clone();
            fewer.decimate(triangles, ERROR_VOXELS * self.voxel_mm, &|_| ());
            let Some(mesh) = self.surface(&fewer) else { return Mesh::default() };
            let pairs = Tree::new(&mesh).map(|tree| crossing::pairs(&tree)).unwrap_or_default();
            if pairs.is_empty() {
                return mesh;
            }
            let corners = pairs.iter().flat_map(|pair| pair.triangles).flat_map(|t| mesh.corners_of(t));
            let points = corners.chain(pairs.iter().map(|pair| pair.point));
            let near: HashSet<[u16; 3]> = points.map(|v| self.cell(v)).flat_map(around).flat_map(around).collect();
            let kept = complex.kinds.iter_mut().zip(&self.vertices).filter(|(_, vertex)| near.contains(&vertex.cell));
            kept.for_each(|(kind, _)| *kind = Kind::Corner);
        }
        self.surface(&complex).unwrap_or_default()
    }
}

/// Voxels within the solid, x fastest. Those at the sides of the grid are none: what holes are filled by may reach beyond.
fn labels(solid: &impl Solid, all: &Grid) -> Vec<u16> {
    let [nx, ny, _] = all.counts;
    let mut labels = vec![0u16; all.counts.iter().product()];
    labels.par_chunks_mut(nx * ny * BLOCK).enumerate().for_each(|(slab, layers)| {
        let depth = layers.len() / (nx * ny);
        for (y, x) in (0..ny).step_by(BLOCK).flat_map(|y| (0..nx).step_by(BLOCK).map(move |x| (y, x))) {
            let counts = [BLOCK.min(nx - x), BLOCK.min(ny - y), depth];
            let block = Grid { low_mm: all.point([x, y, slab * BLOCK]), step_mm: all.step_mm, counts };
            let inside = match solid.whole(block.low_mm, block.point(counts.map(|n| n - 1))) {
                Some(false) => continue,
                Some(true) => vec![true; counts.iter().product()],
                None => {
                    let one_by_one = || block.points().map(|at_mm| solid.holds(at_mm)).collect();
                    solid.grid(&block).unwrap_or_else(one_by_one)
                }
            };
            for (n, row) in inside.chunks(counts[0]).enumerate() {
                let first = (n / counts[1] * ny + y + n % counts[1]) * nx + x;
                layers[first..first + counts[0]].iter_mut().zip(row).for_each(|(label, &is)| *label = u16::from(is));
            }
        }
    });
    let is_side = |n: usize| {
        let at = [n % nx, n / nx % ny, n / (nx * ny)];
        (0..3).any(|axis| at[axis] == 0 || at[axis] + 1 == all.counts[axis])
    };
    labels
        .par_iter_mut()
        .enumerate()
        .filter(|(n, label)| **label != 0 && is_side(*n))
        .for_each(|(_, label)| *label = 0);
    labels
}

/// Planes at the crossings of a cell's edges.
#[derive(Clone, Copy)]
struct Planes {
    /// Sum of the crossings' places, and their number.
    sum: DVec3,
    count: f64,
    /// Sums of n nᵀ and of n (n · p) over the crossings with a normal.
    matrix: DMat3,
    vector: DVec3,
    origin: Origin,
}

impl Planes {
    fn add(&mut self, crossing: &Crossing, place: DVec3) {
        let normal = crossing.normal;
        self.sum += place;
        self.count += 1.0;
        self.matrix += DMat3::from_cols(normal * normal.x, normal * normal.y, normal * normal.z);
        self.vector += normal * normal.dot(place);
        self.origin = match (self.origin, crossing.origin) {
            (Origin::Cap, _) | (_, Origin::Cap) => Origin::Cap,
            (Origin::Fill, _) | (_, Origin::Fill) => Origin::Fill,
            (Origin::Given, other) => other,
            (known, Origin::Given | Origin::Change) => known,
        };
    }

    /// Point near the mean of the crossings from which the planes are nearest, by steps down the sum of squares.
    fn meeting(&self) -> DVec3 {
        let mut at = self.sum / self.count.max(1.0);
        for _ in 0..STEPS {
            at += (self.vector - self.matrix * at) / self.count.max(1.0);
        }
        at
    }
}

/// Moves each vertex of the net to where the planes of its cell meet. Returns the source of each. `labels` are those
/// that the solid gave, before any was changed.
fn place(solid: &impl Solid, labels: &[u16], net: &mut Net, grid: &Grid) -> Vec<Origin> {
    let [nx, ny, _] = net.size;
    let label = |[x, y, z]: [usize; 3]| labels[(z * ny + y) * nx + x];
    // A quad crosses the edge between two voxels: the one at the near corner of its cells, and that before it.
    let found: Vec<(Crossing, DVec3)> = net
        .quads
        .par_iter()
        .map(|quad| {
            let cells = quad.corners.map(|v| net.cells[v as usize].map(usize::from));
            let low: [usize; 3] = std::array::from_fn(|n| cells.iter().map(|cell| cell[n]).min().unwrap_or(0));
            let axis = (0..3).find(|&n| cells.iter().all(|cell| cell[n] == low[n])).unwrap_or(0);
            let mut before = low;
            before[axis] = low[axis].saturating_sub(1);
            let [from, to] = [before, low].map(|voxel| grid.point(voxel));
            let crossing = if label(before) != label(low) {
                solid.crossing(from, to)
            } else {
                Crossing { at_mm: 0.5 * (from + to), normal: DVec3::ZERO, origin: Origin::Change }
            };
            (crossing, DVec3::from_array(before.map(|v| v as f64)) + (crossing.at_mm - from) / grid.step_mm)
        })
        .collect();
    let none = Planes { sum: DVec3::ZERO, count: 0.0, matrix: DMat3::ZERO, vector: DVec3::ZERO, origin: Origin::Given };
    let mut planes = vec![none; net.cells.len()];
    for (quad, (crossing, place)) in net.quads.iter().zip(&found) {
        for &vertex in &quad.corners {
            // Relative to the cell's centre: far from the origin, sums of squares would lose digits.
            let centre = DVec3::from_array(net.cells[vertex as usize].map(f64::from)) - 0.5;
            planes[vertex as usize].add(crossing, place - centre);
        }
    }
    net.offsets.par_iter_mut().zip(&planes).for_each(|(offset, planes)| {
        *offset = planes.meeting().as_vec3().clamp(Vec3::splat(-REACH), Vec3::splat(REACH));
    });
    planes.iter().map(|planes| planes.origin).collect()
}

/// Groups of cells that touch, at a side, an edge or a corner; each as indices of `cells`, in order.
pub fn touching(cells: &[[u16; 3]]) -> Vec<Vec<usize>> {
    let index: HashMap<[u16; 3], usize> = cells.iter().enumerate().map(|(n, cell)| (*cell, n)).collect();
    let mut seen = vec![false; cells.len()];
    let mut groups = Vec::new();
    for start in 0..cells.len() {
        if std::mem::replace(&mut seen[start], true) {
            continue;
        }
        let mut group = vec![start];
        let mut at = 0;
        while let Some(&n) = group.get(at) {
            at += 1;
            for near in around(cells[n]) {
                if let Some(&other) = index.get(&near).filter(|&&other| !seen[other]) {
                    seen[other] = true;
                    group.push(other);
                }
            }
        }
        groups.push(group);
    }
    groups
}

/// A cell and the 26 around it.
pub fn around(cell: [u16; 3]) -> impl Iterator<Item = [u16; 3]> {
    (0..27u16).map(move |n| [0, 1, 2].map(|axis| (cell[axis] + n / 3u16.pow(axis as u32) % 3).saturating_sub(1)))
}
