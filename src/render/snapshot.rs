//! Inputs and outputs of every pass of a frame, to compare passes with their twins.

use glam::{DVec2, Vec3};

use super::configuration::FrameInputs;
use super::constants::{ENTRIES, HINT_BLOCK, SEGMENTS, STARTS, TAG_DENSITY, TISSUE_MASK};
use super::frame::unpad;
use super::twin::{Inputs, Membership, Path, RasterPoint, Run, Sections, Segment};

/// Outputs of every pass of one frame, in the layouts of the shaders; images without their padding.
#[derive(Debug, Clone, Default)]
pub(super) struct PassBuffers {
    pub(super) starts_inside: Vec<[u32; 8]>,
    pub(super) starts: Vec<f32>,
    pub(super) segments: Vec<[f32; 12]>,
    pub(super) echoes: Vec<[f32; 2]>,
    pub(super) segment_counts: Vec<u32>,
    pub(super) hints: Vec<u32>,
    /// Baseband before the interfaces echo.
    pub(super) scattered: Vec<[f32; 2]>,
    pub(super) baseband: Vec<[f32; 2]>,
    pub(super) focused: Vec<[f32; 2]>,
    pub(super) lines: Vec<[f32; 2]>,
    pub(super) polar: Vec<u32>,
    pub(super) entries: Vec<[f32; 4]>,
    pub(super) entry_counts: Vec<u32>,
    pub(super) raster: Vec<u32>,
    pub(super) percentile_np: f32,
    pub(super) bmode: Vec<u8>,
    pub(super) segmentation: Vec<u8>,
    pub(super) attenuation: Vec<f32>,
    pub(super) overflows: u32,
}

/// Inputs and outputs of every pass of one frame, as typed values in f64.
#[derive(Debug, Clone, PartialEq)]
pub struct Snapshot {
    /// Inputs of the passes, except outputs of other passes.
    pub inputs: Inputs,
    /// `locate`: surfaces that each path starts inside `[paths]`.
    pub starts_inside: Vec<Membership>,
    /// `trace`: paths `[paths]`.
    pub paths: Vec<Path>,
    /// `trace`: segment that holds the first sample of each block of `hint_block` [paths × blocks].
    pub hints: Vec<u8>,
    /// Samples that share a hint.
    pub hint_block: usize,
    /// `march`: baseband of the scatterers [scanlines × samples].
    pub scattered: Vec<DVec2>,
    /// `echo`: the same with the interfaces' echoes.
    pub baseband: Vec<DVec2>,
    /// `lateral`: baseband after the beam.
    pub focused: Vec<DVec2>,
    /// `detect`: baseband after the pulse; empty unless the settings ask for lines.
    pub lines: Vec<DVec2>,
    /// `detect`: grey levels [scanlines × samples].
    pub grey: Vec<f64>,
    /// `section`: media along the map rays.
    pub sections: Sections,
    /// `percentile`: Σμ of the attenuation's 98th percentile, nepers.
    pub percentile_np: f64,
    /// `scan_convert`: grey levels [height × width].
    pub bmode: Vec<u8>,
    /// `scan_convert`: tissue numbers [height × width].
    pub segmentation: Vec<u8>,
    /// `scan_convert`: attenuation over its percentile [height × width].
    pub attenuation: Vec<f64>,
    /// Number of crossings that found no room.
    pub overflows: u32,
}

impl Snapshot {
    /// The outputs of a frame as values.
    pub(super) fn new(buffers: PassBuffers, FrameInputs { bvh, media, configuration }: FrameInputs<'_>) -> Self {
        let (params, tables) = (&configuration.params, &configuration.tables);
        let inputs = Inputs::new(params, tables, &media.surface_words, bvh, configuration.effects.effects());
        let complex = |padded: &[[f32; 2]]| {
            let mut rows = Vec::new();
            unpad(&mut rows, padded, params.samples as usize, params.row_samples as usize);
            rows.into_iter().map(|[re, im]| DVec2::new(re.into(), im.into())).collect()
        };
        let mut polar = Vec::new();
        unpad(&mut polar, &buffers.polar, params.samples as usize, params.row_samples as usize);
        let rays = buffers.entries.chunks_exact(ENTRIES as usize).zip(&buffers.entry_counts);
        let runs = rays.map(|(runs, &count)| runs[..count as usize].iter().map(run_from).collect());
        let point = |word: &u32| RasterPoint {
            sum_np: f32::from_bits((word & 0xffff_fe00) >> 1).into(),
            tissue: (word & 0xff) as usize,
        };
        let raster = buffers.raster[..inputs.map_rays.len() * inputs.map_depths].iter().map(point);
        let sections = Sections { runs: runs.take(inputs.map_rays.len()).collect(), raster: raster.collect() };
        Self {
            starts_inside: buffers.starts_inside.iter().copied().map(Membership).collect(),
            paths: (0..inputs.paths()).map(|path| path_from(&buffers, path)).collect(),
            hints: buffers.hints.iter().flat_map(|word| word.to_le_bytes()).collect(),
            hint_block: HINT_BLOCK as usize,
            scattered: complex(&buffers.scattered),
            baseband: complex(&buffers.baseband),
            focused: complex(&buffers.focused),
            // A device's buffer of lines is shorter if they are not wanted.
            lines: if buffers.lines.len() >= buffers.focused.len() { complex(&buffers.lines) } else { Vec::new() },
            grey: polar.into_iter().map(|word| f64::from(word & 0xffff) / 257.0).collect(),
            sections,
            percentile_np: buffers.percentile_np.into(),
            bmode: buffers.bmode,
            segmentation: buffers.segmentation,
            attenuation: buffers.attenuation.into_iter().map(f64::from).collect(),
            overflows: buffers.overflows,
            inputs,
        }
    }
}

fn path_from(buffers: &PassBuffers, path: usize) -> Path {
    let segment = |i: usize| {
        let slot = path * SEGMENTS as usize + i;
        let [x, y, z, level, dx, dy, dz, fall, mean, deviation, density, _] = buffers.segments[slot];
        let [echo, echo_range_mm] = buffers.echoes[slot].map(f64::from);
        Segment {
            start_mm: buffers.starts[path * STARTS as usize + i].into(),
            origin_mm: Vec3::new(x, y, z).as_dvec3(),
            step: Vec3::new(dx, dy, dz).as_dvec3(),
            ln_amplitude_at_zero: level.into(),
            fall_np_mm: fall.into(),
            scatterer_mean: mean.into(),
            scatterer_deviation: deviation.into(),
            scatterer_density: density.to_bits() & TAG_DENSITY,
            echo,
            echo_range_mm,
        }
    };
    Path { segments: (0..buffers.segment_counts[path] as usize).map(segment).collect() }
}

fn run_from(&[start_mm, sum_np, rate_np_mm, tag]: &[f32; 4]) -> Run {
    let [start_mm, sum_np, rate_np_mm] = [start_mm, sum_np, rate_np_mm].map(f64::from);
    Run { start_mm, sum_np, rate_np_mm, tissue: (tag.to_bits() & TISSUE_MASK) as usize }
}
