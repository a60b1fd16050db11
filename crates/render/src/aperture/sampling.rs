//! Sampling of the scan plane: cells along the face, nodes (beam axes) and modes (waves) at each depth plane.

/// Sizes that the grid and the tables share. The first depth planes have all modes. On a curved face, whose cells widen
/// with depth, only the even modes go on from plane `halves_at`.
#[derive(Debug, Clone, Copy)]
pub(crate) struct Sampling {
    /// Number of cells along the face, a power of two. The last one is next to the first: the grid is periodic.
    pub(crate) cells: usize,
    /// Number of beams in a period of the modes, a power of two.
    pub(crate) beams: usize,
    /// Cells from one node to the next at the first planes, a power of two. From plane `halves_at` on, nodes are half
    /// as far apart.
    pub(crate) node_cells: usize,
    /// Index of the first plane without the odd modes; the number of planes if all have them.
    pub(crate) halves_at: usize,
    /// Number of modes, padding included.
    pub(crate) modes: usize,
    /// Number of modes, padding included, that continue from `halves_at` on: even modes, or all modes if none end.
    pub(crate) lasting_modes: usize,
}

impl Sampling {
    /// Number of cells from one node to the next at a depth plane.
    pub(crate) fn node_cells_at(&self, plane: usize) -> usize {
        if plane < self.halves_at { self.node_cells } else { self.node_cells / 2 }
    }

    /// Number of beam axes (nodes) along the face at a depth plane.
    pub(crate) fn nodes_at(&self, plane: usize) -> usize {
        self.cells / self.node_cells_at(plane)
    }

    /// Number of modes, padding included, that take part at a depth plane.
    pub(crate) fn modes_at(&self, plane: usize) -> usize {
        if plane < self.halves_at { self.modes } else { self.lasting_modes }
    }

    /// Difference of neighbouring mode numbers at a depth plane.
    pub(crate) fn mode_stride(&self, plane: usize) -> i32 {
        if plane < self.halves_at { 1 } else { 2 }
    }

    /// Index, within a period, of the beam whose axis is the node `axis`. Beam 0 is at x = 0, the middle node.
    pub(crate) fn beam_of(&self, plane: usize, axis: usize) -> usize {
        (axis + self.nodes_at(plane) / 2) % self.beams
    }

    /// Length of a beam profile: one value per cell, from the axis to half a period.
    pub(crate) fn offsets(&self) -> usize {
        self.beams * self.node_cells / 2
    }

    /// FFT bin of a mode at a depth plane: its number over the plane's mode stride, modulo `beams`.
    pub(crate) fn bin(&self, plane: usize, mode: i32) -> usize {
        (mode / self.mode_stride(plane)).rem_euclid(self.beams as i32) as usize
    }
}

/// Rays of a layer that cross a cell. Ray i stands for the i-th of equal parts of the face.
#[derive(Debug, Clone, Copy, PartialEq, Eq)]
pub(crate) struct CellRays {
    pub(crate) first: u32,
    /// Difference of neighbouring ray indices.
    pub(crate) step: u32,
    pub(crate) count: u32,
    /// Fractions of the first and the last ray's parts of the face that lie within the cell, in 1/65535.
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

    /// Weights of the first and of the last ray, 0..=1. Rays between them have weight 1.
    pub(crate) fn weights(&self) -> [f32; 2] {
        self.parts.map(|part| f32::from(part) * (1.0 / 65535.0))
    }
}
