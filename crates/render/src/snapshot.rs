//! Inputs and outputs of every pass of a frame, to compare the passes with their f64 twins.

use glam::{DVec2, DVec3, Vec3};
use insonify_core::anatomy::bvh::Moved;

use super::boundary::Boundary;
use super::configuration::FrameInputs;
use super::constants::{ENTRIES, HINT_BLOCK, SEGMENTS, STARTS, TISSUE_MASK};
use super::frame::unpad;
use super::segment::Segment;
use super::twin::{
    self, Aperture, BlockGain, Inputs, Launched, Membership, Motion, Node, Path, Profile, RasterPoint, Run, Sections,
    Transmission,
};

/// Outputs of every pass of one frame, laid out as in the shaders; images are without padding.
#[derive(Debug, Clone, Default)]
pub(super) struct PassBuffers {
    pub(super) starts_inside: Vec<[u32; 8]>,
    pub(super) couplings: Vec<f32>,
    pub(super) starts: Vec<f32>,
    pub(super) segments: Vec<Segment>,
    pub(super) echoes: Vec<[f32; 2]>,
    pub(super) segment_counts: Vec<u32>,
    pub(super) hints: Vec<u32>,
    /// `transmission`: complex transmission of each cell [planes × cells], and each plane's smallest loss of any cell.
    pub(super) mask: Vec<[f32; 2]>,
    pub(super) row_np: Vec<f32>,
    /// `needle_shadow`: the same cells behind the needle; empty without a needle.
    pub(super) shaded_mask: Vec<[f32; 2]>,
    /// `propagate`: fields, and the first plane that they include.
    pub(super) fields: Vec<f32>,
    pub(super) first_plane: u32,
    /// Two-way amplitudes [planes × beams × cells] from `first_plane` on, and echo powers [planes × cells]: outputs of
    /// `beams`. On a device, the powers come from `profiles`.
    pub(super) amplitudes: Vec<f32>,
    pub(super) beam_powers: Vec<f32>,
    /// `profiles`: weights [planes × scanlines × taps]; kept part of the depth's kernel, first tap and end [planes ×
    /// scanlines].
    pub(super) profiles: Vec<f32>,
    pub(super) blends: Vec<[f32; 3]>,
    /// `visibility`: gain along the scanlines [scanlines × (planes + 1)].
    pub(super) line_gains: Vec<Boundary>,
    /// `visibility`: gain and position of each block [scanlines × blocks].
    pub(super) block_gains: Vec<[f32; 2]>,
    /// `march`: amplitude on reflected paths over amplitude with the aperture's gain [scanlines × blocks].
    pub(super) reflected: Vec<f32>,
    /// Baseband before and after `echo` adds the interfaces.
    pub(super) scattered: Vec<[f32; 2]>,
    pub(super) baseband: Vec<[f32; 2]>,
    /// Focused baseband before and after `receive` adds to it.
    pub(super) focused: Vec<[f32; 2]>,
    /// Focused baseband after `needle_echo`; empty without a needle.
    pub(super) with_needle: Vec<[f32; 2]>,
    /// Focused baseband after `multiples`; the same as before without the effect.
    pub(super) with_multiples: Vec<[f32; 2]>,
    pub(super) received: Vec<[f32; 2]>,
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
    /// The moved scene, if a device moved it; on the host, the tree holds it.
    pub(super) moved: Option<Moved>,
}

