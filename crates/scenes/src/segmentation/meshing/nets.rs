//! Surface nets of several labels (Gibson 1998). A net has a vertex in each cell of eight voxels that contains several
//! labels, and a quad between each pair of neighbouring voxels with different labels.

use glam::Vec3;
use rayon::prelude::*;

use super::{BORDER, NONE};

/// Index that means no vertex.
pub(super) const NO_VERTEX: u32 = u32::MAX;

/// Quadrilateral between two labels.
#[derive(Debug, Clone, Copy, PartialEq)]
pub struct Quad {
    /// Indices of the vertices, counter-clockwise seen from the second side.
    pub corners: [u32; 4],
    /// Label behind the face, and label in front of it, where its normal points.
    pub sides: [u16; 2],
}

/// Net of quads between labels.
///
/// Its cells are shifted by half a voxel. Cell (a, b, c) lies between the voxels (a−1, b−1, c−1) and (a, b, c). The
/// cell's centre has the voxel index (a−½, b−½, c−½).
#[derive(Debug, Clone, Default)]
pub struct Net {
    /// Number of voxels along each axis.
    pub size: [usize; 3],
    /// Cell that each vertex belongs to.
    pub cells: Vec<[u16; 3]>,
    /// Position of each vertex relative to its cell's centre, voxels.
    pub offsets: Vec<Vec3>,
    /// For each vertex, the vertices of the cells that adjoin its cell at the faces −x, +x, −y, +y, −z, +z;
    /// [`NO_VERTEX`] at faces with only one label.
    pub(super) neighbours: Vec<[u32; 6]>,
    /// For each vertex, bits of its cell's faces: bit n is set if more than two surfaces join at face n, or a surface
    /// reaches the grid's border there.
    pub(super) junctions: Vec<u8>,
    /// Faces of all surfaces.
    pub quads: Vec<Quad>,
}

/// Labels of the voxels of a grid, surrounded by a border of one voxel.
struct Voxels<'a> {
    labels: &'a [u16],
    size: [usize; 3],
}

impl Voxels<'_> {
    /// Label of a voxel, [`BORDER`] outside the grid. Indices within the grid count from 1.
    fn label(&self, [a, b, c]: [usize; 3]) -> u16 {
        let [nx, ny, nz] = self.size;
        let within = (1..=nx).contains(&a) && (1..=ny).contains(&b) && (1..=nz).contains(&c);
        if within { self.labels[((c - 1) * ny + b - 1) * nx + a - 1] } else { BORDER }
    }

    /// Labels of a cell's eight voxels. In their index, bit 0 is x, bit 1 y and bit 2 z.
    fn of_cell(&self, [a, b, c]: [usize; 3]) -> [u16; 8] {
        std::array::from_fn(|n| self.label([a + (n & 1), b + (n >> 1 & 1), c + (n >> 2)]))
    }
}

/// A label; [`NONE`] for the border.
fn inner(label: u16) -> u16 {
    if label == BORDER { NONE } else { label }
}

/// Corners of a cell's faces −x, +x, −y, +y, −z, +z, in order around each face. The numbers are those of
/// [`Voxels::of_cell`].
const FACES: [[usize; 4]; 6] = [[0, 2, 6, 4], [1, 3, 7, 5], [0, 1, 5, 4], [2, 3, 7, 6], [0, 1, 3, 2], [4, 5, 7, 6]];

/// Vertices in a layer of cells of equal c.
struct Layer {
    /// Indices b × width + a of the cells that have a vertex; ascending.
    positions: Vec<u32>,
}

impl Net {
    /// Net of `labels`, x fastest. Label 0 is outside; no label may be [`BORDER`].
    pub fn of(labels: &[u16], size: [usize; 3]) -> Self {
        let voxels = Voxels { labels, size };
        let [width, height, depth] = size.map(|n| n + 1);
        let layers: Vec<Layer> = (0..depth).into_par_iter().map(|c| Layer::of(&voxels, c)).collect();
        let mut starts = vec![0u32];
        for layer in &layers {
            starts.push(starts[starts.len() - 1] + layer.positions.len() as u32);
        }
        // Vertex of each cell of a layer, indexed by the cell's position in the layer.
        let map = |c: usize| {
            let mut vertices = vec![NO_VERTEX; width * height];
            for (vertex, &position) in (starts[c]..).zip(&layers[c].positions) {
                vertices[position as usize] = vertex;
            }
            vertices
        };
        let parts: Vec<Part> = (0..depth)
            .into_par_iter()
            .map(|c| {
                let empty = || vec![NO_VERTEX; width * height];
                let below = if c > 0 { map(c - 1) } else { empty() };
                let above = if c + 1 < depth { map(c + 1) } else { empty() };
                layers[c].part(&voxels, c, &[below, map(c), above])
            })
            .collect();
        let mut net = Self { size, ..Self::default() };
        for part in parts {
            net.cells.extend(part.cells);
            net.neighbours.extend(part.neighbours);
            net.junctions.extend(part.junctions);
            net.quads.extend(part.quads);
        }
        net.offsets = vec![Vec3::ZERO; net.cells.len()];
        net
    }

