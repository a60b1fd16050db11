//! Tables of the aperture in f64.

use glam::DVec2;

use crate::aperture::{self, ApertureTables};

/// Tables of the aperture as uploaded to the device.
#[derive(Debug, Clone, PartialEq)]
pub struct Aperture {
    /// Number of cells along the face.
    pub cells: usize,
    /// Number of depth planes, one in the middle of each depth interval.
    pub planes: usize,
    /// Length of a depth interval, mm.
    pub plane_mm: f64,
    /// Number of beams in a period of the modes. Modes are waves along the face that add up to the beams.
    pub beams: usize,
    /// Cells from one beam axis (node) to the next `[planes]`.
    pub node_cells: Vec<usize>,
    /// Difference of neighbouring mode numbers `[planes]`: 2 where the odd modes have ended, else 1.
    pub mode_stride: Vec<i32>,
    /// Number of modes, padding included, that take part at each plane `[planes]`.
    pub mode_count: Vec<usize>,
    /// Mode number in each slot; `None` is padding.
    pub modes: Vec<Option<i32>>,
    /// Factor by which each spatial frequency propagates from one plane to the next, divided by the number of cells
    /// [planes × cells].
    pub steps: Vec<DVec2>,
    /// Weight of each mode in the transmit beam.
    pub transmit: Vec<DVec2>,
    /// Weight of each mode in the receive beam of each plane [planes × modes].
    pub receive: Vec<DVec2>,
    /// Sensitivity of the face at each cell.
    pub face: Vec<f64>,
    /// Distance from a beam's axis within which its echo power is summed, in cells `[planes]`.
    pub reach_cells: Vec<f64>,
    /// Greatest echo power of any beam without obstacles `[planes]`.
    pub greatest: Vec<f64>,
    /// Echo power of each beam without obstacles, relative to `greatest` [planes × cells].
    pub shares: Vec<f64>,
    /// Two-way amplitude of an unobstructed beam at offsets from its axis, one cell apart [planes × offsets].
    pub profiles: Vec<f64>,
    /// Number of offsets in a profile.
    pub offsets: usize,
    /// Phase per mm of delay, turns.
    pub turns_per_mm: f64,
    /// Rays that cross each cell.
    pub cell_rays: Vec<CellRays>,
    /// Position of each scanline along the face, in cells.
    pub line_cells: Vec<f64>,
    /// Distance between neighbouring scanlines, in cells.
    pub line_spacing_cells: f64,
    /// Index of the block of samples in the middle of each plane's interval.
    pub plane_blocks: Vec<usize>,
}

/// Rays of a layer that cross a cell.
#[derive(Debug, Clone, Copy, PartialEq)]
pub struct CellRays {
    /// Index of the first ray.
    pub first: usize,
    /// Difference of neighbouring ray indices.
    pub step: usize,
    /// Number of rays.
    pub count: usize,
    /// Weights of the first and of the last ray, 0..=1. Rays between them have weight 1.
    pub weights: [f64; 2],
}

impl From<&aperture::CellRays> for CellRays {
    fn from(rays: &aperture::CellRays) -> Self {
        let [first, step, count] = [rays.first, rays.step, rays.count].map(|v| v as usize);
        Self { first, step, count, weights: rays.parts.map(|part| f64::from(part) / 65535.0) }
    }
}

impl Aperture {
    /// Tables in f64, for scanlines of `samples` samples.
    pub(crate) fn new(tables: &ApertureTables, samples: u32) -> Self {
        let complex = |values: &[[f32; 2]]| -> Vec<DVec2> {
            values.iter().map(|&[re, im]| DVec2::new(re.into(), im.into())).collect()
        };
        let wide = |values: &[f32]| -> Vec<f64> { values.iter().map(|&v| v.into()).collect() };
        let planes = 0..tables.planes;
        let sampling = tables.sampling;
        Self {
            cells: sampling.cells,
            planes: tables.planes,
            plane_mm: tables.plane_mm.into(),
            beams: sampling.beams,
            node_cells: planes.clone().map(|plane| sampling.node_cells_at(plane)).collect(),
            mode_stride: planes.clone().map(|plane| sampling.mode_stride(plane)).collect(),
            mode_count: planes.clone().map(|plane| sampling.modes_at(plane)).collect(),
            plane_blocks: planes.map(|plane| tables.block_of(plane, samples)).collect(),
            modes: tables.modes.clone(),
            steps: complex(&tables.steps),
            transmit: complex(&tables.transmit),
            receive: complex(&tables.receive),
            face: wide(&tables.face),
            reach_cells: wide(&tables.reach_cells),
            greatest: wide(&tables.greatest),
            shares: wide(&tables.shares),
            profiles: wide(&tables.profiles),
            offsets: sampling.offsets(),
            turns_per_mm: tables.turns_per_mm().into(),
            line_spacing_cells: tables.line_spacing_cells.into(),
            cell_rays: tables.cell_rays.iter().map(CellRays::from).collect(),
            line_cells: wide(&tables.line_cells),
        }
    }

    /// Number of beam axes (nodes) along the face at a depth plane.
    pub fn nodes(&self, plane: usize) -> usize {
        self.cells / self.node_cells[plane]
    }

    /// Index, within a period, of the beam whose axis is the node `axis`. Beam 0 is at x = 0, the middle node.
    pub fn beam_of(&self, plane: usize, axis: usize) -> usize {
        (axis + self.nodes(plane) / 2) % self.beams
    }
}