/// Inputs and outputs of every pass of one frame, as f64 values.
#[derive(Debug, Clone, PartialEq)]
pub struct Snapshot {
    /// Inputs of the passes, without outputs of other passes.
    pub inputs: Inputs,
    /// `displace`: displacement of each moving vertex from its rest position, mm; empty without motion.
    pub displaced_mm: Vec<DVec3>,
    /// `refit`: nodes of the moved tree; empty without motion.
    pub nodes: Vec<Node>,
    /// `locate`: for each path, the surfaces that it starts inside, and the coupling of its part of the face.
    pub launches: Vec<Launched>,
    /// `trace`: all paths, axial paths last.
    pub paths: Vec<Path>,
    /// `trace`: index of the segment at the first sample of each block of `hint_block` samples [paths × blocks].
    pub hints: Vec<u8>,
    /// Number of samples that share a hint.
    pub hint_block: usize,
    /// `transmission`; like all outputs up to `block_gains`, empty without the aperture.
    pub transmission: Transmission,
    /// `needle_shadow`: the transmission's cells with the needle's shadow; the same without a needle.
    pub shaded_mask: Vec<DVec2>,
    /// `propagate`: field of each mode (a wave along the face) at each cell [modes × planes × cells]. Valid from
    /// `first_plane` on.
    pub fields: Vec<DVec2>,
    /// First depth plane of `fields` and `amplitudes`.
    pub first_plane: usize,
    /// `beams`: two-way amplitude of each beam of a period at each cell [planes × beams × cells]. Valid from
    /// `first_plane` on.
    pub amplitudes: Vec<f64>,
    /// Echo power of the beam at each node [planes × cells], from `beams` on the host and `profiles` on a device. Only
    /// the first elements of each row have values.
    pub beam_powers: Vec<f64>,
    /// `profiles`: weights of neighbouring scanlines [planes × scanlines].
    pub profiles: Vec<Profile>,
    /// `visibility`: gain along the scanlines [scanlines × (planes + 1)].
    pub line_gains: Vec<twin::Boundary>,
    /// `visibility`: gain of each block, and its position among the depth planes [scanlines × blocks].
    pub block_gains: Vec<BlockGain>,
    /// `march`: ratio of the scatterers' amplitude on reflected paths to their amplitude with the aperture's gain, at
    /// the first sample of each block [scanlines × blocks].
    pub reflected: Vec<f64>,
    /// `march`: baseband of the scatterers [scanlines × samples].
    pub scattered: Vec<DVec2>,
    /// `echo`: `scattered` with the echoes of interfaces.
    pub baseband: Vec<DVec2>,
    /// `lateral`: `baseband` after the lateral point-spread function.
    pub focused: Vec<DVec2>,
    /// `needle_echo`: `focused` with the echoes of the needle; the same without a needle.
    pub with_needle: Vec<DVec2>,
    /// `multiples`: `with_needle` with echoes that the face reflects; the same without the effect.
    pub with_multiples: Vec<DVec2>,
    /// `receive`: `with_multiples` with noise, clutter and reverberation.
    pub received: Vec<DVec2>,
    /// `detect`: `received` after the pulse; empty unless the settings ask for lines.
    pub lines: Vec<DVec2>,
    /// `detect`: grey levels [scanlines × samples × levels per sample].
    pub grey: Vec<f64>,
    /// `section`: stretches of media along the map rays, and their raster.
    pub sections: Sections,
    /// `percentile`: one-way Σμ at the 98th percentile of the attenuation, nepers.
    pub percentile_np: f64,
    /// `scan_convert`: grey levels [height × width].
    pub bmode: Vec<u8>,
    /// `scan_convert`: tissue numbers [height × width].
    pub segmentation: Vec<u8>,
    /// `scan_convert`: attenuation over its 98th percentile [height × width].
    pub attenuation: Vec<f64>,
    /// Number of crossings and interactions that exceeded the buffers' capacity.
    pub overflows: u32,
}

