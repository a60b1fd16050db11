//! Sampling of the scan plane: cells, nodes and modes at each depth plane.

/// Sizes that grid and tables share. The first planes have all modes; on a curved face, whose cells widen with depth, every
/// second one is left out from plane `halves_at` on.
#[derive(Debug, Clone, Copy)]
pub(crate) struct Sampling {
    /// Cells along the face, a power of two; the last one is next to the first.
    pub(crate) cells: usize,
    /// Beams per period of the modes, a power of two.
    pub(crate) beams: usize,
    /// Cells per node at the first planes, a power of two. From plane `halves_at` on it is half of that.
    pub(crate) node_cells: usize,
    /// First plane without the odd modes; the number of planes if all have them.
    pub(crate) halves_at: usize,
    /// Modes, padding included.
    pub(crate) modes: usize,
    /// Modes, padding included, that go on after `halves_at`: the even ones.
    pub(crate) lasting_modes: usize,
}

impl Sampling {
    /// Cells per node at a plane.
    pub(crate) fn node_cells_at(&self, plane: usize) -> usize {
        if plane < self.halves_at { self.node_cells } else { self.node_cells / 2 }
    }

    /// Nodes at a plane: places along the face with a beam each.
    pub(crate) fn nodes_at(&self, plane: usize) -> usize {
        self.cells / self.node_cells_at(plane)
    }

    /// Modes, padding included, that take part at a plane.
    pub(crate) fn modes_at(&self, plane: usize) -> usize {
        if plane < self.halves_at { self.modes } else { self.lasting_modes }
    }

    /// Distance of neighbouring modes at a plane, in their numbers.
    pub(crate) fn mode_stride(&self, plane: usize) -> i32 {
        if plane < self.halves_at { 1 } else { 2 }
    }

    /// Index of the beam whose axis is at a node, within a period: x = 0 is in the middle of the nodes.
    pub(crate) fn beam_of(&self, plane: usize, axis: usize) -> usize {
        (axis + self.nodes_at(plane) / 2) % self.beams
    }

    /// Offsets of a profile, in cells from its axis: half a period of beams.
    pub(crate) fn offsets(&self) -> usize {
        self.beams * self.node_cells / 2
    }

    /// Index of a mode within one period at a plane: modulo the number of beams.
    pub(crate) fn bin(&self, plane: usize, mode: i32) -> usize {
        (mode / self.mode_stride(plane)).rem_euclid(self.beams as i32) as usize
    }
}

/// Rays of a layer that cross a cell. Ray i stands for the face from i to i + 1, in shares of a ray.
#[derive(Debug, Clone, Copy, PartialEq, Eq)]
pub(crate) struct CellRays {
    pub(crate) first: u32,
    /// Distance to the next.
    pub(crate) step: u32,
    pub(crate) count: u32,
    /// Parts of the first and of the last ray that lie within the cell, in 1/65535.
    pub(crate) parts: [u16; 2],
}

impl CellRays {
    /// One ray for a whole cell.
    pub(super) fn single(first: u32) -> Self {
        Self { first, step: 1, count: 1, parts: [Self::packed(1.0); 2] }
    }

    pub(super) fn packed(part: f64) -> u16 {
        (part * f64::from(u16::MAX)).round() as u16
    }

    /// Weights of the first ray and of the last. Those between them count 1.
    pub(crate) fn weights(&self) -> [f32; 2] {
        self.parts.map(|part| f32::from(part) * (1.0 / 65535.0))
    }
}