    /// Position of a vertex, as a voxel index with fractions.
    pub fn position(&self, vertex: usize) -> Vec3 {
        Vec3::from(self.cells[vertex].map(f32::from)) - 0.5 + self.offsets[vertex]
    }

    /// Faces of the grid that a vertex lies on, as bits: 1, 2, 4 for the low faces along x, y, z; 8, 16, 32 for the
    /// high ones.
    pub(super) fn border(&self, vertex: usize) -> u8 {
        let cell = self.cells[vertex];
        (0..3).fold(0, |bits, axis| {
            let low = if cell[axis] == 0 { 1 << axis } else { 0 };
            let high = if usize::from(cell[axis]) == self.size[axis] { 8 << axis } else { 0 };
            bits | low | high
        })
    }
}

struct Part {
    cells: Vec<[u16; 3]>,
    neighbours: Vec<[u32; 6]>,
    junctions: Vec<u8>,
    quads: Vec<Quad>,
}

impl Layer {
    fn of(voxels: &Voxels, c: usize) -> Self {
        let [width, height, _] = voxels.size.map(|n| n + 1);
        let mut positions = Vec::new();
        for b in 0..height {
            for a in 0..width {
                let corners = voxels.of_cell([a, b, c]);
                let first = inner(corners[0]);
                if corners.iter().any(|&label| inner(label) != first) {
                    positions.push((b * width + a) as u32);
                }
            }
        }
        Self { positions }
    }

    /// Vertices of this layer of cells, and quads between the voxel at each cell's near corner (lowest indices) and its
    /// neighbours. `vertices` are the vertices of the layers below, at and above this one.
    fn part(&self, voxels: &Voxels, c: usize, vertices: &[Vec<u32>; 3]) -> Part {
        let [width, height, _] = voxels.size.map(|n| n + 1);
        let mut part = Part { cells: Vec::new(), neighbours: Vec::new(), junctions: Vec::new(), quads: Vec::new() };
        let at = |layer: usize, a: usize, b: usize| vertices[layer][b * width + a];
        for &position in &self.positions {
            let (a, b) = (position as usize % width, position as usize / width);
            let corners = voxels.of_cell([a, b, c]);
            let mut neighbours = [NO_VERTEX; 6];
            let mut junctions = 0u8;
            for (n, face) in FACES.iter().enumerate() {
                let labels = face.map(|i| corners[i]);
                let differs = labels.iter().any(|&l| inner(l) != inner(labels[0]));
                if !differs {
                    continue;
                }
                neighbours[n] = match n {
                    0 if a > 0 => at(1, a - 1, b),
                    1 if a + 1 < width => at(1, a + 1, b),
                    2 if b > 0 => at(1, a, b - 1),
                    3 if b + 1 < height => at(1, a, b + 1),
                    4 => at(0, a, b),
                    5 => at(2, a, b),
                    _ => NO_VERTEX,
                };
                let changes = (0..4).filter(|&i| labels[i] != labels[(i + 1) % 4]).count();
                junctions |= u8::from(changes > 2) << n;
            }
            part.cells.push([a as u16, b as u16, c as u16]);
            part.neighbours.push(neighbours);
            part.junctions.push(junctions);
            // Label of the voxel at the cell's near corner. A quad separates this voxel from each of its neighbours in
            // the cell that has another label.
            let near = corners[0];
            let mut quad = |far: u16, around: [u32; 4]| {
                if inner(near) != inner(far) {
                    part.quads.push(Quad { corners: around, sides: [near, far] });
                }
            };
            if b > 0 && c > 0 {
                quad(corners[1], [at(0, a, b - 1), at(0, a, b), at(1, a, b), at(1, a, b - 1)]);
            }
            if a > 0 && c > 0 {
                quad(corners[2], [at(0, a - 1, b), at(1, a - 1, b), at(1, a, b), at(0, a, b)]);
            }
            if a > 0 && b > 0 {
                quad(corners[4], [at(1, a - 1, b - 1), at(1, a, b - 1), at(1, a, b), at(1, a - 1, b)]);
            }
        }
        part
    }
}
