//! Inputs and outputs of every pass of a frame, to compare passes with their twins.

use glam::{DVec2, DVec3};

use super::configuration::FrameInputs;
use super::constants::{ENTRIES, HINT_BLOCK, SEGMENTS, STARTS, TAG_DENSITY, TISSUE_MASK};
use super::twin::{Inputs, Membership, Path, RasterPoint, Run, Sections, Segment};

/// Outputs of every pass of one frame as words, in the layouts of the shaders.
#[derive(Debug, Default)]
pub(super) struct PassBuffers {
    pub(super) starts_inside: Vec<u32>,
    pub(super) starts: Vec<u32>,
    pub(super) segments: Vec<u32>,
    pub(super) echoes: Vec<u32>,
    pub(super) segment_counts: Vec<u32>,
    pub(super) hints: Vec<u32>,
    /// Baseband before the interfaces echo.
    pub(super) scattered: Vec<u32>,
    pub(super) baseband: Vec<u32>,
    pub(super) focused: Vec<u32>,
    pub(super) lines: Vec<u32>,
    pub(super) polar: Vec<u32>,
    pub(super) entries: Vec<u32>,
    pub(super) entry_counts: Vec<u32>,
    pub(super) raster: Vec<u32>,
    pub(super) percentile: Vec<u32>,
    pub(super) bmode: Vec<u32>,
    pub(super) segmentation: Vec<u32>,
    pub(super) attenuation: Vec<u32>,
    pub(super) overflows: Vec<u32>,
}

/// Inputs and outputs of every pass of one frame, as typed values in f64.
#[derive(Debug, Clone, PartialEq)]
pub struct Snapshot {
    /// Inputs of the passes, beside each other's outputs.
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
    /// Number of crossings and segments that found no room.
    pub overflows: u32,
}

impl Snapshot {
    /// The outputs of a frame as values.
    pub(super) fn new(buffers: &PassBuffers, FrameInputs { bvh, media, configuration }: FrameInputs<'_>) -> Self {
        let (params, tables) = (&configuration.params, &configuration.tables);
        let inputs = Inputs::new(params, tables, &media.surface_words, bvh, configuration.effects.effects());
        let rows = (params.samples as usize, params.row_samples as usize);
        let complex = |words: &[u32]| {
            let row =
                |row: &[u32]| row[..2 * rows.0].chunks_exact(2).map(|c| DVec2::new(real(c[0]), real(c[1]))).collect();
            words.chunks_exact(2 * rows.1).flat_map(|r| -> Vec<DVec2> { row(r) }).collect::<Vec<_>>()
        };
        let paths = (0..inputs.paths()).map(|path| path_from(buffers, path)).collect();
        let runs = buffers.entry_counts[..inputs.map_rays.len()]
            .iter()
            .enumerate()
            .map(|(ray, &count)| {
                let first = ray * 4 * ENTRIES as usize;
                buffers.entries[first..first + 4 * count as usize].chunks_exact(4).map(run_from).collect()
            })
            .collect();
        let raster = buffers.raster[..inputs.map_rays.len() * inputs.map_depths]
            .iter()
            .map(|word| RasterPoint { sum_np: real((word & 0xffff_fe00) >> 1), tissue: (word & 0xff) as usize })
            .collect();
        let (width, stride) = (inputs.image.width as usize, 4 * params.row_words as usize);
        let cropped = |words: &[u32]| {
            let bytes: &[u8] = bytemuck::cast_slice(words);
            bytes.chunks_exact(stride).flat_map(|r| r[..width].to_vec()).collect::<Vec<_>>()
        };
        Self {
            starts_inside: buffers
                .starts_inside
                .chunks_exact(8)
                .map(|w| Membership([w[0], w[1], w[2], w[3], w[4], w[5], w[6], w[7]]))
                .collect(),
            paths,
            hints: buffers.hints.iter().flat_map(|word| word.to_le_bytes()).collect(),
            hint_block: HINT_BLOCK as usize,
            scattered: complex(&buffers.scattered),
            baseband: complex(&buffers.baseband),
            focused: complex(&buffers.focused),
            // A device's buffer of lines that nobody wants is shorter.
            lines: if buffers.lines.len() >= buffers.focused.len() { complex(&buffers.lines) } else { Vec::new() },
            grey: buffers
                .polar
                .chunks_exact(rows.1)
                .flat_map(|row| row[..rows.0].iter().map(|&w| f64::from(w & 0xffff) / 257.0))
                .collect(),
            sections: Sections { runs, raster },
            percentile_np: real(buffers.percentile[0]),
            bmode: cropped(&buffers.bmode),
            segmentation: cropped(&buffers.segmentation),
            attenuation: buffers
                .attenuation
                .chunks_exact(stride)
                .flat_map(|row| row[..width].iter().map(|&w| real(w)))
                .collect(),
            overflows: buffers.overflows[0],
            inputs,
        }
    }
}

/// The f32 of a word.
fn real(word: u32) -> f64 {
    f32::from_bits(word).into()
}

fn path_from(buffers: &PassBuffers, path: usize) -> Path {
    let PassBuffers { starts, segments, echoes, segment_counts, .. } = buffers;
    let segment = |i: usize| {
        let slot = path * SEGMENTS as usize + i;
        let words = &segments[12 * slot..12 * (slot + 1)];
        let vector = |at: usize| DVec3::new(real(words[at]), real(words[at + 1]), real(words[at + 2]));
        Segment {
            start_mm: real(starts[path * STARTS as usize + i]),
            origin_mm: vector(0),
            step: vector(4),
            ln_amplitude_at_zero: real(words[3]),
            fall_np_mm: real(words[7]),
            scatterer_mean: real(words[8]),
            scatterer_deviation: real(words[9]),
            scatterer_density: words[10] & TAG_DENSITY,
            echo: real(echoes[2 * slot]),
            echo_range_mm: real(echoes[2 * slot + 1]),
        }
    };
    Path { segments: (0..segment_counts[path] as usize).map(segment).collect() }
}

fn run_from(words: &[u32]) -> Run {
    Run {
        start_mm: real(words[0]),
        sum_np: real(words[1]),
        rate_np_mm: real(words[2]),
        tissue: (words[3] & TISSUE_MASK) as usize,
    }
}