impl Snapshot {
    /// Converts the passes' outputs from the shaders' layouts.
    pub(super) fn new(buffers: PassBuffers, FrameInputs { bvh, media, configuration, angle }: FrameInputs<'_>) -> Self {
        let (params, tables) = (&configuration.params, &configuration.tables);
        let moved = buffers.moved.as_ref().cloned().or_else(|| bvh.moved());
        let triangles = moved
            .as_ref()
            .map_or((&bvh.triangles[..], bvh.displacements()), |m| (&m.triangles[..], &m.displacements[..]));
        let motion = bvh.motion_tables().zip(moved.as_ref()).map(|(tables, moved)| Motion::new(&tables, moved));
        let effects = configuration.effects.effects();
        let needle = configuration.needle.as_ref().map(twin::Needle::new);
        let has_needle = needle.is_some();
        let inputs =
            Inputs { motion, needle, ..Inputs::new(params, tables, &media.surface_words, triangles, effects, angle) };
        let complex = |padded: &[[f32; 2]]| {
            let mut rows = Vec::new();
            unpad(&mut rows, padded, params.samples as usize, params.row_samples as usize);
            rows.into_iter().map(|[re, im]| DVec2::new(re.into(), im.into())).collect()
        };
        let mut polar = Vec::new();
        let levels = (params.samples * params.levels_per_sample) as usize;
        unpad(&mut polar, &buffers.polar, levels, params.row_levels() as usize);
        let rays = buffers.entries.chunks_exact(ENTRIES as usize).zip(&buffers.entry_counts);
        let runs = rays.map(|(runs, &count)| runs[..count as usize].iter().map(run_from).collect());
        let point = |word: &u32| RasterPoint {
            sum_np: f32::from_bits((word & 0xffff_fe00) >> 1).into(),
            tissue: (word & 0xff) as usize,
        };
        let raster = buffers.raster[..inputs.map_rays.len() * inputs.map_depths].iter().map(point);
        let sections = Sections { runs: runs.take(inputs.map_rays.len()).collect(), raster: raster.collect() };
        Self {
            displaced_mm: moved.iter().flat_map(|moved| &moved.vertices).map(place).collect(),
            nodes: moved.iter().flat_map(|moved| &moved.nodes).map(Node::decode).collect(),
            launches: launches_from(&buffers),
            paths: (0..inputs.paths()).map(|path| path_from(&buffers, path)).collect(),
            hints: buffers.hints.iter().flat_map(|word| word.to_le_bytes()).collect(),
            hint_block: HINT_BLOCK as usize,
            transmission: transmission_from(&buffers, &inputs),
            shaded_mask: mask_from(if has_needle { &buffers.shaded_mask } else { &buffers.mask }, &inputs),
            fields: fields_from(&buffers, &inputs),
            first_plane: buffers.first_plane as usize,
            amplitudes: wide(&buffers.amplitudes, of_aperture(&inputs, |a| a.planes * a.beams * a.cells)),
            profiles: profiles_from(&buffers, &inputs),
            beam_powers: wide(&buffers.beam_powers, of_aperture(&inputs, |a| a.planes * a.cells)),
            line_gains: line_gains_from(&buffers, &inputs),
            block_gains: block_gains_from(&buffers, &inputs),
            reflected: reflected_from(&buffers, &inputs),
            scattered: complex(&buffers.scattered),
            baseband: complex(&buffers.baseband),
            focused: complex(&buffers.focused),
            with_needle: complex(if has_needle { &buffers.with_needle } else { &buffers.focused }),
            with_multiples: complex(&buffers.with_multiples),
            received: complex(&buffers.received),
            // A device's buffer of lines is shorter if the settings don't ask for lines.
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

fn place(&[x, y, z, _]: &[f32; 4]) -> DVec3 {
    Vec3::new(x, y, z).as_dvec3()
}

/// One of the aperture's sizes; 0 without the effect `aperture`.
fn of_aperture(inputs: &Inputs, size: impl Fn(&Aperture) -> usize) -> usize {
    inputs.aperture.as_ref().map_or(0, size)
}

/// The first `count` numbers of a buffer, as f64.
fn wide(values: &[f32], count: usize) -> Vec<f64> {
    values.iter().take(count).map(|&v| v.into()).collect()
}

fn transmission_from(buffers: &PassBuffers, inputs: &Inputs) -> Transmission {
    Transmission {
        mask: mask_from(&buffers.mask, inputs),
        row_np: wide(&buffers.row_np, of_aperture(inputs, |a| a.planes)),
    }
}

fn mask_from(mask: &[[f32; 2]], inputs: &Inputs) -> Vec<DVec2> {
    mask.iter().take(of_aperture(inputs, |a| a.planes * a.cells)).map(complex).collect()
}

/// Fields as complex numbers; the buffer has real and imaginary parts in separate rows.
fn fields_from(buffers: &PassBuffers, inputs: &Inputs) -> Vec<DVec2> {
    let rows = of_aperture(inputs, |a| a.modes.len() * a.planes);
    let cells = of_aperture(inputs, |a| a.cells).max(1);
    let row = |row: &[f32]| {
        let (re, im) = row.split_at(cells);
        re.iter().zip(im).map(|(&re, &im)| DVec2::new(re.into(), im.into())).collect::<Vec<_>>()
    };
    buffers.fields.chunks_exact(2 * cells).take(rows).flat_map(row).collect()
}

fn line_gains_from(buffers: &PassBuffers, inputs: &Inputs) -> Vec<twin::Boundary> {
    let boundary = |boundary: &Boundary| twin::Boundary {
        position: boundary.position.into(),
        loss_np: boundary.loss_np.into(),
        ln_gain: boundary.ln_gain.into(),
        shared_np: boundary.shared_np.into(),
    };
    let count = of_aperture(inputs, |a| inputs.scanlines * (a.planes + 1));
    buffers.line_gains.iter().take(count).map(boundary).collect()
}

fn block_gains_from(buffers: &PassBuffers, inputs: &Inputs) -> Vec<BlockGain> {
    let count = of_aperture(inputs, |_| inputs.scanlines * inputs.blocks());
    let gain = |&[gain, position]: &[f32; 2]| BlockGain { gain: gain.into(), position: position.into() };
    buffers.block_gains.iter().take(count).map(gain).collect()
}

fn reflected_from(buffers: &PassBuffers, inputs: &Inputs) -> Vec<f64> {
    let count = of_aperture(inputs, |_| inputs.scanlines * inputs.blocks());
    buffers.reflected.iter().take(count).map(|&over_aperture| over_aperture.into()).collect()
}

/// Profiles with zeros beyond their ends, where the buffer holds unused values.
fn profiles_from(buffers: &PassBuffers, inputs: &Inputs) -> Vec<Profile> {
    let taps = inputs.lateral_kernels[0].len();
    let count = of_aperture(inputs, |a| inputs.scanlines * a.planes);
    let profile = |(weights, &[kept, first, end]): (&[f32], &[f32; 3])| {
        let within = |(tap, &weight): (usize, &f32)| {
            if (first as usize..end as usize).contains(&tap) { weight.into() } else { 0.0 }
        };
        Profile { kept: kept.into(), weights: weights.iter().enumerate().map(within).collect() }
    };
    buffers.profiles.chunks_exact(taps).zip(&buffers.blends).take(count).map(profile).collect()
}

fn complex(&[re, im]: &[f32; 2]) -> DVec2 {
    DVec2::new(re.into(), im.into())
}

fn launches_from(buffers: &PassBuffers) -> Vec<Launched> {
    let starts = buffers.starts_inside.iter().zip(&buffers.couplings);
    starts.map(|(&inside, &coupling)| Launched { inside: Membership(inside), coupling: coupling.into() }).collect()
}

fn path_from(buffers: &PassBuffers, path: usize) -> Path {
    let segment = |i: usize| {
        let slot = path * SEGMENTS as usize + i;
        let segment = &buffers.segments[slot];
        let [echo, echo_range_mm] = buffers.echoes[slot].map(f64::from);
        twin::Segment {
            start_mm: buffers.starts[path * STARTS as usize + i].into(),
            origin_mm: Vec3::from(segment.origin_mm).as_dvec3(),
            step: Vec3::from(segment.step).as_dvec3(),
            ln_amplitude_at_zero: segment.ln_amplitude_at_zero.into(),
            fall_np_mm: segment.fall_np_mm.into(),
            scatterer_mean: segment.scatterer_mean.into(),
            scatterer_deviation: segment.scatterer_deviation.into(),
            scatterer_density: segment.scatterer_density(),
            texture: segment.texture(),
            has_reflected: segment.has_reflected(),
            ln_passed_at_zero: segment.ln_passed_at_zero.into(),
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
