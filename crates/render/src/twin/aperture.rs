//! Tables of the aperture in f64.

use glam::DVec2;

use crate::aperture::{self, ApertureTables};

/// Tables of the aperture as uploaded to the device.
#[derive(Debug, Clone, PartialEq)]
pub struct Aperture {
    /// Cells along the face.
    pub cells: usize,
    /// Planes, one in the middle of each interval.
    pub planes: usize,
    /// Depth of an interval, mm.
    pub plane_mm: f64,
    /// Beams per period of the modes.
    pub beams: usize,
    /// Cells per node at each plane.
    pub node_cells: Vec<usize>,
    /// Distance of neighbouring modes at each plane, in their numbers: 2 without the odd ones.
    pub mode_stride: Vec<i32>,
    /// Modes, padding included, that take part at each plane.
    pub mode_count: Vec<usize>,
    /// Number of each mode; None pads.
    pub modes: Vec<Option<i32>>,
    /// Propagation of each spatial frequency to each plane, over the number of cells [planes × cells].
    pub steps: Vec<DVec2>,
    /// Part of each mode in the transmit beam.
    pub transmit: Vec<DVec2>,
    /// The same in the receive beam of each plane [planes × modes].
    pub receive: Vec<DVec2>,
    /// Sensitivity of the face at each cell.
    pub face: Vec<f64>,
    /// Distance at each plane, in cells, within which a beam's scatterers are summed.
    pub reach_cells: Vec<f64>,
    /// Greatest echo power of the beams without obstacles `[planes]`.
    pub greatest: Vec<f64>,
    /// Echo power of each beam without obstacles over that greatest one [planes × cells].
    pub shares: Vec<f64>,
    /// Two-way amplitude of an unobstructed beam against the offset from its axis, in cells [planes × offsets].
    pub profiles: Vec<f64>,
    /// Offsets of a profile.
    pub offsets: usize,
    /// Turns of a wave per mm of delay.
    pub turns_per_mm: f64,
    /// Rays of each cell.
    pub cell_rays: Vec<CellRays>,
    /// Position of each scanline, in cells.
    pub line_cells: Vec<f64>,
    /// Distance of neighbouring scanlines, in cells.
    pub line_spacing_cells: f64,
    /// Block of samples in the middle of each plane's interval.
    pub plane_blocks: Vec<usize>,
}

/// Rays of a layer that cross a cell.
#[derive(Debug, Clone, Copy, PartialEq)]
pub struct CellRays {
    /// The first ray.
    pub first: usize,
    /// Distance to the next.
    pub step: usize,
    /// Number of rays.
    pub count: usize,
    /// Weights of the first ray and of the last; those between them count 1.
    pub weights: [f64; 2],
}

impl From<&aperture::CellRays> for CellRays {
    fn from(rays: &aperture::CellRays) -> Self {
        let [first, step, count] = [rays.first, rays.step, rays.count].map(|v| v as usize);
        Self { first, step, count, weights: rays.parts.map(|part| f64::from(part) / 65535.0) }
    }
}

impl Aperture {
    /// Tables for scanlines of a number of samples.
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

    /// Nodes at a plane.
    pub fn nodes(&self, plane: usize) -> usize {
        self.cells / self.node_cells[plane]
    }

    /// Beam, within a period, whose axis is at a node: x = 0 is in the middle of the nodes.
    pub fn beam_of(&self, plane: usize, axis: usize) -> usize {
        (axis + self.nodes(plane) / 2) % self.beams
    }
}
